//! What a certificate is made of: a model set, the exported samples of its session, and what a daemon knows beside them.

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use taxel_engine::calibration::{Branch, SessionSamples};
use taxel_engine::model_set::ModelSet;
use taxel_proto::v1;
use taxel_skin::flat;
use taxel_store::models_json;

use crate::recording::Recording;
use crate::session;

/// What people state of a calibration, as it stands in their file. What is `None` was not stated, and the certificate
/// says so.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Stated {
    /// For whom the calibration was made.
    pub customer: Option<String>,
    /// Who made it: laboratory or company.
    pub laboratory: Option<String>,
    /// Who was at the robot.
    pub operator: Option<String>,
    /// Where.
    pub place: Option<String>,
    /// The robot, with its serial number.
    pub robot: Option<String>,
    /// Serial number of the skin.
    pub skin_serial: Option<String>,
    /// Make and type of the reference pressure sensor.
    pub reference_sensor: Option<String>,
    /// Its serial number.
    pub reference_serial: Option<String>,
    /// Number of its own calibration certificate.
    pub reference_certificate: Option<String>,
    /// When it was calibrated.
    pub reference_date: Option<String>,
    /// Its expanded uncertainty (k = 2) by that certificate, in kPa.
    pub reference_expanded_uncertainty_kpa: Option<f64>,
    /// To which national standard it is traceable.
    pub traceability: Option<String>,
    /// Air temperature during the calibration, in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Relative humidity, in %.
    pub humidity_percent: Option<f64>,
    /// Ambient pressure, in kPa.
    pub ambient_kpa: Option<f64>,
    /// Anything else.
    pub remarks: Option<String>,
}

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
    /// Where each taxel lies on the skin laid flat; `None` where nobody says.
    pub(super) places_mm: Option<Vec<[f64; 2]>>,
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
            simulated: set.maker.simulated || recording.figure("simulated").is_some(),
            number,
            set,
            models_json,
            samples,
            samples_csv,
            session: None,
            loads: Vec::new(),
            places_mm: None,
            stated,
        })
    }

    /// With what the daemon says of the session, of known loads and of the skin.
    #[must_use]
    pub fn with(self, session: v1::Session, loads: Vec<v1::Load>, skin: &v1::Skin) -> Self {
        let (taxels, [positions, normals]) = (skin.taxels.len(), skin.poses());
        let tenths = |m: f64| (1e4 * m).round() / 10.0;
        let places_mm = (taxels > 0 && positions.len() == taxels)
            .then(|| flat(taxels, &positions, &normals).into_iter().map(|place| place.map(tenths)).collect());
        Self { session: Some(session), loads, places_mm, ..self }
    }
}

/// Whether set and samples belong together.
fn check(set: &ModelSet, samples: &SessionSamples) -> anyhow::Result<()> {
    let zero = samples.rest().context("the samples have no zero of a ramp")?;
    // Equal text is equal bits, and a taxel without a zero (NaN) equals itself.
    let is_own = format!("{zero:?}") == format!("{:?}", set.baseline);
    ensure!(is_own, "{} was not made of this session: its zero is not the one of the session's last ramp", set.id);
    let taxels = set.taxels.len();
    let fits = samples.samples.iter().all(|sample| sample.counts.counts().len() == taxels);
    ensure!(fits, "the samples have another number of taxels than {}, which has {taxels}", set.id);
    Ok(())
}
