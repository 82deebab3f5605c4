//! How much of a bus the frames of its patches take.

use taxel_engine::plan::{PatchPlan, Plan};
use taxel_skin::BusIndex;

use super::fault::Faults;
use super::file::Config;

/// Bits of a classic frame with eight bytes, unstuffed and with the gap that follows, at 1 Mbit/s in seconds.
const FRAME_S: f64 = 111e-6;

/// The same of a frame without any: no frame of described signals takes less.
const EMPTY_FRAME_S: f64 = 47e-6;

/// From this share on frames wait for each other, and those of one scan come in two.
const CROWDED_FROM: f64 = 0.8;

/// Frames a second that a patch reads from its buses, and the share of one of 1 Mbit/s that they take with eight bytes each.
pub fn of_patch(plan: &PatchPlan) -> (f64, f64) {
    let frames = match plan.devices.iter().map(|device| device.frames.len()).sum::<usize>() {
        0 => 2 * plan.patch.modules().len(),
        described => described,
    };
    let frames_per_s = frames as f64 / plan.period.as_secs_f64();
    (frames_per_s, frames_per_s * FRAME_S)
}

/// The share that they take at least: of described frames nobody says how long they are.
fn least_of_patch(plan: &PatchPlan) -> f64 {
    let frame_s = if plan.devices.is_empty() { FRAME_S } else { EMPTY_FRAME_S };
    of_patch(plan).0 * frame_s
}

/// The share of a bus that its patches take at least. Boards of one patch may be on several buses: each has its part of the modules.
fn of_bus(plan: &Plan, bus: BusIndex) -> f64 {
    let share = |patch: &PatchPlan| {
        let boards = patch.patch.boards();
        let on_bus =
            |module: &&taxel_skin::ModuleSite| boards.get(usize::from(module.board)).is_some_and(|b| b.bus == bus);
        let (modules, all) = (patch.patch.modules().iter().filter(on_bus).count(), patch.patch.modules().len());
        least_of_patch(patch) * modules as f64 / all.max(1) as f64
    };
    plan.patches.iter().filter(|patch| patch.pushed.is_none()).map(share).sum()
}

fn told(config: &Config, bus: usize, share: f64) -> String {
    format!("bus `{}`: the scans of its patches take {:.0} % of 1 Mbit/s", config.bus[bus].name, 100.0 * share)
}

/// Notes the buses that cannot carry what their patches send.
pub fn overloaded(config: &Config, plan: &Plan, faults: &mut Faults) {
    for bus in 0..config.bus.len() {
        let index = BusIndex(bus as u8);
        let share = of_bus(plan, index);
        if share > 1.0 {
            let patch = plan.patches.iter().find(|patch| patch.patch.is_on(index));
            let key = patch.map_or_else(String::new, |patch| config.patch_key(patch.patch.name()) + ".period_ms");
            let words = format!("{}: raise period_ms, or put boards on another bus", told(config, bus, share));
            faults.note(&key, words);
        }
    }
}

/// Buses that are nearly full, in words.
pub fn crowded(config: &Config, plan: &Plan) -> Vec<String> {
    let shares = (0..config.bus.len()).map(|bus| (bus, of_bus(plan, BusIndex(bus as u8))));
    let words =
        |(bus, share)| format!("{}: frames will be late; a greater period_ms leaves room", told(config, bus, share));
    shares.filter(|(_, share)| (CROWDED_FROM..=1.0).contains(share)).map(words).collect()
}
