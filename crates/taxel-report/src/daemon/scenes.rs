//! What the full scene costs against a lean one on the same simulated traffic.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_engine::model_set::ModelSet;
use taxel_store::models_json;
use tonic::transport::Channel;

use super::binary::{self, Size};
use super::client::{self, StreamOf, Traffic};
use super::engine_time::{self, EngineTime};
use super::figures::{figure, quantile};
use super::process::{Daemon, Home, Scene};
use super::rig;
use super::ten_buses::{self, TenBuses};
use crate::document::{Cell, Section, Table};
use crate::options::Options;

/// Force subscribers of the full scene, beside one to all taxels.
const FULL_FORCE_SUBSCRIBERS: usize = 4;

/// Ten full buses may take this share of a core.
const TEN_BUSES_AIM_PERCENT: f64 = 15.0;
/// Frame decode to snapshot, on one core.
const FRAMES_AIM_PER_S: f64 = 1e6;

/// Where `tests/run` puts the smallest build, beside the folder of the running one.
const SMALLEST: &str = "smallest/release/taxeld";

/// A scene's daemon under observation.
struct Observed {
    cpu_us_per_scan: f64,
    bytes_per_s: f64,
    bytes_per_s_of_force: f64,
    subscribers: usize,
    resident_bytes: f64,
}

/// Measures both scenes, as processes and in the engine alone, and ten full buses.
///
/// # Errors
/// If a daemon cannot be started or comes to no force.
pub fn scenes(options: &Options) -> anyhow::Result<Section> {
    let set = rig::calibrate(options.seed)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let observed = runtime.block_on(observe_both(options, &set))?;
    let engine = engine_time::per_scan(options, &set)?;
    let ten = ten_buses::measure(options, &set)?;
    let running = binary::size(&options.taxeld).with_context(|| options.taxeld.display().to_string())?;
    let smallest = options.taxeld.parent().and_then(Path::parent).map(|target| target.join(SMALLEST));
    let smallest = smallest.filter(|file| file.exists()).map(|file| binary::size(&file)).transpose()?;
    Ok(section(&observed, &engine, &ten, [Some(running), smallest]))
}

async fn observe_both(options: &Options, set: &ModelSet) -> anyhow::Result<[Observed; 2]> {
    let window = Duration::from_secs(if options.quick { 3 } else { 20 });
    let share = rig::simulator_share(options.seed)?;
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
        observe(&full, &full_channel, &streams, window, share).await?,
        observe(&lean, &lean_channel, &[StreamOf::Force], window, share).await?,
    ])
}

async fn ready(daemon: &mut Daemon, json: &str) -> anyhow::Result<Channel> {
    let channel = client::connect(daemon).await?;
    client::give_models(&channel, json.to_owned()).await?;
    Ok(channel)
}

async fn observe(
    daemon: &Daemon,
    channel: &Channel,
    streams: &[StreamOf],
    window: Duration,
    simulator_share: f64,
) -> anyhow::Result<Observed> {
    let (before, begun) = (daemon.usage()?, Instant::now());
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
    let used = daemon.usage()?.since(&before, elapsed, simulator_share);
    let per_s = |count: u64| count as f64 / elapsed.as_secs_f64();
    Ok(Observed {
        // A force subscriber who takes each value as it comes gets one message a scan.
        cpu_us_per_scan: used.cpu.as_secs_f64() * 1e6 / force.messages.max(1) as f64,
        bytes_per_s: per_s(all.bytes),
        bytes_per_s_of_force: per_s(force.bytes),
        subscribers: streams.len(),
        resident_bytes: daemon.resident_bytes()?,
    })
}

