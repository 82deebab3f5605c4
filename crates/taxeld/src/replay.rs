//! `taxeld replay`: a log through the same engine, as fast as it can be read.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use taxel_can::{Lanes, LogReport, Run};
use taxel_engine::calibration::SessionState;
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Sender;
use taxel_engine::snapshot::Health;
use taxel_skin::{BusIndex, Kilopascal};
use taxel_store::models_json;

use crate::config::{self, Config, Scene};
use crate::force_file::ForceFile;
use crate::offline::Offline;
use crate::open_log::{Wanted, open_log};
use crate::values::refusals_of;

/// What is asked of a replay.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld replay candump.log --config palm.toml\n  zstdcat log.zst | taxeld replay - --calibrate --out models.json\n  taxeld replay candump.log --models models.json --force force.csv\n  taxeld replay /var/lib/taxeld/recordings --models models.json --force force.csv"
)]
pub struct ReplayArgs {
    /// The log, as candump -l writes it, plain or .gz, or a recording (.mcap) or a folder of these; `-` is the standard input.
    log: PathBuf,
    /// Configuration; the buses' interfaces name those of the log.
    #[arg(long, default_value = config::CONFIG_FILE)]
    config: PathBuf,
    /// Take a calibration from the log, up to this pressure or the configured target.
    #[arg(long, value_name = "KPA", num_args = 0..=1)]
    calibrate: Option<Option<f64>>,
    /// Write the models of the calibration here.
    #[arg(long, value_name = "MODELS.json", requires = "calibrate")]
    out: Option<PathBuf>,
    /// Use these models from the first frame on.
    #[arg(long, value_name = "MODELS.json", conflicts_with = "calibrate")]
    models: Option<PathBuf>,
    /// Write the force of each scan here: time, state, newtons, uncertainty.
    #[arg(long, value_name = "FORCE.csv")]
    force: Option<PathBuf>,
}

/// Replays a log.
///
/// # Errors
/// An unreadable log, or a calibration that fails.
pub fn replay(args: ReplayArgs) -> anyhow::Result<()> {
    let (config, mut scene) = config::examine(&args.config)?;
    if let Some(plan) = scene.plan.patches.iter().find(|plan| plan.pushed.is_some()) {
        bail!("the scans of patch `{}` are pushed: there is no log of pushed scans to replay", plan.patch.name());
    }
    of_a_log(&mut scene);
    let outputs: Vec<&Path> = args.out.iter().chain(&args.force).map(PathBuf::as_path).collect();
    taxel_files::announce(&outputs, &[&args.log])?;
    let args = ReplayArgs { log: taxel_files::named(args.log), ..args };
    play(&args, &config, scene)
}

/// A log cannot be configured, and no skin is touched: a controller may have found this daemon in the place of the
/// live one.
fn of_a_log(scene: &mut Scene) {
    for patch in &mut scene.plan.patches {
        patch.bring_up.clear();
        patch.simulated = true;
        patch.devices.iter_mut().for_each(|device| device.sender = Sender::Elsewhere);
    }
}

/// Refuses a log whose skin frames never made a whole scan.
fn expect_scans(health: &Health) -> anyhow::Result<()> {
    let orphans: u64 = health.boards.iter().map(|board| board.orphans).sum();
    ensure!(
        orphans == 0 || health.boards.iter().any(|board| board.scans > 0),
        "{orphans} frames of the skin, and not one whole scan of them: frames of one scan have to come within half of period_ms. \
         Compare with `taxeld scan LOG`; an array whose frames are spread over the period needs array.sync \
         (doc/your-skin.md)"
    );
    Ok(())
}

fn play(request: &ReplayArgs, config: &Config, scene: Scene) -> anyhow::Result<()> {
    let mut lanes = open(&request.log, config, &scene)?;
    let models = request.models.as_deref().map(read_models).transpose()?;
    let mut force = request.force.as_deref().map(|path| ForceFile::create(path, &scene.plan)).transpose()?;
    let mut offline = Offline::new(Arc::new(scene.plan));
    offline.collected = force.is_some().then(Vec::new);
    let (begun, mut total, mut first) = (Instant::now(), 0_u64, None);
    while let Some(Run { bus, frames, lost }) = lanes.next_run() {
        total += frames.len() as u64;
        if let (None, Some(target), Some(frame)) = (first, request.calibrate, frames.first()) {
            offline.advance(frame.time);
            offline.start_session(target.map(Kilopascal))?.context("the session did not begin")?;
        }
        if let (None, Some(set), Some(frame)) = (first, &models, frames.first()) {
            offline.advance(frame.time);
            use_models(&mut offline, set)?;
        }
        first = first.or(frames.first().map(|f| f.time));
        offline.frames(bus, frames);
        offline.frames_lost(bus, lost);
        if let (Some(file), Some(collected)) = (&mut force, &mut offline.collected) {
            file.write(collected.drain(..))?;
        }
    }
    let elapsed = begun.elapsed();
    let named = |fault: String| anyhow::anyhow!("{}: {fault}", request.log.display());
    if let Some(fault) = lanes.reports().find_map(LogReport::time_fault) {
        return Err(named(fault));
    }
    let end = offline.now + Duration::from_secs(1);
    offline.advance(end);
    finish_session(&mut offline)?;
    let seconds = first.map_or(0.0, |first| end.seconds_since(first) - 1.0);
    say!(
        "{total} frames ({seconds:.1} s of log) in {:.3} s: {:.2} million frames/s",
        elapsed.as_secs_f64(),
        total as f64 / elapsed.as_secs_f64() / 1e6,
    );
    print_report(&lanes, &offline);
    for (section, report) in config.bus.iter().zip(lanes.reports()) {
        report.frame_fault(section.interface.as_deref()).map_or(Ok(()), |fault| Err(named(fault)))?;
    }
    let understood: u64 = offline.health.buses.iter().map(|bus| bus.frames).sum();
    let others = total - lanes.reports().map(|report| report.errors).sum::<u64>();
    ensure!(
        understood > 0 || others == 0,
        "not one of {others} frames was understood: do the identifiers of the configuration fit the log?"
    );
    expect_scans(&offline.health)?;
    if let Some(file) = force {
        say!("{}", file.finish()?);
    }
    print_models(request, &offline)
}

