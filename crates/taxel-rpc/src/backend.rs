//! What the service needs of the daemon beside the engine: the store, the text of model sets, the state of the recording.

use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::model_set::ModelSet;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::{ErrorReason, RecordingHealth};
use tokio::sync::oneshot;

use crate::push_line::PushLine;
use crate::status::{STOPPED, unavailable};

/// What is done with an answer of the store, or with the reason why there is none. It may be called on any thread.
pub type Told<T> = Box<dyn FnOnce(Result<T, Refusal>) + Send>;

/// Why a daemon without a store has none of what is asked for.
const NOT_KEPT: &str = "this daemon has no store";

fn not_kept() -> Refusal {
    Refusal::unavailable(ErrorReason::StoreUnavailable, NOT_KEPT)
}

/// The daemon around the engine: by default one that has nothing. Questions to the store return at once; their answers come
/// later.
pub trait Backend: Send + Sync {
    /// Reads the samples of a stored session.
    fn samples(&self, _session: u64, told: Told<SessionSamples>) {
        told(Err(not_kept()));
    }

    /// Reads the text of a stored model set.
    fn model_set(&self, _id: String, told: Told<String>) {
        told(Err(not_kept()));
    }

    /// Reads entries of the audit log: those with numbers below `before`, at most so many, newest first.
    fn audit(&self, _before: u64, _most: u32, told: Told<Vec<AuditEntry>>) {
        told(Err(not_kept()));
    }

    /// Whether the disk has room for what is kept for ever.
    ///
    /// # Errors
    /// Why not, and what to do.
    fn room(&self) -> Result<(), String> {
        Ok(())
    }

    /// The id of a model set, made from its content.
    fn content_id(&self, set: &ModelSet) -> String {
        set.id.clone()
    }

    /// The text of MODELS.json.
    ///
    /// # Errors
    /// What of the set cannot be written.
    fn to_json(&self, _set: &ModelSet) -> Result<String, String> {
        Err(NOT_KEPT.to_owned())
    }

    /// The set that such a text describes.
    ///
    /// # Errors
    /// Where the text is wrong, what was found and what was expected.
    fn read_json(&self, _text: &str) -> Result<ModelSet, String> {
        Err(NOT_KEPT.to_owned())
    }

    /// The same of a text from elsewhere, whose set is of no session of this daemon.
    ///
    /// # Errors
    /// As [`Backend::read_json`].
    fn read_foreign_json(&self, text: &str) -> Result<ModelSet, String> {
        self.read_json(text)
    }

    /// The way of pushed scans, where a patch has any.
    fn push_line(&self) -> Option<&PushLine> {
        None
    }

    /// The state of the recording, if there is one; asked for each health.
    fn recording(&self) -> Option<RecordingHealth> {
        None
    }

    /// What was asked for and cannot be had, in words; asked for each health.
    fn lacks(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Asks the store and waits for its answer.
pub(crate) async fn ask<T: Send + 'static>(question: impl FnOnce(Told<T>)) -> Result<T, Refusal> {
    let (tell, told) = oneshot::channel();
    question(Box::new(move |answer| drop(tell.send(answer))));
    told.await.map_err(|_| unavailable(STOPPED))?
}