fn section(observed: &[Observed; 2], engine: &[EngineTime; 2], ten: &TenBuses, binaries: [Option<Size>; 2]) -> Section {
    let [full, lean] = observed;
    let ratio = |full: f64, lean: f64| figure(full / lean);
    let smallest = binaries[1].map_or_else(
        || "The smallest build was not there to be weighed; `tests/run` makes it.".to_owned(),
        |size| {
            format!("The smallest build loads {} MiB of code and data.", figure(mebibytes(size.loaded_bytes as f64)))
        },
    );
    Section {
        id: "f-scenes".to_owned(),
        title: "F. Scenes: what is left out costs nothing".to_owned(),
        text: vec![
            format!(
                "Two daemons on the same simulated forearm. The full scene has geometry, gauge and every output, and \
                 serves {FULL_FORCE_SUBSCRIBERS} force subscribers and one to all taxels, each value as it comes; the \
                 lean one has the total force and one subscriber. Both bring the boards up, since somebody must start \
                 the simulated ones: on a real robot listen_only leaves that out too, at the start and nowhere else. The \
                 processor time is that of the daemon's process without the simulator; the engine's own is measured \
                 in this process on identical frames, as a median of {} repetitions.",
                engine[0].per_scan_us.len()
            ),
            format!(
                "The full scene takes {} times the processor time of the lean one per scan, {} times the engine's time, \
                 sends {} times the bytes and holds {} times the memory. {smallest}",
                ratio(full.cpu_us_per_scan, lean.cpu_us_per_scan),
                ratio(engine[0].median_us(), engine[1].median_us()),
                ratio(full.bytes_per_s, lean.bytes_per_s),
                ratio(full.resident_bytes, lean.resident_bytes),
            ),
            format!(
                "Ten full buses bring {} frames/s of {} taxels to one engine, which decodes, judges, sums and publishes \
                 {} snapshots/s in {} % of a core: {} million frames/s would fill it.",
                figure(ten.frames_per_s),
                ten.taxels,
                figure(ten.snapshots_per_s),
                figure(100.0 * quantile(&ten.shares, 0.5)),
                figure(ten.frames_per_s / quantile(&ten.shares, 0.5) / 1e6),
            ),
        ],
        figures: Vec::new(),
        tables: vec![scene_table(observed, engine, binaries), ten_table(ten)],
    }
}

fn mebibytes(bytes: f64) -> f64 {
    bytes / f64::from(1 << 20)
}

fn scene_table([full, lean]: &[Observed; 2], engine: &[EngineTime; 2], binaries: [Option<Size>; 2]) -> Table {
    let mut rows = Vec::new();
    let mut row = |what: &str, full: f64, lean: f64| {
        let ratio = if lean > 0.0 { Cell::Number(full / lean) } else { Cell::Text("-".to_owned()) };
        rows.push(vec![Cell::Text(what.to_owned()), Cell::Number(full), Cell::Number(lean), ratio]);
    };
    let [a, b] = engine;
    row("identifiers that the kernel lets through", a.identifiers as f64, b.identifiers as f64);
    row("frames on the bus, per s", a.frames_per_s[1], b.frames_per_s[1]);
    row("frames that pass the kernel's filters and wake the process, per s", a.frames_per_s[0], b.frames_per_s[0]);
    row("processor time of the daemon, us per scan", full.cpu_us_per_scan, lean.cpu_us_per_scan);
    row("engine alone, us per scan, median", a.median_us(), b.median_us());
    let p = |time: &EngineTime, share: f64| quantile(&time.per_scan_us, share);
    row("engine alone, us per scan, p5", p(a, 0.05), p(b, 0.05));
    row("engine alone, us per scan, p95", p(a, 0.95), p(b, 0.95));
    row("subscribers", full.subscribers as f64, lean.subscribers as f64);
    row("bytes to one force subscriber, per s", full.bytes_per_s_of_force, lean.bytes_per_s_of_force);
    row("bytes to all subscribers, per s", full.bytes_per_s, lean.bytes_per_s);
    row("resident memory, MiB", mebibytes(full.resident_bytes), mebibytes(lean.resident_bytes));
    rows.push(binary_row("binary, MiB of code and data: this build, and the smallest", binaries, |size| {
        size.loaded_bytes
    }));
    rows.push(binary_row("binary, MiB of the file with its debug information", binaries, |size| size.file_bytes));
    Table {
        id: "f-scenes".to_owned(),
        caption: "The same simulated traffic in both scenes.".to_owned(),
        columns: ["what", "full", "lean", "full / lean"].map(str::to_owned).to_vec(),
        rows,
    }
}

