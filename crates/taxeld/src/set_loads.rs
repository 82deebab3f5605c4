//! Model sets that come into use are read from the store beside the engine, one after the other: the text of one may have
//! 16 MB and takes five times that while it is read, and a patch each may ask at once.

use std::sync::Arc;

use taxel_engine::calibration::NotLoaded;
use taxel_engine::model_set::ModelSet;
use taxel_store::{Reader, StoreError, models_json};
use tokio::sync::{Semaphore, oneshot};

use crate::queues::{Done, TellDone};

/// Reads sets for the engine.
pub struct SetLoads {
    store: Reader,
    tell_done: TellDone,
    /// Whose turn it is.
    turn: Arc<Semaphore>,
}

impl SetLoads {
    /// Sets of this store are told there.
    pub fn new(store: Reader, tell_done: TellDone) -> Self {
        Self { store, tell_done, turn: Arc::new(Semaphore::new(1)) }
    }

    /// Reads a set when those that were asked for before have been read, after all that the store was given until then, and
    /// tells it by its ticket. Never waits.
    pub fn load(&self, ticket: u64, model_set: String) {
        let (store, done, turn) = (self.store.clone(), self.tell_done.clone(), Arc::clone(&self.turn));
        tokio::spawn(async move {
            let _turn = turn.acquire().await; // nobody closes it
            let (tell, told) = oneshot::channel();
            store.model_set(model_set, Box::new(move |text| drop(tell.send(text)))); // it is waited for below
            let text = told.await.unwrap_or(Err(StoreError::Closed));
            // Ten milliseconds, for which no frame should wait.
            let read = tokio::task::spawn_blocking(move || read_set(text)).await;
            let lost =
                |_| Err(NotLoaded::Unavailable("reading it was lost, which is a fault of this program".to_owned()));
            done.tell(Done::SetLoaded(ticket, read.unwrap_or_else(lost)));
        });
    }
}

fn read_set(text: Result<String, StoreError>) -> Result<Arc<ModelSet>, NotLoaded> {
    match text {
        Ok(text) => match models_json::from_json(&text) {
            Ok(set) => Ok(Arc::new(set)),
            Err(why) => Err(NotLoaded::Damaged(why.to_string())),
        },
        Err(StoreError::DamagedRow(damage)) => Err(NotLoaded::Damaged(damage.reason)),
        Err(error) => Err(NotLoaded::Unavailable(error.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_store::Store;

    #[tokio::test]
    async fn sets_that_come_into_use_at_once_are_read_one_after_the_other_in_their_order() {
        let store = Store::in_memory(Box::new(|_| ())).unwrap();
        let (tell_done, mut done) = TellDone::new();
        let loads = SetLoads::new(store.reader(), tell_done);
        let turn = loads.turn.acquire().await.unwrap();
        for ticket in 1..=20 {
            loads.load(ticket, "m-1".to_owned());
        }
        // All of them have begun, and each is where it waits for its turn.
        for _ in 0..100 {
            tokio::task::yield_now().await;
        }
        assert!(done.try_recv().is_err(), "while one is read, none is");
        drop(turn);
        for expected in 1..=20 {
            let Some(Done::SetLoaded(ticket, Err(NotLoaded::Unavailable(why)))) = done.recv().await else {
                panic!("expected that there is no such set")
            };
            assert_eq!((ticket, why.contains("no model set")), (expected, true), "{why}");
        }
    }
}
