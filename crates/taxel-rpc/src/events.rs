//! What happened since the daemon's start, as it is kept and as it goes on, for clients and the recording.

use futures_util::stream::{self, StreamExt};
use taxel_engine::events::{Event, EventKind};
use taxel_proto::v1;
use tokio::sync::watch;
use tonic::Status;

use crate::convert::timestamp;
use crate::event_log::EventLog;
use crate::handle::Handle;
use crate::service::Service;
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, unavailable};
use crate::stream::MessageStream;

/// All events, or those of one patch and of buses, one after the other.
pub struct EventFollower {
    events: watch::Receiver<EventLog>,
    /// Number of the last event that was taken, or was of no concern.
    last: u64,
    /// Empty for all.
    patch: String,
}

impl EventFollower {
    /// Follows the events of this daemon, from the first that is still kept.
    #[must_use]
    pub fn new(handle: &Handle) -> Self {
        Self { events: handle.events.clone(), last: 0, patch: String::new() }
    }

    /// The next event that is kept; `None` if there is none yet.
    fn kept(&mut self) -> Option<v1::Event> {
        let log = self.events.borrow_and_update();
        // What is no longer kept is counted, whatever it was about.
        let skipped = log.0.front().map_or(0, |(oldest, _)| oldest.saturating_sub(self.last + 1));
        let wanted = |event: &Event| self.patch.is_empty() || event.patch.is_empty() || event.patch == self.patch;
        let begin = log.0.partition_point(|(number, _)| *number <= self.last);
        let found = log.0.range(begin..).find(|(_, event)| wanted(event));
        self.last = found.map_or(self.last.max(log.newest()), |(number, _)| *number);
        found.map(|(number, event)| message(*number, event, skipped))
    }

    /// The next event, as soon as there is one. `None` when the engine has stopped and all is told.
    pub async fn next(&mut self) -> Option<v1::Event> {
        loop {
            if let Some(event) = self.kept() {
                return Some(event);
            }
            self.events.changed().await.ok()?;
        }
    }
}

impl Service {
    /// Events after a number, and with `follow` those to come.
    pub(crate) fn watch_events_of(&self, request: v1::WatchEventsRequest) -> Result<MessageStream<v1::Event>, Status> {
        let v1::WatchEventsRequest { patch, after, follow } = request;
        self.check_wanted(&patch)?;
        let events = EventFollower { last: after, patch, ..EventFollower::new(&self.handle) };
        let present = events.events.borrow().newest();
        if after > present {
            let problem = "of the newest event is less: the daemon was started anew, and numbers too";
            return Err(invalid("after", format_args!("is {after}, and the number {present} {problem}")));
        }
        let shutdown = self.handle.shutdown.clone();
        let events = stream::try_unfold(events, move |mut events| {
            let shutdown = shutdown.clone();
            async move {
                if !follow {
                    return Ok(events.kept().map(|event| (event, events)));
                }
                tokio::select! {
                    biased;
                    () = shutdown.cancelled() => Err(unavailable(SHUTTING_DOWN).into()),
                    event = events.next() => Ok(Some((event.ok_or_else(|| unavailable(STOPPED))?, events))),
                }
            }
        });
        Ok(events.boxed())
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
