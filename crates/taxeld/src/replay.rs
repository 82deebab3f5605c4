//! `taxeld replay`: a candump log through the same engine, with the service at the log's own pace or a multiple of it,
//! or without it as fast as the log can be read.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use indicatif::ProgressBar;
use taxel_can::{LogReader, Pace, Replay};
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_skin::{BusIndex, Kilopascal};
use taxel_store::models_json;

use crate::clock::RunClock;
use crate::config::{BusSource, Config, Scene};
use crate::files;
use crate::force_file::ForceFile;
use crate::offline::Offline;
use crate::open_log::{Wanted, open_log};
use crate::run::Daemon;
use crate::say;
use crate::store_at::StoreAt;

/// Frames per read.
const FRAMES: usize = 4096;

/// What is asked of a replay.
pub struct Request {
    /// The log.
    pub log: PathBuf,
    /// Times as fast as written; `None` for as fast as it can be read.
    pub speed: Option<f64>,
    /// Take a calibration from it, up to this pressure.
    pub calibrate: Option<Option<f64>>,
    /// Where the models go.
    pub out: Option<PathBuf>,
    /// Models to use from the first frame on.
    pub models: Option<PathBuf>,
    /// Where the force of each scan goes.
    pub force: Option<PathBuf>,
}

/// Replays a log.
///
/// # Errors
/// An unreadable log, or a calibration that fails.
pub fn replay(request: Request, config: Config, mut scene: Scene) -> anyhow::Result<()> {
    refuse_pushed(&config)?;
    for patch in &mut scene.plan.patches {
        patch.bring_up.clear(); // a log cannot be configured
        patch.devices.iter_mut().for_each(|device| device.commands.clear());
    }
    if request.out.as_deref().is_some_and(files::is_standard) {
        say::step_aside();
    }
    let request = Request { log: files::named(request.log), ..request };
    match request.speed {
        None => at_full_speed(&request, &config, scene),
        Some(speed) => {
            let runtime = crate::runtime::runtime()?;
            runtime.block_on(paced(&request.log, speed, config, scene))
        }
    }
}

async fn paced(log: &Path, speed: f64, config: Config, scene: Scene) -> anyhow::Result<()> {
    let clock = RunClock::of_log(speed);
    let mut daemon = Daemon::start(&config, scene, StoreAt::Memory, clock).await?;
    for (position, section) in config.bus.iter().enumerate() {
        // A recording knows the names of buses; with one bus they need not be the same.
        let bus = (config.bus.len() > 1).then(|| section.name.clone());
        let reader = open_log(log, Wanted { interface: section.interface.clone(), bus })?;
        daemon.add_bus(BusIndex(position as u8), Replay::new(reader, Pace::Realtime { speed }));
    }
    daemon.until_the_end().await
}

/// No log has scans that a program pushes.
fn refuse_pushed(config: &Config) -> anyhow::Result<()> {
    match config.bus.iter().find(|section| section.source == BusSource::Push) {
        Some(section) => {
            bail!("bus `{}` has source = \"push\": there is no log of pushed scans to replay", section.name)
        }
        None => Ok(()),
    }
}

