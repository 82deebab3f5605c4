//! The service of the daemon: on which thread it runs, and what else serves beside it.

use anyhow::Context;
use taxel_rpc::{Handle, Listener, Server};
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

use crate::config::Config;
use crate::parts::Parts;
use crate::systemd;

/// Serves the page and the metrics, where they are configured.
///
/// # Errors
/// An address that cannot be had.
pub fn serve_pages(
    config: &Config,
    server: &Server,
    (parts, cancel): (&mut Parts, &CancellationToken),
) -> anyhow::Result<()> {
    for site in crate::page::sites(config) {
        parts.spawn(site.start(server.shared(), cancel.clone())?);
    }
    Ok(())
}

/// Serves to the end, on the runtime that it is called on.
///
/// # Errors
/// What keeps it from serving.
pub async fn service(handle: Handle, server: Server, listeners: Vec<Listener>) -> anyhow::Result<()> {
    tokio::select! {
        served = server.serve(listeners) => served.map(drop).context("the service ended"),
        never = systemd::keep(handle) => match never {},
    }
}

/// Starts the service on a thread of its own, so that what subscribers cost never delays a frame. Gives its end.
///
/// # Errors
/// If there is no thread to be had.
pub fn on_a_thread<S>(service: S) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<S>>
where
    S: Future<Output = anyhow::Result<()>> + Send + 'static,
{
    let (ended, end) = oneshot::channel();
    crate::runtime::on_a_thread("service", move |runtime| {
        let _ = ended.send(runtime.block_on(service)); // the daemon did not wait for it
    })?;
    Ok(async { end.await.context("the service's thread ended by a fault of this program")? })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whoever starts the daemon is told that it failed.
    #[tokio::test]
    async fn a_service_that_fails_or_panics_is_a_failure_of_the_daemon() {
        let mut parts = Parts::default();
        parts.spawn_fallible(on_a_thread(async { anyhow::bail!("no more descriptors") }).unwrap());
        let failed = parts.next_end().await.unwrap().unwrap_err();
        assert_eq!(format!("{failed:#}"), "no more descriptors");
        parts.spawn_fallible(on_a_thread(async { panic!("as meant") }).unwrap());
        let panicked = parts.next_end().await.unwrap().unwrap_err();
        assert!(
            format!("{panicked:#}").starts_with("the service's thread ended by a fault of this program"),
            "{panicked:#}"
        );
        parts.spawn(async { panic!("as meant") });
        let panicked = parts.next_end().await.unwrap().unwrap_err();
        assert!(format!("{panicked:#}").contains("a fault of this program"), "{panicked:#}");
        assert!(parts.next_end().await.is_none());
    }
}
