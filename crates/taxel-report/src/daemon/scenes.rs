//! What the full scene costs against a lean one on the same simulated traffic.

use std::time::{Duration, Instant};

use futures_util::future::try_join_all;
use taxel_proto::v1::StreamTaxelsRequest;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_store::models_json;
use tonic::transport::Channel;

use super::client::{self, Traffic};
use super::process::{Daemon, Home, Scene};
use crate::document::{Aim, Section, Table, row};
use crate::numbers::three_digits as figure;
use crate::options::Options;
use crate::rig::fits;

/// Force subscribers of the full scene, beside one to all taxels.
const FULL_FORCE_SUBSCRIBERS: usize = 4;

/// Of the forearm, calibrated, with every output.
const MEMORY_AIM_MIB: f64 = 30.0;

/// Who reads a daemon, each value as it comes.
#[derive(Clone, Copy)]
struct Subscribers {
    force: usize,
    taxels: usize,
}

/// A scene's daemon under observation.
#[derive(Clone, Copy)]
struct Observed {
    cpu_us_per_scan: f64,
    wakes_per_scan: f64,
    bytes_per_s: f64,
    bytes_per_s_of_force: f64,
    subscribers: usize,
    memory_mib: f64,
}

/// Measures both scenes as processes.
///
/// # Errors
/// If a daemon cannot be started or comes to no force.
pub fn scenes(options: &Options) -> anyhow::Result<Section> {
    let models = models_json::to_json(&*fits::calibrate(options.seed)?)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let observed = runtime.block_on(observe_both(options, models))?;
    Ok(section(observed))
}

async fn observe_both(options: &Options, models: String) -> anyhow::Result<[Observed; 2]> {
    let window = Duration::from_secs(if options.quick { 3 } else { 20 });
    let home = |scene| Home::forearm(&options.taxeld, "", scene, options.seed);
    let (full_home, lean_home) = (home(Scene::Full)?, home(Scene::Lean)?);
    // Started together, since most of a start is waiting, and observed one after the other.
    let starts = (client::start(&full_home, Some(models.clone())), client::start(&lean_home, Some(models)));
    let ((full, full_channel, _), (lean, lean_channel, _)) = tokio::try_join!(starts.0, starts.1)?;
    let everybody = Subscribers { force: FULL_FORCE_SUBSCRIBERS, taxels: 1 };
    Ok([
        observe(&full, &full_channel, everybody, window).await?,
        observe(&lean, &lean_channel, Subscribers { force: 1, taxels: 0 }, window).await?,
    ])
}

async fn observe(daemon: &Daemon, channel: &Channel, who: Subscribers, window: Duration) -> anyhow::Result<Observed> {
    let (before, begun) = (daemon.used()?, Instant::now());
    let force = || async { client::count(client::stream(channel.clone(), "", None).await?, window).await };
    let taxels = || async {
        let request = StreamTaxelsRequest { patch: String::new(), rate_hz: None };
        client::count(SkinServiceClient::new(channel.clone()).stream_taxels(request).await?.into_inner(), window).await
    };
    let force = try_join_all((0..who.force).map(|_| force()));
    let (force, taxels) = tokio::try_join!(force, try_join_all((0..who.taxels).map(|_| taxels())))?;
    let (used, elapsed) = (daemon.used()?, begun.elapsed());
    // A force subscriber who takes each value as it comes gets one message a scan.
    let scans = force[0].messages.max(1) as f64;
    let per_s = |bytes: u64| bytes as f64 / elapsed.as_secs_f64();
    Ok(Observed {
        cpu_us_per_scan: used.processor.saturating_sub(before.processor).as_secs_f64() * 1e6 / scans,
        wakes_per_scan: used.wakes.saturating_sub(before.wakes) as f64 / scans,
        bytes_per_s: per_s(force.iter().chain(&taxels).map(|traffic: &Traffic| traffic.bytes).sum()),
        bytes_per_s_of_force: per_s(force[0].bytes),
        subscribers: who.force + who.taxels,
        memory_mib: used.memory_mib,
    })
}

fn section([full, lean]: [Observed; 2]) -> Section {
    let what = "resident memory for a forearm with every output, MiB";
    let ratio = |of: fn(&Observed) -> f64| figure(of(&full) / of(&lean));
    Section {
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
                ratio(|scene| scene.memory_mib),
            ),
        ],
        aims: vec![Aim::at_most(what, full.memory_mib, MEMORY_AIM_MIB)],
        tables: vec![scene_table([&full, &lean])],
        ..Section::default()
    }
}

fn scene_table([full, lean]: [&Observed; 2]) -> Table {
    let row = |what: &str, of: fn(&Observed) -> f64| row![what, of(full), of(lean), of(full) / of(lean)];
    let rows = vec![
        row("processor time of the daemon, us per scan", |scene| scene.cpu_us_per_scan),
        row("wakes of the daemon per scan", |scene| scene.wakes_per_scan),
        row("subscribers", |scene| scene.subscribers as f64),
        row("bytes to one force subscriber, per s", |scene| scene.bytes_per_s_of_force),
        row("bytes to all subscribers, per s", |scene| scene.bytes_per_s),
        row("resident memory, MiB", |scene| scene.memory_mib),
    ];
    let columns = ["what", "full (all outputs)", "lean (shipped default)", "full / lean"];
    Table::new("scenes-costs", "The same simulated traffic in both scenes.", columns, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole_and_every_aim_is_judged() {
        let observed = Observed {
            cpu_us_per_scan: 100.0,
            wakes_per_scan: 10.0,
            bytes_per_s: 4_000.0,
            bytes_per_s_of_force: 3_000.0,
            subscribers: 1,
            memory_mib: 8.0,
        };
        let section = section([observed; 2]);
        let table = &section.tables[0];
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len() && row[3] == 1.0.into()), "{table:?}");
        assert!(section.aims.iter().all(|aim| aim.met == Some(true)), "{:?}", section.aims);
    }
}
