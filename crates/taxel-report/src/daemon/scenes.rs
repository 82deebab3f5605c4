//! What the full scene costs against a lean one on the same simulated traffic.

use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_engine::model_set::ModelSet;
use taxel_store::models_json;
use tonic::transport::Channel;

use super::client::{self, StreamOf, Traffic};
use super::process::{Daemon, Home, Scene};
use crate::document::{Aim, Section, Table, row};
use crate::numbers::three_digits as figure;
use crate::options::Options;
use crate::rig::fits;

/// Force subscribers of the full scene, beside one to all taxels.
const FULL_FORCE_SUBSCRIBERS: usize = 4;

/// Of the forearm, calibrated, with every output.
const MEMORY_AIM_MIB: f64 = 30.0;

/// A scene's daemon under observation.
struct Observed {
    cpu_us_per_scan: f64,
    wakes_per_scan: f64,
    bytes_per_s: f64,
    bytes_per_s_of_force: f64,
    subscribers: usize,
    resident_bytes: f64,
}

/// Measures both scenes as processes.
///
/// # Errors
/// If a daemon cannot be started or comes to no force.
pub fn scenes(options: &Options) -> anyhow::Result<Section> {
    let set = fits::calibrate(options.seed)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let observed = runtime.block_on(observe_both(options, &set))?;
    Ok(section(&observed))
}

async fn observe_both(options: &Options, set: &ModelSet) -> anyhow::Result<[Observed; 2]> {
    let window = Duration::from_secs(if options.quick { 3 } else { 20 });
    let json = models_json::to_json(set)?;
    let (full_home, lean_home) = (Home::new(options, Scene::Full)?, Home::new(options, Scene::Lean)?);
    // Started together, since most of a start is waiting, and observed one after the other.
    let (mut full, mut lean) = (full_home.start()?, lean_home.start()?);
    let (full_channel, lean_channel) = (ready(&mut full, &json).await?, ready(&mut lean, &json).await?);
    client::first_force(&full_channel).await.with_context(|| full.complaints())?;
    client::first_force(&lean_channel).await.with_context(|| lean.complaints())?;
    let mut streams = vec![StreamOf::Force; FULL_FORCE_SUBSCRIBERS];
    streams.push(StreamOf::Taxels);
    Ok([
        observe(&full, &full_channel, &streams, window).await?,
        observe(&lean, &lean_channel, &[StreamOf::Force], window).await?,
    ])
}

async fn ready(daemon: &mut Daemon, json: &str) -> anyhow::Result<Channel> {
    let channel = client::connect(daemon).await?;
    client::give_models(&channel, json.to_owned(), "").await?;
    Ok(channel)
}

async fn observe(
    daemon: &Daemon,
    channel: &Channel,
    streams: &[StreamOf],
    window: Duration,
) -> anyhow::Result<Observed> {
    let (before, begun) = (daemon.used()?, Instant::now());
    let mut counting = tokio::task::JoinSet::new();
    for &what in streams {
        let channel = channel.clone();
        counting.spawn(async move { client::count(channel, what, window).await.map(|traffic| (what, traffic)) });
    }
    let (mut all, mut force) = (Traffic::default(), Traffic::default());
    while let Some(counted) = counting.join_next().await {
        let (what, traffic) = counted??;
        all.bytes += traffic.bytes;
        if what == StreamOf::Force {
            force = traffic;
        }
    }
    let elapsed = begun.elapsed();
    let used = daemon.used()?;
    let scans = force.messages.max(1) as f64;
    let per_s = |count: u64| count as f64 / elapsed.as_secs_f64();
    Ok(Observed {
        // A force subscriber who takes each value as it comes gets one message a scan.
        cpu_us_per_scan: used.processor.saturating_sub(before.processor).as_secs_f64() * 1e6 / scans,
        wakes_per_scan: used.wakes.saturating_sub(before.wakes) as f64 / scans,
        bytes_per_s: per_s(all.bytes),
        bytes_per_s_of_force: per_s(force.bytes),
        subscribers: streams.len(),
        resident_bytes: daemon.resident_bytes()?,
    })
}

fn section(observed: &[Observed; 2]) -> Section {
    let [full, lean] = observed;
    let what = "resident memory for a forearm with every output, MiB";
    let ratio = |of: fn(&Observed) -> f64| figure(of(full) / of(lean));
    Section {
        id: "scenes".to_owned(),
        title: "Scenes: what is left out costs nothing".to_owned(),
        text: vec![
            format!(
                "Two daemons on the same simulated forearm. The full scene has geometry, gauge and every output, and \
                 serves {FULL_FORCE_SUBSCRIBERS} force subscribers and one to all taxels, each value as it comes; the \
                 lean one, the shipped default, has the total force and one subscriber. Both bring the boards up, since \
                 somebody must start the simulated ones: on a real robot listen_only leaves that out too. The processor \
                 time is that of the daemon's process without the simulator; what the engine alone takes for a scan is \
                 measured by the example scan_time of taxel-engine, also of ten full buses."
            ),
            format!(
                "The full scene takes {} times the processor time of the lean one per scan, sends {} times the bytes and \
                 holds {} times the memory.",
                ratio(|scene| scene.cpu_us_per_scan),
                ratio(|scene| scene.bytes_per_s),
                ratio(|scene| scene.resident_bytes),
            ),
        ],
        aims: vec![Aim::at_most(what, mebibytes(full.resident_bytes), MEMORY_AIM_MIB)],
        figures: Vec::new(),
        tables: vec![scene_table(observed)],
    }
}

fn mebibytes(bytes: f64) -> f64 {
    bytes / f64::from(1 << 20)
}

fn scene_table([full, lean]: &[Observed; 2]) -> Table {
    let row = |what: &str, of: &dyn Fn(&Observed) -> f64| row![what, of(full), of(lean), of(full) / of(lean)];
    let rows = vec![
        row("processor time of the daemon, us per scan", &|scene| scene.cpu_us_per_scan),
        row("wakes of the daemon per scan", &|scene| scene.wakes_per_scan),
        row("subscribers", &|scene| scene.subscribers as f64),
        row("bytes to one force subscriber, per s", &|scene| scene.bytes_per_s_of_force),
        row("bytes to all subscribers, per s", &|scene| scene.bytes_per_s),
        row("resident memory, MiB", &|scene| mebibytes(scene.resident_bytes)),
    ];
    let columns = ["what", "full (all outputs)", "lean (shipped default)", "full / lean"];
    Table::new("scenes-costs", "The same simulated traffic in both scenes.", columns, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole_and_every_aim_is_judged() {
        let observed = || Observed {
            cpu_us_per_scan: 100.0,
            wakes_per_scan: 10.0,
            bytes_per_s: 4_000.0,
            bytes_per_s_of_force: 3_000.0,
            subscribers: 1,
            resident_bytes: 8e6,
        };
        let section = section(&[observed(), observed()]);
        let table = &section.tables[0];
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len() && row[3] == 1.0.into()), "{table:?}");
        assert!(section.aims.iter().all(|aim| aim.met == Some(true)), "{:?}", section.aims);
    }
}
