//! A host that listens.

pub use std::time::Duration;
pub use taxel_sim::{Config, Fault, Mass, PumpCommand, Skin, World};
pub use taxel_skin::{BoardAddress, Kilopascal, Module, TaxelIndex, Time};
pub use taxel_wire::TimedFrame;
pub use taxel_wire::icub::{Message, decode};

pub fn seconds(s: f64) -> Time {
    Time::from_seconds(s)
}

pub fn board(address: u8) -> BoardAddress {
    BoardAddress::new(address).unwrap()
}

/// A world whose boards stream from the start.
pub fn streaming(seed: u64) -> World {
    let mut config = Config::seeded(seed);
    config.boards.start_streaming = true;
    World::new(Skin::forearm().unwrap(), config)
}

/// A world whose boards wait for commands.
pub fn silent(seed: u64) -> World {
    World::new(Skin::forearm().unwrap(), Config::seeded(seed))
}

pub fn advance(world: &mut World, until_s: f64) -> Vec<TimedFrame> {
    let mut out = Vec::new();
    world.advance(seconds(until_s), &mut out);
    out
}

pub fn ramp(target: f64, kpa_per_s: f64) -> PumpCommand {
    PumpCommand::Ramp { target: Kilopascal(target), kpa_per_s }
}

/// The skin messages among the frames.
pub fn messages(frames: &[TimedFrame]) -> Vec<(Time, Message)> {
    frames.iter().filter_map(|timed| Some((timed.time, decode(&timed.frame).ok()?))).collect()
}

/// Mean value of all twelve values of every module, in the patch's order of modules; NaN without frames.
pub fn module_means(world: &World, frames: &[TimedFrame]) -> Vec<[f64; 12]> {
    let patch = world.skin().patch();
    let mut sums = vec![[(0.0, 0.0); 12]; patch.modules().len()];
    for (_, message) in messages(frames) {
        let (address, module, first, values) = match message {
            Message::Head { board, module, values } => (board, module, 0, values.to_vec()),
            Message::Tail { board, module, values, .. } => (board, module, 7, values.to_vec()),
            _ => continue,
        };
        let index = patch
            .modules()
            .iter()
            .position(|site| patch.boards()[site.board as usize].address == address && site.module == module);
        let Some(index) = index else { continue };
        for (k, value) in values.iter().enumerate() {
            let (sum, count) = &mut sums[index][first + k];
            (*sum, *count) = (*sum + f64::from(*value), *count + 1.0);
        }
    }
    sums.into_iter().map(|module| module.map(|(sum, count)| sum / count)).collect()
}

/// Mean count of every taxel in the patch's order.
pub fn taxel_means(world: &World, frames: &[TimedFrame]) -> Vec<f64> {
    let means = module_means(world, frames);
    world.skin().patch().taxels().iter().map(|site| means[site.module as usize][site.slot as usize]).collect()
}

pub fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt())
}
