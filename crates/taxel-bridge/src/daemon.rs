//! The way to the daemon: an ordinary client of its service.

use std::error::Error;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use anyhow::Context;
use taxel_client::{Address, Forces, Line, Options, TlsOptions, root_cause};
use taxel_proto::code_name;
use taxel_proto::judge::{aged, on_the_way};
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_proto::v1::{Health, PatchRequest, Skin, StreamRequest, TaxelReading, TaxelSample};
use tonic::{Response, Status, Streaming};

use crate::config::DaemonSection;

/// A daemon that does not answer by then does not run.
const HEALTH_WITHIN: Duration = Duration::from_secs(2);
/// Between two attempts to open a stream of taxels.
const AGAIN_AFTER: Duration = Duration::from_millis(250);

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
        let in_folder = |folder: &PathBuf| TlsOptions::in_folder(folder, section.tls_name.clone());
        let tls = section.tls.as_ref().map(in_folder).transpose().context("daemon.tls")?;
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

    /// Follows the taxels of a patch, so many samples a second.
    pub fn taxels(&self, patch: &str, rate_hz: f64) -> Taxels {
        Taxels { daemon: self.clone(), patch: patch.to_owned(), rate_hz, stream: None, told: String::new() }
    }

    /// Where the taxels of a patch lie.
    ///
    /// # Errors
    /// If the daemon does not answer.
    pub async fn layout(&self, patch: &str) -> Result<Skin, Status> {
        Ok(self.skin().get_skin(PatchRequest { patch: patch.to_owned() }).await?.into_inner())
    }

    /// `SkinService`.
    pub fn skin(&self) -> SkinServiceClient<Line> {
        SkinServiceClient::new(self.line.clone())
    }

    /// The daemon's health.
    ///
    /// # Errors
    /// Why it gives none.
    pub async fn health(&self) -> Result<Health, String> {
        match tokio::time::timeout(HEALTH_WITHIN, self.skin().get_health(())).await {
            Ok(told) => told.map(Response::into_inner).map_err(|status| words(&status)),
            Err(_) => Err(format!("the daemon has not answered within {} s", HEALTH_WITHIN.as_secs())),
        }
    }
}

/// The taxels of a patch, over one stream after the other.
pub struct Taxels {
    daemon: Daemon,
    patch: String,
    rate_hz: f64,
    /// A daemon that comes back may have another configuration, so each stream has its layout.
    stream: Option<(Skin, Streaming<TaxelSample>)>,
    /// Why the last stream ended.
    told: String,
}

impl Taxels {
    /// The next sample, how long ago it was sent, and where its taxels lie; `None` when the stream has ended or none could be
    /// opened.
    pub async fn next(&mut self) -> Option<(&Skin, TaxelSample, Duration)> {
        match self.received().await {
            Ok(sample) => {
                let waited = on_the_way(sample.sent.as_ref(), SystemTime::now());
                self.stream.as_ref().map(|(skin, _)| (skin, sample, waited))
            }
            Err(status) => {
                let why = words(&status);
                if self.told != why {
                    tracing::warn!(patch = self.patch, "no taxels from the daemon: {why}");
                }
                (self.stream, self.told) = (None, why);
                None
            }
        }
    }

    async fn received(&mut self) -> Result<TaxelSample, Status> {
        let (skin, stream) = match &mut self.stream {
            Some(open) => open,
            none => {
                if !self.told.is_empty() {
                    tokio::time::sleep(AGAIN_AFTER).await;
                }
                let skin = self.daemon.layout(&self.patch).await?;
                let request = StreamRequest { patch: self.patch.clone(), rate_hz: Some(self.rate_hz) };
                none.insert((skin, self.daemon.skin().stream_taxels(request).await?.into_inner()))
            }
        };
        match stream.message().await? {
            Some(sample) if sample.taxels.len() == skin.taxels.len() => Ok(sample),
            Some(_) => Err(Status::aborted("the patch has another number of taxels now")),
            None => Err(Status::unavailable("the daemon ended the stream")),
        }
    }
}

/// The pressure of a taxel in kPa that is valid `waited` after its sample was sent. One that hangs or stands at a rail reads
/// some pressure, too; no force has it in.
pub fn pressure_kpa(reading: &TaxelReading, sample: &TaxelSample, waited: Duration) -> Option<f32> {
    let is_young = aged(f64::from(reading.age_s?), waited) <= sample.max_age();
    reading.pressure_kpa.filter(|_| is_young && !reading.stale && reading.faults.is_empty())
}

/// What a failed call says, with the system's own reason where there is one.
pub fn words(status: &Status) -> String {
    let words = status.source().map_or_else(|| status.message().to_owned(), root_cause);
    if words.is_empty() { code_name(status.code()).to_owned() } else { words }
}