fn binary_row(what: &str, [running, smallest]: [Option<Size>; 2], of: fn(&Size) -> u64) -> Vec<Cell> {
    let size = |size: Option<Size>| size.map(|size| mebibytes(of(&size) as f64));
    let cell = |figure: Option<f64>, absent: &str| figure.map_or_else(|| Cell::Text(absent.to_owned()), Cell::Number);
    let ratio = size(running).zip(size(smallest)).map(|(running, smallest)| running / smallest);
    vec![Cell::Text(what.to_owned()), cell(size(running), "-"), cell(size(smallest), "not built"), cell(ratio, "-")]
}

fn ten_table(ten: &TenBuses) -> Table {
    let percent = |share: f64| 100.0 * quantile(&ten.shares, share);
    let most_frames_per_s = ten.frames_per_s / quantile(&ten.shares, 0.5);
    let row = |what: &str, measured: f64, spread: Option<[f64; 2]>, aim: &str, holds: bool| {
        let spread = spread.map_or_else(String::new, |[low, high]| format!("{} to {}", figure(low), figure(high)));
        let (aim, verdict) = (Cell::Text(aim.to_owned()), Cell::Verdict(holds));
        vec![Cell::Text(what.to_owned()), Cell::Number(measured), Cell::Text(spread), aim, verdict]
    };
    Table {
        id: "f-ten-buses".to_owned(),
        caption: format!(
            "Decode to snapshot on {} frames/s of ten full buses, {} taxels, in batches of 2 ms a bus, without the \
             kernel's part; {} seconds of bus time.",
            figure(ten.frames_per_s),
            ten.taxels,
            ten.shares.len()
        ),
        columns: ["what", "median", "p5 to p95", "aim", "met"].map(str::to_owned).to_vec(),
        rows: vec![
            row(
                "share of one core, %",
                percent(0.5),
                Some([percent(0.05), percent(0.95)]),
                "less than 15",
                percent(0.5) < TEN_BUSES_AIM_PERCENT,
            ),
            row(
                "frames/s that would fill one core",
                most_frames_per_s,
                Some([0.95, 0.05].map(|share| ten.frames_per_s / quantile(&ten.shares, share))),
                "at least 1,000,000",
                most_frames_per_s >= FRAMES_AIM_PER_S,
            ),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_whole_with_and_without_the_smallest_build() {
        let observed = || Observed {
            cpu_us_per_scan: 100.0,
            bytes_per_s: 4_000.0,
            bytes_per_s_of_force: 3_000.0,
            subscribers: 1,
            resident_bytes: 8e6,
        };
        let engine = || EngineTime { per_scan_us: vec![5.0; 15], identifiers: 76, frames_per_s: [920.0, 1020.0] };
        let shares = vec![0.04, 0.05, 0.2];
        let ten = TenBuses { shares, frames_per_s: 83_200.0, taxels: 20_800, snapshots_per_s: 200.0 };
        let size = |mebibytes: u64| Some(Size { loaded_bytes: mebibytes << 20, file_bytes: mebibytes << 22 });
        for binaries in [[size(8), None], [size(8), size(4)]] {
            let section = section(&[observed(), observed()], &[engine(), engine()], &ten, binaries);
            for table in &section.tables {
                assert!(table.rows.iter().all(|row| row.len() == table.columns.len()), "{}", table.id);
            }
            let ten = &section.tables[1].rows;
            assert!(matches!(ten[0][4], Cell::Verdict(true)) && matches!(ten[1][4], Cell::Verdict(true)));
            assert_eq!(section.text[1].contains("was not there"), binaries[1].is_none());
        }
    }
}