/// Opens a log once for each bus.
fn open(log: &Path, config: &Config, scene: &Scene) -> anyhow::Result<Lanes> {
    let wanted = config.bus.iter().zip(0..).map(|(section, position)| Wanted {
        interface: section.interface.clone(),
        // A recording knows the names of buses; with one bus they need not be the same.
        bus: (config.bus.len() > 1).then(|| section.name.clone()),
        port: config::port_of(config, &scene.plan, BusIndex(position)),
    });
    Ok(Lanes::new(wanted.map(|wanted| open_log(log, wanted)).collect::<anyhow::Result<_>>()?))
}

/// Gives a command that is answered at once.
fn ask(offline: &mut Offline, command: Command) -> anyhow::Result<()> {
    offline.ask(command)?.context("the engine did not answer").map(drop)
}

/// The models are in use from now on.
fn use_models(offline: &mut Offline, set: &ModelSet) -> anyhow::Result<()> {
    let (patch, model_set) = (set.patch.clone(), set.id.clone());
    ask(offline, Command::Import { model_set: Arc::new(set.clone()), insist: true })?;
    ask(offline, Command::Activate { patch, model_set, expected: None })
}

/// A log that ends before its target ends the ramp.
fn finish_session(offline: &mut Offline) -> anyhow::Result<()> {
    let ramping = offline.session().filter(|view| view.state == SessionState::Ramping).map(|view| view.number);
    ramping.map_or(Ok(()), |session| ask(offline, Command::FinishRamp { session }))
}

fn print_report(lanes: &Lanes, offline: &Offline) {
    for report in lanes.reports() {
        let LogReport { lines, frames, other_interface, bad, times, .. } = report;
        say!("log: {lines} lines, {frames} frames, {other_interface} of other interfaces, {bad} that are no frame");
        say!("  {} frames with a time before an earlier one", times.backwards);
        report.words().iter().for_each(|line| say!("{line}"));
    }
    for bus in &offline.health.buses {
        say!("bus: {} frames understood, {} of no concern, {} malformed", bus.frames, bus.foreign, bus.malformed);
        if bus.malformed > 0 {
            say!("  last malformed: {}", bus.last_malformed);
        }
    }
}

fn print_models(request: &ReplayArgs, offline: &Offline) -> anyhow::Result<()> {
    let Some(view) = offline.session() else { return Ok(()) };
    say!("session: {}, {} scans entered, refused: {}", view.state.name(), view.accepted, refusals_of(view));
    let Some(set) = offline.model_sets.last().filter(|_| view.state == SessionState::Review) else {
        let when = if view.state.is_open() { "the log ended while the calibration was" } else { "the calibration" };
        bail!("{when} {}: {}", view.state.name(), if view.reason.is_empty() { "too short" } else { &view.reason });
    };
    let usable = set.taxels.iter().filter(|model| model.is_usable()).count();
    say!("model set {}: {}; taxels: {usable} of {} usable", set.id, set.method, set.taxels.len());
    if let Some(out) = &request.out {
        taxel_files::write_text(out, &models_json::to_json(set)?)?;
        say!("models: {}", out.display());
    }
    Ok(())
}

fn read_models(path: &Path) -> anyhow::Result<ModelSet> {
    models_json::from_json(&taxel_files::read_text(path)?).with_context(|| path.display().to_string())
}

#[cfg(all(test, feature = "sim"))]
mod tests {
    use super::*;

    #[test]
    fn no_force_of_a_log_is_taken_for_that_of_a_skin_that_is_touched_now() {
        let path = Path::new("demo_config.toml");
        let (_, mut scene) = crate::config::examine_text(path, include_str!("demo_config.toml")).unwrap();
        scene.plan.patches[0].simulated = false; // as of a robot's bus
        of_a_log(&mut scene);
        let patch = &scene.plan.patches[0];
        assert!(patch.simulated && patch.bring_up.is_empty());
    }
}
