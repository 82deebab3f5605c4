//! The samples that a calibration over both branches takes from a log.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, bail};
use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::command::Command;
use taxel_report::paper::Data;
use taxel_skin::BusIndex;

use crate::config;
use crate::log_words::{expect_frames, read_on, tell};
use crate::offline::Offline;
use crate::open_log::{Wanted, open_log};
use crate::paper::session::{name, of_session};

/// Frames per read: the state of the session is looked at after each, a few times a second of the log.
const FRAMES: usize = 256;

/// Replays the log at `path` through the scene of `config`, with a session that takes every ramp there is.
///
/// # Errors
/// A configuration or log that cannot be read, a log without a frame, or one without a ramp that a session could take.
pub(super) fn read(path: &Path, config: &Path) -> anyhow::Result<Data> {
    let (settings, mut scene) = config::examine(config)?;
    let [bus] = settings.bus.as_slice() else {
        bail!("the log of one bus is read, the configuration has {}", settings.bus.len());
    };
    for patch in &mut scene.plan.patches {
        patch.bring_up.clear(); // a log cannot be configured
    }
    let mut reader = open_log(path, Wanted::interface(bus.interface.clone()))?;
    let mut offline = Offline::new(Arc::new(scene.plan));
    let mut frames = Vec::with_capacity(FRAMES);
    let (mut more, mut started, mut ramps_follow) = (true, false, true);
    while more {
        frames.clear();
        more = read_on(&mut reader, &mut frames, FRAMES);
        if let (false, Some(frame)) = (started, frames.first()) {
            offline.advance(frame.time);
            command(&mut offline, start())?;
            started = true;
        }
        offline.frames(BusIndex(0), &frames);
        // Another ramp may follow; if the engine takes none, those before it are still there to be drawn.
        if let Some(view) = session(&offline).filter(|view| ramps_follow && view.state == SessionState::Review) {
            ramps_follow = command(&mut offline, Command::StartRamp { session: view.number }).is_ok();
        }
    }
    tell(reader.report());
    expect_frames(path, bus.interface.as_deref(), reader.report())?;
    finish(&mut offline)?;
    let samples = offline.samples.clone().with_context(|| match session(&offline) {
        Some(view) => format!("no ramp could be taken: the session is {}: {}", view.state.name(), view.reason),
        None => "no frame of this configuration is in the log".to_owned(),
    })?;
    let data = of_session(format!("{}, through the engine", name(path)), &samples)?;
    Ok(data.without_loads("a log has no known loads; --loads gives them"))
}

fn start() -> Command {
    let (patch, branches) = (String::new(), Some(Branch::Both));
    Command::StartSession { patch, target: None, branches, confirmed_by: None, leave_out: Vec::new() }
}

fn command(offline: &mut Offline, command: Command) -> anyhow::Result<()> {
    let reply = offline.command(command).context("the engine did not answer")?;
    reply.map(|_| ()).map_err(|rejection| anyhow::anyhow!("{rejection}"))
}

fn session(offline: &Offline) -> Option<Arc<SessionView>> {
    offline.sessions.first().cloned().flatten()
}

/// A log that ends within a ramp ends it, on each of its branches.
fn finish(offline: &mut Offline) -> anyhow::Result<()> {
    for _branch in 0..2 {
        if let Some(view) = session(offline).filter(|view| view.state == SessionState::Ramping) {
            command(offline, Command::FinishRamp { session: view.number })?;
        }
    }
    Ok(())
}
