//! The page and the metrics beside the service, on a thread of their own: what JSON costs never delays a controller's sample or
//! a frame.

#[cfg(feature = "sim")]
use std::net::TcpListener;

use anyhow::Context;
use taxel_page::{Limits, Options, bind, serve};
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

/// Serves the page, where it is configured. One that fails is told in the log and leaves the daemon as it is.
///
/// # Errors
/// If its address is taken, or there is no thread to be had.
pub fn serve_page(config: &Config, server: &Server, handle: &Handle, tasks: &mut Tasks) -> anyhow::Result<()> {
    let Some(page) = &config.page else { return Ok(()) };
    let bound = page.bound.as_ref().map_or_else(|| bind(page.listen), |bound| bound.try_clone());
    let listener = bound.context("page.listen")?;
    let (address, services, shutdown) = (listener.local_addr()?, server.shared(), tasks.cancel.clone());
    let options = Options { services, handle: handle.clone(), names: page.hosts.clone(), limits: Limits::default() };
    let end = on_a_thread("page", serve(listener, options, shutdown.clone()))?;
    tracing::info!("the page: http://{address}/");
    tasks.parts.spawn(async move {
        if let Err(error) = end.await.and_then(|served| Ok(served?)) {
            tracing::error!(%error, "the page ended");
        }
        shutdown.cancelled().await;
        Ok(())
    });
    Ok(())
}
