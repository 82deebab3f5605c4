//! The way to the daemon: an ordinary client of its service.

use std::time::Duration;

use anyhow::Context;
use taxel_client::{Address, Forces, Line, Options, TlsOptions};
use taxel_proto::code_name;
use taxel_proto::v1::Health;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use tokio::sync::watch;
use tonic::{Response, Status};

use crate::config::DaemonSection;

/// A daemon that has not answered a command by then does not, and the next question has its turn. It gives up a command
/// itself then.
const ANSWER_WITHIN: Duration = Duration::from_secs(100);
/// How often the daemon is asked for its health.
const HEALTH_EVERY: Duration = Duration::from_secs(1);
/// A daemon that does not answer by then does not run.
const HEALTH_WITHIN: Duration = Duration::from_secs(2);

/// The daemon's health, or why it gives none.
pub type HealthFeed = watch::Receiver<Result<Health, String>>;

/// The daemon. The connection is made when the first call needs it, and made anew after it broke.
#[derive(Clone)]
pub struct Daemon {
    options: Options,
    line: Line,
}

impl Daemon {
    /// Prepares the connection; needs a running runtime.
    ///
    /// # Errors
    /// If the address, the token or a certificate cannot be used.
    pub fn new(section: &DaemonSection) -> anyhow::Result<Self> {
        let address = match &section.server {
            Some(server) => Address::parse(server).with_context(|| format!("daemon.server = {server:?}"))?,
            None => Address::local(),
        };
        let tls = section.tls.as_deref().map(TlsOptions::in_folder).transpose().context("daemon.tls")?;
        let tls = tls.map(|tls| TlsOptions { name: section.tls_name.clone(), ..tls });
        let options = Options { token: section.token_file.clone(), tls, ..Options::new(address) };
        Ok(Self { line: options.connect_lazy()?, options })
    }

    /// Its address.
    pub fn server(&self) -> String {
        self.options.address.to_string()
    }

    /// Follows the force of a patch: so many samples a second, or each as it comes.
    pub fn forces(&self, patch: &str, rate_hz: Option<f64>) -> Forces {
        taxel_client::follow(Options { patch: patch.to_owned(), rate_hz, ..self.options.clone() })
    }

    /// `SkinService`.
    pub fn skin(&self) -> SkinServiceClient<Line> {
        SkinServiceClient::new(self.line.clone())
    }

    /// Asks for the health once a second, for as long as somebody wants to know.
    pub fn follow_health(&self) -> HealthFeed {
        let (sender, health) = watch::channel(Err("not asked yet".to_owned()));
        let daemon = self.clone();
        tokio::spawn(async move {
            while !sender.is_closed() {
                let mut skin = daemon.skin();
                let told = answered_within(HEALTH_WITHIN, skin.get_health(())).await;
                sender.send_modify(|health| *health = told);
                tokio::time::sleep(HEALTH_EVERY).await;
            }
        });
        health
    }
}

/// What a failed call says, with the system's own reason where there is one.
pub fn words(status: &Status) -> String {
    let mut words = status.message().to_owned();
    let mut cause = std::error::Error::source(status);
    while let Some(source) = cause {
        words = source.to_string();
        cause = source.source();
    }
    if words.is_empty() { code_name(status.code()).to_owned() } else { words }
}

/// What the daemon answers in time, or why it does not, in words.
pub async fn answered<A>(call: impl Future<Output = Result<Response<A>, Status>>) -> Result<A, String> {
    answered_within(ANSWER_WITHIN, call).await
}

async fn answered_within<A>(
    limit: Duration,
    call: impl Future<Output = Result<Response<A>, Status>>,
) -> Result<A, String> {
    match tokio::time::timeout(limit, call).await {
        Ok(Ok(answer)) => Ok(answer.into_inner()),
        Ok(Err(status)) => Err(words(&status)),
        Err(_) => Err(format!("the daemon has not answered within {} s", limit.as_secs())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_certificate_that_is_not_there_is_named() {
        let section = DaemonSection { tls: Some("/nowhere".into()), ..DaemonSection::default() };
        let error = format!("{:#}", Daemon::new(&section).err().unwrap());
        assert!(error.contains("daemon.tls: /nowhere/ca.pem"), "{error}");
    }
}
