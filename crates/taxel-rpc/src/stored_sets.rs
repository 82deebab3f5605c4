//! Model sets that are not in the engine's memory: their texts come from the store, and few of them are kept.

use std::collections::VecDeque;
use std::sync::Arc;

use taxel_engine::known_set::SetSummary;
use taxel_engine::model_set::ModelSet;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tokio::sync::Mutex;
use tonic::Status;

use crate::backend::{Backend, ask};

/// Sets that are kept: whoever compares two and looks at their taxels reads each once. A set of the forearm takes about a
/// megabyte.
const KEPT_MAX: usize = 4;

/// Reads model sets.
#[derive(Clone)]
pub(crate) struct StoredSets {
    backend: Arc<dyn Backend>,
    /// Locked while one is read: memory for one is enough, and who comes second finds what the first has read.
    kept: Arc<Mutex<VecDeque<Arc<ModelSet>>>>,
}

impl StoredSets {
    pub(crate) fn new(backend: Arc<dyn Backend>) -> Self {
        Self { backend, kept: Arc::default() }
    }

    /// The set with this summary.
    pub(crate) async fn get(&self, summary: &SetSummary) -> Result<Arc<ModelSet>, Status> {
        let kept = Arc::clone(&self.kept).lock_owned().await;
        // A set that was deleted and imported again may have another origin, with the same id.
        let found = kept.iter().find(|set| set.id == summary.id && SetSummary::of(set) == *summary);
        if let Some(found) = found {
            return Ok(Arc::clone(found));
        }
        let damaged = |why| Refusal::failed_precondition(ErrorReason::DataDamaged, why).about("model_set", &summary.id);
        let read = ask(kept, |told| self.backend.model_set(summary.id.clone(), told)).await;
        let (text, kept) = read.map_err(|refusal| refusal.about("model_set", &summary.id))?;
        let backend = Arc::clone(&self.backend);
        // Reading takes ten milliseconds, for which no stream should wait.
        let read = tokio::task::spawn_blocking(move || (backend.read_json(&text), kept)).await;
        let (read, mut kept) =
            read.map_err(|failed| Refusal::fault(format!("the model set was not read: {failed}")))?;
        let set = Arc::new(read.map_err(|why| damaged(format!("{}: {why}", summary.id)))?);
        if SetSummary::of(&set) != *summary {
            return Err(Refusal::fault(format!("the store gave another model set than {}", summary.id)).into());
        }
        kept.retain(|other| other.id != set.id);
        kept.push_back(Arc::clone(&set));
        if kept.len() > KEPT_MAX {
            kept.pop_front();
        }
        Ok(set)
    }
}
