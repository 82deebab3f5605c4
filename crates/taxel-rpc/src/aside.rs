//! Work of tens of milliseconds, beside the thread on which all streams are served.

use taxel_proto::refusal::Refusal;
use tonic::Status;

/// Does it on a thread for such work. The place goes along and comes back: where whoever asked has gone meanwhile, it is
/// free again when the work is done and not before, so that calls which are made and given up do not pile up there.
///
/// # Errors
/// INTERNAL if the work panicked.
pub(crate) async fn aside<P: Send + 'static, T: Send + 'static>(
    place: P,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<(T, P), Status> {
    let done = tokio::task::spawn_blocking(move || (work(), place)).await;
    Ok(done.map_err(|lost| Refusal::fault(format!("the work for this call was lost: {lost}")))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use tokio::sync::{Semaphore, oneshot};

    #[tokio::test]
    async fn work_that_nobody_waits_for_any_more_keeps_its_place_until_it_is_done() {
        let places = Arc::new(Semaphore::new(1));
        let place = Arc::clone(&places).acquire_owned().await.unwrap();
        let (begun, has_begun) = oneshot::channel();
        let (end, may_end) = std::sync::mpsc::channel::<()>();
        let call = tokio::spawn(aside(place, move || {
            let _ = begun.send(());
            let _ = may_end.recv();
        }));
        has_begun.await.unwrap();
        call.abort();
        assert!(call.await.unwrap_err().is_cancelled());
        assert_eq!(places.available_permits(), 0);
        end.send(()).unwrap();
        drop(places.acquire().await.unwrap());
    }
}
