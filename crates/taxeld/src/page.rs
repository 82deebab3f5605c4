//! The page and the metrics beside the service, each on a thread of its own: what JSON costs never delays a controller's
//! sample or a frame.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;

use anyhow::Context;
use taxel_page::{Limits, Options, Shows, bind, serve};
use taxel_rpc::SharedServices;
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

use crate::config::Config;

/// What is served over HTTP on one address.
pub struct Site {
    /// The section of the configuration that it is from, also the name of its thread.
    name: &'static str,
    listen: SocketAddr,
    /// Bound to it already.
    bound: Option<Arc<TcpListener>>,
    shows: Shows,
    /// Names of a proxy before it.
    hosts: Vec<String>,
}

/// What the configuration asks for.
pub fn sites(config: &Config) -> Vec<Site> {
    let hosts = config.page.as_ref().map(|page| page.hosts.clone()).unwrap_or_default();
    let own = config.metrics.as_ref().and_then(|metrics| metrics.listen);
    let shows = if config.metrics.is_some() && own.is_none() { Shows::All } else { Shows::Page };
    let page = config.page.as_ref().map(|page| Site {
        name: "page",
        listen: page.listen,
        bound: page.bound.clone(),
        shows,
        hosts: hosts.clone(),
    });
    let metrics = own.map(|listen| Site { name: "metrics", listen, bound: None, shows: Shows::Metrics, hosts });
    page.into_iter().chain(metrics).collect()
}

/// Binds the page's address before there is a daemon, or another port if it is taken.
///
/// # Errors
/// If there is no port to be had.
#[cfg(feature = "sim")]
pub fn bind_some(usual: SocketAddr) -> std::io::Result<TcpListener> {
    bind(usual).or_else(|_| bind(SocketAddr::new(usual.ip(), 0)))
}

impl Site {
    /// Binds the address and starts the thread. Gives the site's end. One that fails is told in the log and leaves the
    /// daemon as it is.
    ///
    /// # Errors
    /// If the address is taken, or there is no thread to be had.
    pub fn start(
        self,
        services: SharedServices,
        shutdown: CancellationToken,
    ) -> anyhow::Result<impl Future<Output = ()> + use<>> {
        let Self { name, listen, bound, shows, hosts: names } = self;
        let listener = bound.map_or_else(|| bind(listen), |bound| bound.try_clone());
        let listener = listener.with_context(|| format!("{name}.listen = {listen}"))?;
        let address = listener.local_addr()?;
        let (ended, end) = oneshot::channel::<()>();
        let serving = serve(listener, Options { services, shows, names, limits: Limits::default() }, shutdown.clone());
        crate::runtime::on_a_thread(name, move |runtime| {
            if let Err(error) = runtime.block_on(serving) {
                tracing::error!(%error, "the {name} ended");
            }
            drop(ended);
        })?;
        tracing::info!("the {name}: http://{address}/");
        Ok(async move {
            shutdown.cancelled().await;
            let _ = end.await; // dropped at the end, never sent
        })
    }
}
