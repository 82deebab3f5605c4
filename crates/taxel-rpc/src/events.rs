//! What happened, as it is kept and as it goes on: for clients and for the recording.

use futures_util::stream::{self, StreamExt};
use taxel_engine::events::{Event, EventKind};
use taxel_proto::v1;
use tokio::sync::watch;
use tonic::Status;

use crate::convert::timestamp;
use crate::handle::Handle;
use crate::service::Service;
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, unavailable};
use crate::stream::MessageStream;

/// All events, or those of one patch and of buses, one after the other.
pub struct EventFollower {
    handle: Handle,
    newest: watch::Receiver<u64>,
    /// Number of the last event that was taken, or was of no concern.
    last: u64,
    /// Empty for all.
    patch: String,
}

impl EventFollower {
    /// Follows the events of this daemon, from the first that is still kept.
    #[must_use]
    pub fn new(handle: &Handle) -> Self {
        Self { handle: handle.clone(), newest: handle.events.watch(), last: 0, patch: String::new() }
    }

    /// The next event that is kept; `None` if there is none yet.
    fn kept(&mut self) -> Option<v1::Event> {
        let present = *self.newest.borrow_and_update();
        // What is no longer kept is counted, whatever it was about.
        let skipped = self.handle.events.oldest().saturating_sub(self.last + 1);
        let patch = self.patch.as_str();
        let wanted = |event: &Event| patch.is_empty() || event.patch.is_empty() || event.patch == patch;
        let Some((number, event)) = self.handle.events.next(self.last, wanted) else {
            self.last = self.last.max(present); // all of them were looked at
            return None;
        };
        self.last = number;
        Some(message(number, &event, skipped))
    }

    /// The next event, as soon as there is one. `None` when nobody is left who could tell one.
    pub async fn next(&mut self) -> Option<v1::Event> {
        loop {
            if let Some(event) = self.kept() {
                return Some(event);
            }
            // The log lives as long as its readers: that the engine is gone shows in the health.
            let mut health = self.handle.health.clone();
            tokio::select! {
                biased; // what was told before the end still comes
                changed = self.newest.changed() => changed.ok()?,
                () = async { while health.changed().await.is_ok() {} } => return None,
            }
        }
    }
}

impl Service {
    /// Events after a number, and with `follow` those to come.
    pub(crate) fn watch_events_of(&self, request: v1::WatchEventsRequest) -> Result<MessageStream<v1::Event>, Status> {
        let v1::WatchEventsRequest { patch, after, follow } = request;
        if !patch.is_empty() {
            self.patch(&patch)?;
        }
        let events = EventFollower { last: after, patch, ..EventFollower::new(&self.handle) };
        let present = *events.newest.borrow();
        if after > present {
            let problem = "of the newest event is less: the daemon was started anew, and numbers too";
            return Err(invalid("after", format_args!("is {after}, and the number {present} {problem}")));
        }
        let next = async move |events: &mut EventFollower| {
            if !follow {
                return Ok(events.kept());
            }
            let shutdown = events.handle.shutdown.clone();
            tokio::select! {
                biased;
                () = shutdown.cancelled() => Err(unavailable(SHUTTING_DOWN).into()),
                event = events.next() => event.map(Some).ok_or_else(|| unavailable(STOPPED).into()),
            }
        };
        let next = move |mut events: EventFollower| async move {
            next(&mut events).await.transpose().map(|event: Result<v1::Event, Status>| (event, events))
        };
        Ok(stream::unfold(events, next).boxed())
    }
}

fn message(number: u64, event: &Event, skipped: u64) -> v1::Event {
    v1::Event {
        number,
        time: timestamp(event.wall_ns),
        kind: kind(event.kind).to_owned(),
        patch: event.patch.clone(),
        text: event.text.clone(),
        taxels: event.taxels.iter().map(|taxel| u32::from(*taxel)).collect(),
        session: event.session,
        model_set: event.model_set.clone().unwrap_or_default(),
        bus: event.bus.map(u32::from),
        skipped,
    }
}

const fn kind(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Tared => "tared",
        EventKind::ZeroLost => "zero lost",
        EventKind::FaultsCame => "faults came",
        EventKind::FaultsWent => "faults went",
        EventKind::Activated => "activated",
        EventKind::Session => "session",
        EventKind::BusUp => "bus up",
        EventKind::BusDown => "bus down",
    }
}
