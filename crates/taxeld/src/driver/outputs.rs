//! What the engine puts out, done: snapshots to readers, records to the store and replies once they are on disk, frames to
//! the buses, fits beside the engine.

use std::sync::Arc;

use taxel_engine::calibration::{FitJob, FitOutcome, NotLoaded, SessionSamples, SessionView};
use taxel_engine::command::{ErrorReason, Rejection, Reply, RequestId};
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;
use taxel_engine::{Input, Output};
use taxel_skin::BusIndex;
use taxel_store::{Batch, Durability, OnDurable, QueueFull, StoreError, models_json};
use taxel_wire::Frame;
use tokio::sync::oneshot;

use super::{Driver, Waiting};
use crate::queues::{Done, TellDone};

impl Driver {
    pub(super) fn step(&mut self, input: Input<'_>) {
        let mut out = std::mem::take(&mut self.out);
        // What is answered when a commit is on disk has been done, whatever else is written down because of it.
        let is_done = matches!(input, Input::Committed { result: Ok(()), .. });
        self.engine.step((self.clock)(), input, &mut out);
        let (mut records, mut answers) = (Vec::new(), Vec::new());
        self.note_events(&out);
        for output in out.drain(..) {
            if matches!(output, Output::Commit { .. } | Output::Load { .. } | Output::LoadSet { .. }) {
                // What came before goes first, so that the order on disk is that of what happened.
                self.commit(std::mem::take(&mut records), Vec::new(), false);
            }
            match output {
                Output::Patch(index, snapshot) => {
                    self.pages.patch(index, &snapshot);
                    self.publisher.patch(index, snapshot);
                }
                Output::Session(index, view) => self.show_session(index, view),
                Output::SessionGone(index) => self.hide_session(index),
                Output::Gauge(index, reading) => self.publisher.gauge(index, reading),
                Output::Health(health) => self.publisher.health(health),
                Output::Catalogue(catalogue) => {
                    self.audit.catalogue(&catalogue);
                    self.publisher.catalogue(catalogue);
                }
                Output::Send(bus, frame) => self.send(bus, frame),
                Output::Fit(job) => self.fit(job),
                Output::Record(record) => records.push(record),
                Output::Commit { ticket, records } => self.commit_intended(ticket, records),
                Output::Load { ticket, session } => self.load(ticket, session),
                Output::LoadSet { ticket, model_set } => self.load_set(ticket, model_set),
                Output::Reply(request, reply) => {
                    answers.extend(self.waiting.remove(&request).map(|to| (request, to, reply)));
                }
            }
        }
        self.out = out;
        self.answer(records, answers, is_done);
    }

    /// What an operator may ask for later goes to the event log.
    fn note_events(&mut self, out: &[Output]) {
        let mut events = Vec::new();
        let wall_ns = (self.clock)().wall_ns;
        out.iter().for_each(|output| self.events.look(wall_ns, output, &mut events));
        events.into_iter().for_each(|event| self.publisher.event(event));
    }

    /// Answers go out when the disk has them, and what was recorded in the same step. That something was refused is
    /// written down as well; the caller waits for that, so that being refused is no faster than the disk, and hears
    /// the refusal whatever becomes of it.
    fn answer(&mut self, mut records: Vec<Record>, answers: Vec<(RequestId, Waiting, Reply)>, is_done: bool) {
        let wall_ns = (self.clock)().wall_ns;
        let (mut replies, mut refusals, mut refused) = (Vec::new(), Vec::new(), Vec::new());
        for (request, Waiting { reply: to, patch }, reply) in answers {
            let row = patch.map(|patch| self.audit.answered(request, wall_ns, &patch, &reply));
            let (rows, replies) =
                if reply.is_ok() { (&mut records, &mut replies) } else { (&mut refusals, &mut refused) };
            rows.extend(row);
            replies.push((to, reply));
        }
        self.commit(records, replies, is_done);
        self.note_refusals(refusals, refused);
    }

    /// A reply goes out once everything recorded in the same step is on disk, or could not be written though what it tells
    /// of `is_done`.
    pub(super) fn commit(
        &mut self,
        records: Vec<Record>,
        replies: Vec<(oneshot::Sender<Reply>, Reply)>,
        is_done: bool,
    ) {
        if records.is_empty() {
            for (to, reply) in replies {
                let _ = to.send(reply); // the client has gone
            }
            return;
        }
        // What was done is on disk already where only the audit log is written: then it is done, whatever becomes of that.
        let is_done = is_done || records.iter().all(|record| matches!(record, Record::Answered(_)));
        let on_durable: Option<OnDurable> = if replies.is_empty() {
            None
        } else {
            Some(Box::new(move |outcome| answer(replies, if is_done { Ok(Durability::OnDisk) } else { outcome })))
        };
        if let Err(full) = self.store.submit(Batch { records, on_durable }) {
            self.step(Input::StoreFailed(refuse(full)));
        }
    }

    /// Nothing has changed by what was refused: the store does without its row where its queue has no room.
    pub(super) fn note_refusals(&self, records: Vec<Record>, replies: Vec<(oneshot::Sender<Reply>, Reply)>) {
        let told: OnDurable = Box::new(move |_| answer(replies, Ok(Durability::OnDisk)));
        if records.is_empty() {
            told(Ok(Durability::OnDisk));
        } else if let Err(full) = self.store.submit_asked(Batch { records, on_durable: Some(told) }) {
            let why = refuse(full);
            tracing::warn!(%why, "that a command was refused is not in the audit log");
        }
    }

