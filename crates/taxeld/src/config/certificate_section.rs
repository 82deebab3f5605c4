//! `[certificate]` and `[patch.certificate]`: what people state of a calibration, for its certificate.

use serde::Deserialize;

/// `[certificate]`; a patch's own section goes before it, key by key.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CertificateSection {
    /// For whom the calibration is made.
    pub customer: Option<String>,
    /// Who makes it: laboratory or company.
    pub laboratory: Option<String>,
    /// Who is at the robot.
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
    /// Its expanded uncertainty (k = 2) by that certificate.
    pub reference_expanded_uncertainty_kpa: Option<f64>,
    /// To which standard it is traceable.
    pub traceability: Option<String>,
    /// Air temperature, in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Relative humidity.
    pub humidity_percent: Option<f64>,
    /// Ambient pressure.
    pub ambient_kpa: Option<f64>,
    /// Anything else.
    pub remarks: Option<String>,
}
