//! Force, taxels and events on their way into the recording, on a thread of their own: what it costs to write them down
//! never delays a frame.

use prost::Message;
use taxel_can::ClockReading;
use taxel_mcap::{Queue, Recorder};
use taxel_proto::Timestamp;
use taxel_rpc::{EventFollower, Handle, PatchFollower};
use tokio::sync::oneshot;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// A patch that is recorded: its position in the plan, and its topics.
pub struct Followed {
    /// Which patch.
    pub patch: usize,
    /// Topic of its force.
    pub force: Option<usize>,
    /// Topic of its taxels.
    pub taxels: Option<usize>,
}

/// Starts the thread, which holds the recorder until the daemon ends. Gives its end: then the file is closed.
///
/// # Errors
/// If there is no thread to be had.
pub fn follow(
    (recorder, queue): (Recorder, Queue),
    handle: &Handle,
    patches: Vec<Followed>,
    events: Option<usize>,
    cancel: CancellationToken,
) -> anyhow::Result<impl Future<Output = ()> + use<>> {
    let (ended, end) = oneshot::channel::<()>();
    let (handle, shutdown) = (handle.clone(), cancel.clone());
    crate::runtime::on_a_thread("record", move |runtime| {
        runtime.block_on(async {
            let mut tasks = JoinSet::new();
            for followed in patches {
                if let Some(patch) = PatchFollower::new(&handle, followed.patch) {
                    tasks.spawn(patch_to(patch, followed, queue.clone()));
                }
            }
            if let Some(topic) = events {
                tasks.spawn(events_to(EventFollower::new(&handle), topic, queue));
            }
            cancel.cancelled().await;
        });
        drop(runtime); // its tasks hold the queue
        recorder.finish();
        drop(ended);
    })?;
    Ok(async move {
        shutdown.cancelled().await; // a recording that is lost ends nothing else
        let _ = end.await; // dropped at the end, never sent
    })
}

async fn patch_to(mut patch: PatchFollower, topics: Followed, queue: Queue) {
    while let Some((force, taxels)) = patch.next(topics.taxels.is_some()).await {
        if let Some(topic) = topics.force {
            queue.give(topic, label(force.time.as_ref()), force.encode_to_vec());
        }
        if let (Some(topic), Some(taxels)) = (topics.taxels, taxels) {
            queue.give(topic, label(taxels.time.as_ref()), taxels.encode_to_vec());
        }
    }
}

async fn events_to(mut events: EventFollower, topic: usize, queue: Queue) {
    while let Some(event) = events.next().await {
        queue.give(topic, label(event.time.as_ref()), event.encode_to_vec());
    }
}

/// A moment in nanoseconds since 1970; the present for what has none yet.
fn label(time: Option<&Timestamp>) -> u64 {
    let ns = time.map_or_else(
        || ClockReading::now().wall_ns,
        |time| time.seconds.saturating_mul(1_000_000_000).saturating_add(i64::from(time.nanos)),
    );
    u64::try_from(ns).unwrap_or(0)
}
