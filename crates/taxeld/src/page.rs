//! The page and the metrics beside the service, each on a thread of its own: what JSON costs never delays a controller's
//! sample or a frame.

use std::net::TcpListener;

use anyhow::Context;
use taxel_page::{Limits, Options, Shows, bind, serve};
use taxel_rpc::{Handle, Server};

use crate::config::Config;
use crate::runtime::on_a_thread;
use crate::tasks::Tasks;

/// Binds the page's address before there is a daemon, or another port if it is taken.
///
/// # Errors
/// If there is no port to be had.
#[cfg(feature = "sim")]
pub fn bind_some(usual: std::net::SocketAddr) -> std::io::Result<TcpListener> {
    bind(usual).or_else(|_| bind(std::net::SocketAddr::new(usual.ip(), 0)))
}

/// Serves the page and the metrics, where they are configured. One that fails is told in the log and leaves the daemon as it is.
///
/// # Errors
/// If an address is taken, or there is no thread to be had.
pub fn serve_pages(config: &Config, server: &Server, handle: &Handle, tasks: &mut Tasks) -> anyhow::Result<()> {
    let own = config.metrics.as_ref().and_then(|metrics| metrics.listen);
    let hosts = config.page.as_ref().map(|page| page.hosts.clone()).unwrap_or_default();
    let mut start = |name: &'static str, listener: std::io::Result<TcpListener>, shows| -> anyhow::Result<()> {
        let listener = listener.with_context(|| format!("{name}.listen"))?;
        let (address, services, shutdown) = (listener.local_addr()?, server.shared(), tasks.cancel.clone());
        let options =
            Options { services, handle: handle.clone(), shows, names: hosts.clone(), limits: Limits::default() };
        let end = on_a_thread(name, serve(listener, options, shutdown.clone()))?;
        tracing::info!("the {name}: http://{address}/");
        tasks.parts.spawn(async move {
            if let Err(error) = end.await.and_then(|served| Ok(served?)) {
                tracing::error!(%error, "the {name} ended");
            }
            shutdown.cancelled().await;
        });
        Ok(())
    };
    if let Some(page) = &config.page {
        let shows = if config.metrics.is_some() && own.is_none() { Shows::All } else { Shows::Page };
        let bound = page.bound.as_ref().map_or_else(|| bind(page.listen), |bound| bound.try_clone());
        start("page", bound, shows)?;
    }
    own.map_or(Ok(()), |listen| start("metrics", bind(listen), Shows::Metrics))
}