fn at_full_speed(request: &Request, config: &Config, scene: Scene) -> anyhow::Result<()> {
    let [section] = config.bus.as_slice() else {
        bail!("a replay at full speed takes one bus, the configuration has {}", config.bus.len());
    };
    let mut reader = open_log(&request.log, Wanted::interface(section.interface.clone()))?;
    let models = request.models.as_deref().map(crate::apply::read_models).transpose()?;
    let mut force = request.force.as_deref().map(|path| ForceFile::create(path, &scene.plan)).transpose()?;
    let mut offline = Offline::new(Arc::new(scene.plan));
    offline.collected = force.is_some().then(Vec::new);
    let mut frames = Vec::with_capacity(FRAMES);
    let (begun, mut total, mut more, mut first) = (Instant::now(), 0_u64, true, None);
    let bar = if std::io::stderr().is_terminal() { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
    while more {
        if begun.elapsed() > Duration::from_secs(1) {
            bar.set_message(format!("{:.1} million frames", total as f64 / 1e6));
        }
        frames.clear();
        more = reader.next_batch(&mut frames, FRAMES)?;
        total += frames.len() as u64;
        if let (None, Some(target), Some(frame)) = (first, request.calibrate, frames.first()) {
            offline.advance(frame.time);
            start_session(&mut offline, target)?;
        }
        if let (None, Some(set), Some(frame)) = (first, &models, frames.first()) {
            offline.advance(frame.time);
            use_models(&mut offline, set)?;
        }
        first = first.or(frames.first().map(|f| f.time));
        offline.frames(BusIndex(0), &frames);
        if let (Some(file), Some(collected)) = (&mut force, &mut offline.collected) {
            file.write(collected.drain(..))?;
        }
    }
    let elapsed = begun.elapsed();
    bar.finish_and_clear();
    let end = offline.now() + Duration::from_secs(1);
    offline.advance(end);
    finish_session(&mut offline)?;
    let seconds = first.map_or(0.0, |first| end.seconds_since(first) - 1.0);
    say!(
        "{total} frames ({seconds:.1} s of log) in {:.3} s: {:.2} million frames/s, {} snapshots",
        elapsed.as_secs_f64(),
        total as f64 / elapsed.as_secs_f64() / 1e6,
        offline.published,
    );
    print_report(&reader, &offline);
    let understood: u64 = offline.health.buses.iter().map(|bus| bus.frames).sum();
    if understood == 0 {
        bail!(
            "not one of {total} frames was understood: do the interface and the identifiers of the configuration fit the log?"
        );
    }
    if let Some(file) = force {
        say!("{}", file.finish()?);
    }
    print_models(request, &offline)
}

/// The models are in use from now on.
fn use_models(offline: &mut Offline, set: &ModelSet) -> anyhow::Result<()> {
    let model_set = Arc::new(set.clone());
    let activate = Command::Activate { patch: set.patch.clone(), model_set: set.id.clone(), expected: None };
    for command in [Command::Import { model_set, insist: true }, activate] {
        let reply = offline.command(command).context("the engine did not answer")?;
        reply.map_err(|rejection| anyhow::anyhow!("{rejection}"))?;
    }
    Ok(())
}

fn start_session(offline: &mut Offline, target: Option<f64>) -> anyhow::Result<()> {
    let target = target.map(Kilopascal);
    let started = offline.command(Command::StartSession {
        patch: String::new(),
        target,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    });
    started.context("the engine did not answer")?.map_err(|rejection| anyhow::anyhow!("{rejection}"))?;
    Ok(())
}

fn session(offline: &Offline) -> Option<Arc<SessionView>> {
    offline.sessions.first().cloned().flatten()
}

/// A log that ends before its target ends the ramp.
fn finish_session(offline: &mut Offline) -> anyhow::Result<()> {
    if let Some(view) = session(offline).filter(|view| view.state == SessionState::Ramping) {
        let finished = offline.command(Command::FinishRamp { session: view.number });
        finished.context("the engine did not answer")?.map_err(|rejection| anyhow::anyhow!("{rejection}"))?;
    }
    Ok(())
}

fn print_report(reader: &LogReader, offline: &Offline) {
    let report = reader.report();
    say!(
        "log: {} lines, {} frames, {} of other interfaces, {} that are no frame, {} with a time before the last",
        report.lines,
        report.frames,
        report.other_interface,
        report.bad,
        report.backwards
    );
    for bad in &report.first_bad {
        say!("  line {}: {}", bad.line, bad.fault);
    }
    for bus in &offline.health.buses {
        say!("bus: {} frames understood, {} of no concern, {} malformed", bus.frames, bus.foreign, bus.malformed);
        if bus.malformed > 0 {
            say!("  last malformed: {}", bus.last_malformed);
        }
    }
    for board in &offline.health.boards {
        say!("board {}: {} modules, {} scans, {} orphans", board.address, board.modules.0, board.scans, board.orphans);
    }
}

fn print_models(request: &Request, offline: &Offline) -> anyhow::Result<()> {
    let Some(view) = session(offline) else { return Ok(()) };
    say!("session: {}, {} scans entered, refused: {}", view.state.name(), view.accepted, refusals(&view));
    let Some(set) = offline.model_sets.last().filter(|_| view.state == SessionState::Review) else {
        let when = if view.state.is_open() { "the log ended while the calibration was" } else { "the calibration" };
        bail!("{when} {}: {}", view.state.name(), if view.reason.is_empty() { "too short" } else { &view.reason });
    };
    crate::fit::print_summary(set);
    if let Some(out) = &request.out {
        files::write_text(out, &models_json::to_json(set)?)?;
        say!("models: {}", out.display());
    }
    Ok(())
}

/// Refusals of a session in words.
pub fn refusals(view: &SessionView) -> String {
    use taxel_engine::calibration::SampleRefusal;
    let counted = SampleRefusal::ALL.into_iter().map(|reason| (reason.name(), view.refused.get(reason)));
    let words: Vec<String> = counted.filter(|(_, n)| *n > 0).map(|(name, n)| format!("{n} {name}")).collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}
