//! Keeps the store within its limits while the daemon runs. The engine deletes, as for an operator, so that what is in use
//! stays whatever is asked here.

use std::time::Duration;

use taxel_engine::catalogue::Catalogue;
use taxel_engine::command::Command;
use taxel_rpc::Handle;
use taxel_store::{Reader, session_to_go};
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

/// How often it is looked whether there is too much.
const LOOK_EVERY: Duration = Duration::from_secs(600);

/// Looks at the start and every ten minutes until the daemon ends.
pub async fn keep(handle: Handle, size: Reader, most_bytes: u64, cancel: CancellationToken) -> anyhow::Result<()> {
    let looks = async {
        handle.first_turn().await;
        loop {
            tidy(&handle, &size, most_bytes).await;
            tokio::time::sleep(LOOK_EVERY).await;
        }
    };
    cancel.run_until_cancelled(looks).await.unwrap_or(Ok(()))
}

/// Deletes sessions beyond the limit, oldest first. What the engine refuses stays until the next look.
async fn tidy(handle: &Handle, size: &Reader, most_bytes: u64) {
    let mut stored = Catalogue::clone(&handle.stored());
    while size_of(size).await.is_some_and(|bytes| bytes > most_bytes)
        && let Some(session) = session_to_go(&stored)
    {
        match handle.ask(Command::DeleteSession { session }).await {
            Some(Ok(_)) => tracing::info!(session, "deleted: more is stored than store.keep_mb"),
            Some(Err(reason)) => {
                return tracing::debug!(%reason, "not deleted, although more is there than is to be kept");
            }
            None => return,
        }
        stored.sessions.retain(|view| view.number != session);
    }
}

async fn size_of(size: &Reader) -> Option<u64> {
    let (tell, told) = oneshot::channel();
    size.size(Box::new(move |size| drop(tell.send(size))));
    let size = told.await.ok()?; // else the store is closed
    size.inspect_err(|error| tracing::debug!(%error, "what the store holds cannot be told")).ok()
}

#[cfg(all(test, feature = "sim"))]
mod tests {
    use std::path::{Path, PathBuf};
    use std::sync::Arc;

    use taxel_engine::calibration::{SessionState, SessionView};
    use taxel_engine::record::Record;
    use taxel_store::{Batch, Store};

    use super::*;
    use crate::driver::tests::{Bench, model_set as set};

    const PATCH: &str = "left_forearm";

    /// A database with five model sets, the first active, and five sessions that ended.
    #[allow(clippy::unwrap_used)] // clippy exempts only functions that are tests themselves
    fn filled(folder: &Path) -> PathBuf {
        let mut records: Vec<_> = (1..=5).map(|time| Record::ModelSet(set(time))).collect();
        records.push(Record::Activated { patch: PATCH.to_owned(), model_set: set(1).id.clone(), wall_ns: 1 });
        records.extend((1..=5).map(|number| {
            let (patch, state) = (PATCH.to_owned(), SessionState::Aborted);
            Record::Session(Arc::new(SessionView { number, patch, state, ..SessionView::default() }))
        }));
        let database = folder.join("store.db");
        let (store, ..) = Store::open(&database, Box::new(|_| ())).unwrap();
        store.submit(Batch { records, on_durable: None }).unwrap();
        store.close().unwrap();
        database
    }

    #[tokio::test]
    async fn while_the_daemon_runs_the_oldest_sessions_beyond_the_limits_go() {
        let folder = tempfile::tempdir().unwrap();
        let database = filled(folder.path());
        let mut bench = Bench::on(&database);
        let (handle, size) = (bench.handle.clone(), bench.reader());
        bench.during(handle.first_turn()).await;
        bench.during(tidy(&handle, &size, 0)).await;
        bench.end().await;
        let (store, restored, quarantined) = Store::open(&database, Box::new(|_| ())).unwrap();
        assert_eq!(quarantined, []);
        assert_eq!(restored.sessions.iter().map(|view| view.number).collect::<Vec<_>>(), [5]);
        assert_eq!(restored.model_sets.len(), 5);
        assert_eq!(restored.active, [(PATCH.to_owned(), set(1).id.clone())]);
        store.close().unwrap();
    }

    #[tokio::test]
    async fn a_set_that_is_only_on_disk_comes_into_use_and_is_in_use_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let database = filled(folder.path());
        let mut bench = Bench::on(&database);
        let handle = bench.handle.clone();
        bench.during(handle.first_turn()).await;
        let in_memory = || {
            let catalogue = handle.stored();
            let here = catalogue.model_sets.iter().filter(|set| set.at_hand.is_some());
            here.map(|set| set.created_wall_ns).collect::<Vec<_>>()
        };
        assert_eq!(in_memory(), [1], "what is in use");
        let activate = Command::Activate { patch: PATCH.to_owned(), model_set: set(4).id.clone(), expected: None };
        bench.during(handle.ask(activate)).await.unwrap().unwrap();
        assert_eq!(in_memory(), [4]);
        bench.end().await;
        let (store, restored, quarantined) = Store::open(&database, Box::new(|_| ())).unwrap();
        assert_eq!((restored.active, quarantined), (vec![(PATCH.to_owned(), set(4).id.clone())], vec![]));
        store.close().unwrap();
    }
}
