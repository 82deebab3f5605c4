//! Model sets that are not in the engine's memory: their texts come from the store, and few of them are kept.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use taxel_engine::known_set::SetSummary;
use taxel_engine::model_set::ModelSet;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tokio::sync::{Semaphore, oneshot};
use tonic::Status;

use crate::codec::ModelCodec;
use crate::status::engine_stopped;

/// Sets that are kept: whoever compares two and looks at their taxels reads each once. A set of the forearm takes about a
/// megabyte.
const KEPT_MAX: usize = 4;

/// Where the texts of stored model sets come from: called with the id and what to do with the answer. It must not wait, and
/// the answer may come from any thread.
pub type ModelSetSource = Arc<dyn Fn(String, OnModelSet) + Send + Sync>;

/// What is done with the text, or with the reason why there is none.
pub type OnModelSet = Box<dyn FnOnce(Result<String, String>) + Send>;

/// Reads model sets, one at a time.
#[derive(Clone)]
pub(crate) struct StoredSets {
    source: ModelSetSource,
    codec: ModelCodec,
    kept: Arc<Mutex<VecDeque<Arc<ModelSet>>>>,
    turn: Arc<Semaphore>,
}

impl StoredSets {
    pub(crate) fn new(source: ModelSetSource, codec: ModelCodec) -> Self {
        Self { source, codec, kept: Arc::default(), turn: Arc::new(Semaphore::new(1)) }
    }

    /// The set with this summary.
    pub(crate) async fn get(&self, summary: &SetSummary) -> Result<Arc<ModelSet>, Status> {
        // One at a time, so that memory for one is enough, and who comes second finds what the first has read.
        let turn = Arc::clone(&self.turn).acquire_owned().await.map_err(|_| engine_stopped())?;
        if let Some(kept) = self.kept(summary) {
            return Ok(kept);
        }
        let (tell, told) = oneshot::channel();
        // The turn goes the way of the question: where whoever asked has gone meanwhile, it is free again when the store has
        // answered and not before.
        (self.source)(summary.id.clone(), Box::new(move |text| drop(tell.send((text, turn)))));
        let damaged = |why| Refusal::failed_precondition(ErrorReason::DataDamaged, why).about("model_set", &summary.id);
        let (text, turn) = told.await.map_err(|_| engine_stopped())?;
        let (text, from_json) = (text.map_err(damaged)?, self.codec.from_json);
        // Reading takes ten milliseconds, for which no stream should wait.
        let parse = move || (from_json(&text), turn);
        let read = tokio::task::spawn_blocking(parse).await;
        let read = read.map_err(|failed| Refusal::fault(format!("the model set was not read: {failed}")))?;
        // Kept before the next one has its turn, who may want the same.
        let (read, _turn) = read;
        let set = Arc::new(read.map_err(|why| damaged(format!("{}: {why}", summary.id)))?);
        if SetSummary::of(&set) != *summary {
            return Err(Refusal::fault(format!("the store gave another model set than {}", summary.id)).into());
        }
        self.keep(&set);
        Ok(set)
    }

    /// A set that was deleted and imported again may have another origin, with the same id.
    fn kept(&self, summary: &SetSummary) -> Option<Arc<ModelSet>> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.iter().find(|set| set.id == summary.id && SetSummary::of(set) == *summary).cloned()
    }

    fn keep(&self, set: &Arc<ModelSet>) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.retain(|other| other.id != set.id);
        kept.push_back(Arc::clone(set));
        if kept.len() > KEPT_MAX {
            kept.pop_front();
        }
    }
}
