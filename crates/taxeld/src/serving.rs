//! The service of the daemon: on which thread it runs, within which limits, and what else serves beside it.

use taxel_rpc::{Access, Handle, Limits, Listener, SharedServices, serve_and_share};
use tokio::sync::oneshot;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::config::Config;
use crate::systemd;

/// What the configuration lets clients take.
pub fn limits(config: &Config) -> Limits {
    let service = &config.service;
    Limits {
        streams: service.streams(),
        streams_per_peer: service.streams_of_one(),
        connections_per_peer: service.connections_of_one(),
        connections: service.connections_max,
        ..Limits::default()
    }
}

/// Where the services go besides: to the page and to the metrics, where they are configured.
#[cfg_attr(not(feature = "page"), allow(unused_variables, clippy::unnecessary_wraps))]
pub fn share_with_pages(
    config: &Config,
    cancel: &CancellationToken,
    tasks: &mut JoinSet<()>,
) -> anyhow::Result<Vec<oneshot::Sender<SharedServices>>> {
    #[cfg(feature = "page")]
    {
        let start = |site: crate::page::Site| {
            let (share, end) = site.start(cancel.clone())?;
            tasks.spawn(end);
            Ok(share)
        };
        crate::page::sites(config).into_iter().map(start).collect()
    }
    #[cfg(not(feature = "page"))]
    Ok(Vec::new())
}

/// Serves to the end, on the runtime that it is called on.
pub async fn service(
    handle: Handle,
    listeners: Vec<Listener>,
    access: Access,
    limits: Limits,
    share: Vec<oneshot::Sender<SharedServices>>,
) {
    let give = |services: SharedServices| {
        share.into_iter().for_each(|to| drop(to.send(services.clone()))); // to a page that may have failed
    };
    let served = tokio::select! {
        served = serve_and_share(handle.clone(), listeners, access, limits, give) => served,
        never = systemd::keep(handle) => match never {},
    };
    if let Err(error) = served {
        tracing::error!("the service ended: {:#}", anyhow::Error::from(error));
    }
}

/// Starts the service on a thread of its own, so that what subscribers cost never delays a frame. Gives its end.
pub fn on_a_thread(service: impl Future<Output = ()> + Send + 'static) -> anyhow::Result<impl Future<Output = ()>> {
    let (ended, end) = oneshot::channel();
    crate::runtime::on_a_thread("service", move |runtime| {
        runtime.block_on(service);
        let _ = ended.send(()); // the daemon did not wait for it
    })?;
    Ok(async move {
        if end.await.is_err() {
            tracing::error!("the service's thread panicked");
        }
    })
}
