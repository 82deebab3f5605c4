//! What the service gets of the daemon beside the engine.

use std::path::PathBuf;

use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::model_set::ModelSet;
use taxel_proto::v1::RecordingHealth;
use taxel_rpc::push_line::PushLine;
use taxel_rpc::{Backend, Told};
use taxel_store::{Reader, models_json};

/// Tells the state of the recording.
pub type Recording = Box<dyn Fn() -> RecordingHealth + Send + Sync>;

/// The one backend.
pub struct DaemonBackend {
    /// The store.
    pub store: Reader,
    /// Its file and how many megabytes it may have, where there is one.
    pub budget: Option<(PathBuf, u64)>,
    /// The way of pushed scans, where a patch has any.
    pub push: Option<PushLine>,
    /// The recording, if there is one.
    pub recording: Option<Recording>,
    /// What the daemon could not have when it started, in words.
    pub lacks: Vec<String>,
}

/// The same that takes an answer of the store with its error in words.
fn in_words<T: 'static, E: ToString + 'static>(told: Told<T>) -> Box<dyn FnOnce(Result<T, E>) + Send> {
    Box::new(move |answer| told(answer.map_err(|error| error.to_string())))
}

impl Backend for DaemonBackend {
    fn samples(&self, session: u64, told: Told<SessionSamples>) {
        self.store.samples(session, in_words(told));
    }

    fn model_set(&self, id: String, told: Told<String>) {
        self.store.model_set(id, in_words(told));
    }

    fn audit(&self, before: u64, most: u32, told: Told<Vec<AuditEntry>>) {
        self.store.audit(before, most, in_words(told));
    }

    fn room(&self) -> Result<(), String> {
        let Some((path, budget_mb)) = &self.budget else { return Ok(()) };
        let megabytes = taxel_store::size_on_disk(path).div_ceil(1_000_000);
        if megabytes <= *budget_mb {
            return Ok(());
        }
        Err(format!(
            "the store has {megabytes} MB, its budget is {budget_mb} MB (store.keep_mb): delete sessions or model sets, \
             a restart gives their space back"
        ))
    }

    fn content_id(&self, set: &ModelSet) -> String {
        models_json::content_id(set)
    }

    fn to_json(&self, set: &ModelSet) -> Result<String, String> {
        models_json::to_json(set).map_err(|error| error.to_string())
    }

    fn read_json(&self, text: &str) -> Result<ModelSet, String> {
        models_json::from_json(text).map_err(|error| error.to_string())
    }

    fn read_foreign_json(&self, text: &str) -> Result<ModelSet, String> {
        models_json::from_elsewhere(text).map_err(|error| error.to_string())
    }

    fn push_line(&self) -> Option<&PushLine> {
        self.push.as_ref()
    }

    fn recording(&self) -> Option<RecordingHealth> {
        self.recording.as_ref().map(|state| state())
    }

    fn lacks(&self) -> Vec<String> {
        self.lacks.clone()
    }
}
