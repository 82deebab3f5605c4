//! What a certificate is made of: a model set, the exported samples of its session, and what a daemon knows beside them.

use anyhow::{Context, bail, ensure};
use taxel_engine::calibration::{Branch, SessionSamples};
use taxel_engine::model_set::ModelSet;
use taxel_proto::v1;
use taxel_store::models_json;

use super::document::Stated;
use crate::recording::Recording;
use crate::session;

/// Everything that a certificate is made of.
#[derive(Clone, Debug)]
pub struct Evidence {
    pub(super) set: ModelSet,
    /// The same as it is exported, whose hash goes into the certificate.
    pub(super) models_json: String,
    pub(super) samples: SessionSamples,
    /// The same as they are exported.
    pub(super) samples_csv: String,
    pub(super) branches: Branch,
    /// Whether no skin was measured: a simulator or a replayed log sent the samples.
    pub(super) simulated: bool,
    /// Number of the session.
    pub(super) number: u64,
    /// What the daemon knows of it; `None` if the certificate is made of files.
    pub(super) session: Option<v1::Session>,
    /// Known loads of the patch, also those of other sets.
    pub(super) loads: Vec<v1::Load>,
    /// What people state.
    pub(super) stated: Stated,
}

impl Evidence {
    /// Of a model set and the samples of its session, as they were exported.
    ///
    /// # Errors
    /// A text that cannot be read, or samples that are not those of the set.
    pub fn of(models_json: String, samples_csv: String, stated: Stated) -> anyhow::Result<Self> {
        let set = models_json::from_json(&models_json).context("the models")?;
        let recording = Recording::parse(samples_csv.as_bytes()).context("the samples")?;
        if !session::is_session(&recording) {
            bail!("the samples are not those of a session: expected what `taxeld sessions export` writes");
        }
        let (samples, _) = session::samples(&recording).context("the samples")?;
        let number = set.certifying_session().map_err(anyhow::Error::msg)?;
        check(&set, &samples)?;
        Ok(Self {
            branches: session::gathered(&recording),
            simulated: set.maker.simulated || session::is_simulated(&recording),
            number,
            set,
            models_json,
            samples,
            samples_csv,
            session: None,
            loads: Vec::new(),
            stated,
        })
    }

    /// With what the daemon says of the session and of known loads.
    #[must_use]
    pub fn with(self, session: v1::Session, loads: Vec<v1::Load>) -> Self {
        Self { session: Some(session), loads, ..self }
    }
}

/// Whether set and samples belong together.
fn check(set: &ModelSet, samples: &SessionSamples) -> anyhow::Result<()> {
    let zero = samples.ramps.first().context("the samples have no zero of a ramp")?;
    let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
    let is_own = zero.taxels.len() == set.baseline.len()
        && zero.taxels.iter().zip(&set.baseline).all(|(a, b)| same(a.mean, b.mean) && same(a.noise, b.noise));
    ensure!(is_own, "{} was not made of this session: its zero is not the one of the session's first ramp", set.id);
    let taxels = set.taxels.len();
    let fits = samples.samples.iter().all(|sample| sample.counts.counts().len() == taxels);
    ensure!(fits, "the samples have another number of taxels than {}, which has {taxels}", set.id);
    Ok(())
}
