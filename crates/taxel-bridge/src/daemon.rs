//! The way to the daemon: an ordinary client of its service.

use std::time::Duration;

use anyhow::Context;
use taxel_client::{Address, Line, Options, TlsOptions};
use taxel_proto::code_name;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use tonic::{Response, Status};

use crate::config::{DaemonSection, TlsSection};

/// Largest answer that is taken: certificates of large patches are beyond tonic's 4 MiB.
const ANSWER_BYTES_MAX: usize = 64 << 20;

/// A daemon that has not answered by then does not, and the next question has its turn. It gives up a command itself then.
const ANSWER_WITHIN: Duration = Duration::from_secs(100);

/// The daemon. The connection is made when the first call needs it, and made anew after it broke.
#[derive(Clone)]
pub struct Daemon {
    line: Line,
    server: String,
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
        let tls = section.tls.as_ref().map(certificates).transpose().context("daemon.tls")?;
        let server = address.to_string();
        let options = Options { token: section.token_file.clone(), tls, ..Options::new(address) };
        Ok(Self { line: options.connect_lazy()?, server })
    }

    /// Its address.
    pub fn server(&self) -> &str {
        &self.server
    }

    /// `ForceService`.
    pub fn force(&self) -> ForceServiceClient<Line> {
        ForceServiceClient::new(self.line.clone())
    }

    /// `SkinService`.
    pub fn skin(&self) -> SkinServiceClient<Line> {
        SkinServiceClient::new(self.line.clone())
    }

    /// `ModelService`.
    pub fn models(&self) -> ModelServiceClient<Line> {
        ModelServiceClient::new(self.line.clone()).max_decoding_message_size(ANSWER_BYTES_MAX)
    }
}

fn certificates(section: &TlsSection) -> anyhow::Result<TlsOptions> {
    let TlsSection { ca, certificate, key, name } = section;
    Ok(TlsOptions { name: name.clone(), ..TlsOptions::read(ca, certificate, key)? })
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
    match tokio::time::timeout(ANSWER_WITHIN, call).await {
        Ok(Ok(answer)) => Ok(answer.into_inner()),
        Ok(Err(status)) => Err(words(&status)),
        Err(_) => Err(format!("the daemon has not answered within {} s", ANSWER_WITHIN.as_secs())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn an_address_that_is_none_is_refused_with_what_was_expected() {
        let section = DaemonSection { server: Some("not an address".into()), ..DaemonSection::default() };
        let error = Daemon::new(&section).err().unwrap().to_string();
        assert!(error.contains("daemon.server"), "{error}");
    }

    #[tokio::test]
    async fn a_file_that_is_not_there_is_named() {
        let none = |name: &str| std::path::PathBuf::from(format!("/nowhere/{name}"));
        let tls =
            TlsSection { ca: none("ca.pem"), certificate: none("bridge.pem"), key: none("bridge.key"), name: None };
        let section = DaemonSection { tls: Some(tls), ..DaemonSection::default() };
        let error = format!("{:#}", Daemon::new(&section).err().unwrap());
        assert!(error.contains("daemon.tls: /nowhere/ca.pem"), "{error}");
        let section = DaemonSection { token_file: Some(none("token")), ..DaemonSection::default() };
        let error = format!("{:#}", Daemon::new(&section).err().unwrap());
        assert!(error.contains("/nowhere/token"), "{error}");
    }
}