    /// Writes down what the engine intends, and tells it how that went. Where the store's queue has no room nothing is
    /// lost: what is not written does not come about.
    fn commit_intended(&self, ticket: u64, records: Vec<Record>) {
        let done = self.tell_done.clone();
        let on_durable: OnDurable = Box::new(move |outcome: Result<Durability, StoreError>| {
            let result = outcome.map(|_| ()).map_err(|error| error.to_string());
            done.tell(Done::Input(Input::Committed { ticket, result }));
        });
        if let Err(full) = self.store.submit(Batch { records, on_durable: Some(on_durable) }) {
            let why = refuse(full);
            tracing::warn!(%why, "a change was refused");
        }
    }

    /// Reads the samples of a session, and gives them to the engine.
    fn load(&self, ticket: u64, session: u64) {
        let done = self.tell_done.clone();
        let on_samples = Box::new(move |outcome: Result<SessionSamples, StoreError>| {
            done.tell(Done::Input(Input::Loaded { ticket, result: outcome.map_err(not_loaded) }));
        });
        self.store.reader().samples(session, on_samples);
    }

    /// Reads a model set, and gives it to the engine. It takes the store's thread ten milliseconds, for which no frame should wait.
    fn load_set(&self, ticket: u64, model_set: String) {
        let done = self.tell_done.clone();
        let on_set = move |text| done.tell(Done::Input(Input::SetLoaded { ticket, result: read_set(text) }));
        self.store.reader().model_set(model_set, Box::new(on_set));
    }

    fn hide_session(&mut self, index: usize) {
        if let Some(view) = self.sessions[index].take() {
            tracing::info!(session = view.number, "calibration session deleted");
        }
        self.publisher.session(index, None);
    }

    fn show_session(&mut self, index: usize, view: Arc<SessionView>) {
        let (number, state) = (view.number, view.state);
        let before = self.sessions[index].replace(Arc::clone(&view));
        if before.is_none_or(|before| (before.number, before.state) != (number, state)) {
            let (session, state) = (number, state.name());
            tracing::info!(session, patch = %view.patch, state, reason = %view.reason, "calibration session");
        }
        self.publisher.session(index, Some(view));
    }

    fn send(&self, bus: BusIndex, frame: Frame) {
        let queue = self.buses.get(bus.0 as usize);
        if queue.is_none_or(|queue| queue.try_send(frame).is_err()) {
            tracing::warn!(bus = bus.0, id = %frame.id, "a command to a board was not sent: the send queue is full");
        }
    }

    fn fit(&self, job: FitJob) {
        let (of, done) = ((job.session(), job.wall_ns), self.tell_done.clone());
        let fits = self.publisher.fits();
        tokio::spawn(async move {
            let _turn = fits.acquire_owned().await; // nobody closes it
            fit(of, done, move || job.run(models_json::content_id)).await;
        });
    }
}

/// Runs a fit beside the engine. Also one that is lost comes back, so that its session does not wait for ever: it is named
/// by the number of the session and when it was asked for.
pub(super) async fn fit(
    (session, asked_wall_ns): (u64, i64),
    done: TellDone,
    run: impl FnOnce() -> FitOutcome + Send + 'static,
) {
    let outcome = tokio::task::spawn_blocking(run).await.unwrap_or_else(|lost| {
        tracing::error!(session, %lost, "a fit");
        let why = "the fit was lost, which is a fault of this program; the samples are kept";
        FitOutcome { session, asked_wall_ns, result: Err(why.to_owned()) }
    });
    done.tell(Done::Input(Input::Fitted(outcome)));
}

/// Tells the caller that waits for a batch that the store's queue has no room for it, and gives the words.
fn refuse(QueueFull { batch, most }: QueueFull) -> String {
    let behind = StoreError::Behind { waiting: most };
    let why = behind.to_string();
    if let Some(on_durable) = batch.on_durable {
        on_durable(Err(behind));
    }
    why
}

/// Tells everyone who waited for a commit how it went.
fn answer(replies: Vec<(oneshot::Sender<Reply>, Reply)>, outcome: Result<Durability, StoreError>) {
    for (to, reply) in replies {
        let reply = match &outcome {
            Ok(_) => reply,
            Err(error) => Err(Rejection::Unavailable(
                ErrorReason::StoreUnavailable,
                format!("it could not be written to disk: {error}"),
            )),
        };
        let _ = to.send(reply); // the client has gone
    }
}

fn read_set(text: Result<String, StoreError>) -> Result<Arc<ModelSet>, NotLoaded> {
    let set = models_json::from_json(&text.map_err(not_loaded)?);
    set.map(Arc::new).map_err(|why| NotLoaded::Damaged(why.to_string()))
}

fn not_loaded(error: StoreError) -> NotLoaded {
    match error {
        StoreError::DamagedRow(damage) => NotLoaded::Damaged(damage.reason),
        error => NotLoaded::Unavailable(error.to_string()),
    }
}
