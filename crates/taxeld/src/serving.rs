//! The service of the daemon: on which thread it runs, within which limits, and what else serves beside it.

use anyhow::Context;
use taxel_rpc::{Access, Handle, Limits, Listener, SharedServices, serve_and_share};
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

use crate::config::Config;
use crate::parts::Parts;
use crate::systemd;

/// What clients may take.
pub fn limits() -> Limits {
    Limits { streams: 128, ..Limits::default() }
}

/// Where the services go besides: to the page and to the metrics, where they are configured.
#[cfg_attr(not(feature = "page"), allow(unused_variables, clippy::unnecessary_wraps))]
pub fn share_with_pages(
    config: &Config,
    cancel: &CancellationToken,
    parts: &mut Parts,
) -> anyhow::Result<Vec<oneshot::Sender<SharedServices>>> {
    #[cfg(feature = "page")]
    {
        let start = |site: crate::page::Site| {
            let (share, end) = site.start(cancel.clone())?;
            parts.spawn(end);
            Ok(share)
        };
        crate::page::sites(config).into_iter().map(start).collect()
    }
    #[cfg(not(feature = "page"))]
    Ok(Vec::new())
}

/// Serves to the end, on the runtime that it is called on.
///
/// # Errors
/// What keeps it from serving.
pub async fn service(
    handle: Handle,
    listeners: Vec<Listener>,
    access: Access,
    limits: Limits,
    share: Vec<oneshot::Sender<SharedServices>>,
) -> anyhow::Result<()> {
    let give = |services: SharedServices| {
        share.into_iter().for_each(|to| drop(to.send(services.clone()))); // to a page that may have failed
    };
    tokio::select! {
        served = serve_and_share(handle.clone(), listeners, access, limits, give) => served.map(drop).context("the service ended"),
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
