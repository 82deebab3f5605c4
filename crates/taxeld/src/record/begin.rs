//! Begins a recording: what its topics are, and who fills them.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::Context;
use taxel_engine::plan::Plan;
use taxel_mcap::{Folder, FrameTap, Limits, Queue, Recorder, Status, Topic, open_file};
use taxel_proto::v1::RecordingHealth;
use taxel_rpc::Handle;
use tokio_util::sync::CancellationToken;

use crate::backend::Recording;
use crate::config::{Config, RecordSection};
use crate::parts::Parts;
use crate::record::follow::{Followed, follow};
use crate::record::tap::Taps;

/// What was gathered goes to the disk after so long.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// A disk that failed is tried again after so long.
const RETRY_AFTER: Duration = Duration::from_secs(10);

/// Where each topic is in the list of all, `None` for what is not recorded.
struct Topics {
    all: Vec<Topic>,
    buses: Vec<Option<usize>>,
    force: Vec<Option<usize>>,
    taxels: Vec<Option<usize>>,
    events: Option<usize>,
}

impl Topics {
    fn new(section: &RecordSection, config: &Config, plan: &Plan) -> Self {
        let mut all = Vec::new();
        let mut topic = |wanted: bool, name: String, message: &'static str| {
            wanted.then(|| {
                all.push(Topic { name: format!("/taxeld/{name}"), message });
                all.len() - 1
            })
        };
        let buses = config.bus.iter().map(|bus| topic(true, format!("bus/{}", bus.name), "CanFrames"));
        let buses = buses.collect();
        let names: Vec<&str> = plan.patches.iter().map(|patch| patch.patch.name()).collect();
        let force = names.iter().map(|name| topic(true, format!("force/{name}"), "ForceSample")).collect();
        let taxels = names.iter().map(|name| topic(section.taxels, format!("taxels/{name}"), "TaxelSample")).collect();
        let events = topic(true, "events".to_owned(), "Event");
        Self { all, buses, force, taxels, events }
    }
}

/// Begins the recording that the configuration asks for, if it asks for one and the daemon is `live`: a log is a recording
/// already. Gives what the health tells of it, and the taps of the buses.
///
/// # Errors
/// A folder that cannot be used. A disk that is full is no error: the daemon runs without a recording, and tells.
pub fn begin(
    (config, live): (&Config, bool),
    plan: &Plan,
    handle: &Handle,
    (parts, cancel): (&mut Parts, &CancellationToken),
) -> anyhow::Result<(Option<Recording>, Taps)> {
    let Some(section) = config.record.as_ref().filter(|_| live) else {
        return Ok((None, Taps::default()));
    };
    let folder = Folder::open(&section.path).with_context(|| format!("record.path = {}", section.path.display()))?;
    let Topics { all, buses, force, taxels, events } = Topics::new(section, config, plan);
    let recorder = Recorder::start(folder, limits(section), all, about(plan), Box::new(open_file));
    let (recorder, queue) = recorder.context("starting the thread `recorder`")?;
    let status = recorder.status();
    let recording: Recording = Box::new(move || health(status()));
    let taps = taps(config, &buses, &queue);
    let patches = force.into_iter().zip(taxels).enumerate();
    let patches = patches.filter(|(_, (force, taxels))| force.is_some() || taxels.is_some());
    let patches = patches.map(|(patch, (force, taxels))| Followed { patch, force, taxels }).collect();
    parts.spawn(follow((recorder, queue), handle, patches, events, cancel.clone())?);
    Ok((Some(recording), taps))
}

fn taps(config: &Config, topics: &[Option<usize>], queue: &Queue) -> Taps {
    let tap = |(bus, topic): (&crate::config::BusSection, &Option<usize>)| {
        let interface = bus.interface.clone().unwrap_or_default();
        Some(FrameTap::new(queue.clone(), (*topic)?, bus.name.clone(), interface))
    };
    Taps::new(config.bus.iter().zip(topics).map(tap).collect())
}

fn limits(section: &RecordSection) -> Limits {
    let bytes = |megabytes: u64| megabytes.saturating_mul(1_000_000);
    Limits {
        budget_bytes: bytes(section.budget_mb),
        file_bytes: bytes(section.file_mb()),
        file_age: Duration::from_secs(60 * RecordSection::FILE_MINUTES),
        keep_free_bytes: bytes(RecordSection::KEEP_FREE_MB),
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
    RecordingHealth { recording: problem.is_none(), problem: problem.unwrap_or_default(), file, bytes, lost }
}
