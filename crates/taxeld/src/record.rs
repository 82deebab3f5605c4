//! Recordings of the live traffic, where the configuration asks for them: what its topics are, and who fills them. Nobody here
//! waits for a disk, and what it costs to write force down never delays a frame: that has a thread of its own.

use std::collections::BTreeMap;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use prost::Message;
use taxel_can::ClockReading;
use taxel_engine::BusNotice;
use taxel_engine::plan::Plan;
use taxel_mcap::{Folder, FrameTap, Limits, Queue, Recorder, Status, Topic, open_file};
use taxel_proto::Timestamp;
use taxel_proto::v1::RecordingHealth;
use taxel_rpc::{EventFollower, Handle, PatchFollower};
use taxel_wire::TimedFrame;
use tokio::task::JoinSet;

use crate::backend::Recording;
use crate::config::{Config, RecordSection};
use crate::runtime::on_a_thread;
use crate::tasks::Tasks;

/// What was gathered goes to the disk after so long.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// With less space on the disk nothing is recorded, in megabytes.
const KEEP_FREE_MB: u64 = 512;

/// A file that is older is ended.
const FILE_AGE: Duration = Duration::from_secs(600);

/// A disk that failed is tried again after so long.
const RETRY_AFTER: Duration = Duration::from_secs(10);

/// Where a bus's task gives what it received, on its way to the engine; nowhere if it is not recorded.
#[derive(Default)]
pub struct Tap(pub Option<FrameTap>);

impl Tap {
    /// Copies what a bus gave, and what its controller told. Never waits.
    pub fn look(&mut self, frames: &[TimedFrame], errors: &[TimedFrame], notices: &[BusNotice]) {
        let Some(tap) = &mut self.0 else { return };
        for notice in notices {
            if let BusNotice::Dropped(frames) = notice {
                tap.kernel_lost(*frames);
            }
        }
        if !frames.is_empty() || !errors.is_empty() {
            tap.take(frames, errors, ClockReading::now().wall_offset_ns());
        }
    }
}

/// Begins the recording that the configuration asks for, if it asks for one. Gives what the health tells of it, and the tap of each bus.
///
/// # Errors
/// A folder that cannot be used. A disk that is full is no error: the daemon runs without a recording, and tells.
pub fn begin(
    config: &Config,
    plan: &Plan,
    handle: &Handle,
    tasks: &mut Tasks,
) -> anyhow::Result<(Option<Recording>, Vec<Tap>)> {
    let Some(section) = config.record.as_ref() else {
        return Ok((None, config.bus.iter().map(|_| Tap::default()).collect()));
    };
    let folder = Folder::open(&section.path).with_context(|| format!("record.path = {}", section.path.display()))?;
    let mut topics = Vec::new();
    let mut topic = |name: String, message: &'static str| {
        topics.push(Topic { name: format!("/taxeld/{name}"), message });
        topics.len() - 1
    };
    let buses: Vec<usize> = config.bus.iter().map(|bus| topic(format!("bus/{}", bus.name), "CanFrames")).collect();
    let mut patches = Vec::new();
    for (patch, name) in plan.patches.iter().map(|patch| patch.patch.name()).enumerate() {
        let force = topic(format!("force/{name}"), "ForceSample");
        let taxels = section.taxels.then(|| topic(format!("taxels/{name}"), "TaxelSample"));
        patches.extend(PatchFollower::new(handle, patch).map(|follower| (follower, force, taxels)));
    }
    let events = (EventFollower::new(handle), topic("events".to_owned(), "Event"));
    let recorder = Recorder::start(folder, limits(section), topics, about(plan), Box::new(open_file));
    let (recorder, queue) = recorder.context("starting the thread `recorder`")?;
    let status = recorder.status();
    let tap = |(bus, topic): (&crate::config::BusSection, usize)| {
        let interface = bus.interface.clone().unwrap_or_default();
        Tap(Some(FrameTap::new(queue.clone(), topic, bus.name.clone(), interface)))
    };
    let taps = config.bus.iter().zip(buses).map(tap).collect();
    let cancel = tasks.cancel.clone();
    let end = on_a_thread("record", async move {
        let mut following = JoinSet::new();
        for (patch, force, taxels) in patches {
            following.spawn(patch_to(patch, force, taxels, queue.clone()));
        }
        following.spawn(events_to(events, queue));
        cancel.cancelled().await;
        following.shutdown().await; // they hold the queue
        recorder.finish();
    })?;
    let cancel = tasks.cancel.clone();
    tasks.parts.spawn(async move {
        cancel.cancelled().await; // a recording that is lost ends nothing else
        let _ = end.await;
        Ok(())
    });
    Ok((Some(Box::new(move || health(status()))), taps))
}

async fn patch_to(mut patch: PatchFollower, force: usize, taxels: Option<usize>, queue: Queue) {
    while let Some((sample, of_taxels)) = patch.next(taxels.is_some()).await {
        queue.give(force, label(sample.time.as_ref()), sample.encode_to_vec());
        if let Some((topic, sample)) = taxels.zip(of_taxels) {
            queue.give(topic, label(sample.time.as_ref()), sample.encode_to_vec());
        }
    }
}

async fn events_to((mut events, topic): (EventFollower, usize), queue: Queue) {
    while let Some(event) = events.next().await {
        queue.give(topic, label(event.time.as_ref()), event.encode_to_vec());
    }
}

/// A moment in nanoseconds since 1970; the present for what has none yet.
fn label(time: Option<&Timestamp>) -> u64 {
    let time = time.and_then(|time| SystemTime::try_from(*time).ok()).unwrap_or_else(SystemTime::now);
    time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64)
}

fn limits(section: &RecordSection) -> Limits {
    let bytes = |megabytes: u64| megabytes.saturating_mul(1_000_000);
    Limits {
        budget_bytes: bytes(section.budget_mb),
        // Of a small budget an eighth, so that little goes at a time.
        file_bytes: bytes((section.budget_mb / 8).clamp(1, 64)),
        file_age: FILE_AGE,
        keep_free_bytes: bytes(KEEP_FREE_MB),
        flush_every: FLUSH_EVERY,
        retry_after: RETRY_AFTER,
    }
}

/// What each file says of itself.
fn about(plan: &Plan) -> BTreeMap<String, String> {
    let patches: Vec<&str> = plan.patches.iter().map(|patch| patch.patch.name()).collect();
    let known = [("version", env!("CARGO_PKG_VERSION").to_owned()), ("patches", patches.join(", "))];
    known.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

fn health(status: Status) -> RecordingHealth {
    let Status { problem, file, bytes, lost } = status;
    RecordingHealth { problem: problem.unwrap_or_default(), file, bytes, lost }
}

#[cfg(test)]
mod tests;
