//! `ListEvents` and `WatchEvents`: the event log in pages, and as it goes on.

use std::sync::Arc;

use futures_util::stream::{self, StreamExt};
use taxel_engine::events::{Event, EventKind};
use taxel_proto::v1;
use tokio::sync::watch;
use tonic::Status;

use crate::convert::timestamp;
use crate::event_log::{EventLog, Numbered};
use crate::page::{before, page_size};
use crate::service::Service;
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, unavailable};
use crate::stream::MessageStream;

impl Service {
    /// A page of events, newest first.
    pub(crate) fn page_of_events(&self, request: &v1::ListEventsRequest) -> Result<v1::ListEventsResponse, Status> {
        let wanted = self.wanted(&request.patch)?;
        let size = page_size(request.page_size)?;
        let before = before(&request.page_token)?;
        // One more than is shown tells whether there is another page.
        let mut page = self.handle.events.page(before, size + 1, wanted);
        let more = page.len() > size;
        page.truncate(size);
        let next_page_token = page.last().filter(|_| more).map(|(number, _)| number.to_string()).unwrap_or_default();
        Ok(v1::ListEventsResponse { events: page.iter().map(|event| message(event, 0)).collect(), next_page_token })
    }

    /// Events after a number, and those to come.
    pub(crate) fn watch_events_of(&self, request: &v1::WatchEventsRequest) -> Result<MessageStream<v1::Event>, Status> {
        let wanted = self.wanted(&request.patch)?;
        let log = Arc::clone(&self.handle.events);
        let newest = log.watch();
        let present = *newest.borrow();
        let last = request.after.unwrap_or(present);
        if last > present {
            let problem = "of the newest event is less: the daemon was started anew, and numbers too";
            return Err(invalid("after", format_args!("is {last}, and the number {present} {problem}")));
        }
        let watch = Watch { service: self.clone(), log, newest, last, wanted, ended: false };
        let next = |mut watch: Watch<_>| async { Some((watch.next().await?, watch)) };
        Ok(stream::unfold(watch, next).boxed())
    }

    /// Whether an event is about a patch of this name; buses are about all. An empty name takes everything.
    fn wanted(&self, patch: &str) -> Result<impl Fn(&Event) -> bool + Send + Sync + use<>, Status> {
        if !patch.is_empty() {
            self.patch(patch)?;
        }
        let patch = patch.to_owned();
        Ok(move |event: &Event| patch.is_empty() || event.patch.is_empty() || event.patch == patch)
    }
}

/// One watcher.
struct Watch<F> {
    service: Service,
    log: Arc<EventLog>,
    newest: watch::Receiver<u64>,
    /// Number of the last event that went out, or was of no concern.
    last: u64,
    wanted: F,
    ended: bool,
}

impl<F: Fn(&Event) -> bool> Watch<F> {
    async fn next(&mut self) -> Option<Result<v1::Event, Status>> {
        if self.ended {
            return None;
        }
        let shutdown = self.service.handle.shutdown.clone();
        // The log lives as long as its readers: that the engine is gone shows in the health.
        let mut health = self.service.handle.health.clone();
        loop {
            let present = *self.newest.borrow_and_update();
            // What is no longer kept is counted, whatever it was about.
            let skipped = self.log.oldest().saturating_sub(self.last + 1);
            if let Some(event) = self.log.next(self.last, &self.wanted) {
                self.last = event.0;
                return Some(Ok(message(&event, skipped)));
            }
            self.last = self.last.max(present); // all of them were looked at
            let ends = tokio::select! {
                biased;
                () = shutdown.cancelled() => unavailable(SHUTTING_DOWN).into(),
                changed = self.newest.changed() => match changed {
                    Ok(()) => continue,
                    Err(_) => unavailable(STOPPED).into(),
                },
                () = gone(&mut health) => unavailable(STOPPED).into(),
            };
            self.ended = true;
            return Some(Err(ends));
        }
    }
}

/// Ends when whoever sends is gone.
async fn gone<T>(receiver: &mut watch::Receiver<T>) {
    while receiver.changed().await.is_ok() {}
}

pub(crate) fn message((number, event): &Numbered, skipped: u64) -> v1::Event {
    v1::Event {
        number: *number,
        time: timestamp(event.wall_ns),
        kind: kind(event.kind).into(),
        patch: event.patch.clone(),
        text: event.text.clone(),
        taxels: event.taxels.iter().map(|taxel| u32::from(*taxel)).collect(),
        session: event.session,
        model_set: event.model_set.clone().unwrap_or_default(),
        bus: event.bus.map(u32::from),
        skipped,
    }
}

const fn kind(kind: EventKind) -> v1::EventKind {
    match kind {
        EventKind::Tared => v1::EventKind::Tared,
        EventKind::ZeroLost => v1::EventKind::ZeroLost,
        EventKind::FaultsCame => v1::EventKind::FaultsCame,
        EventKind::FaultsWent => v1::EventKind::FaultsWent,
        EventKind::Activated => v1::EventKind::Activated,
        EventKind::Session => v1::EventKind::Session,
        EventKind::BusUp => v1::EventKind::BusUp,
        EventKind::BusDown => v1::EventKind::BusDown,
    }
}
