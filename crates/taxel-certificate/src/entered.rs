//! What people state of a calibration; the daemon cannot know it.

use serde::Serialize;

/// What people state of a calibration, as they wrote it into the configuration. What is `None` was not stated, and the
/// certificate says so.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Entered {
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

impl Entered {
    /// What is stated here, and where nothing is, what `general` states.
    #[must_use]
    pub fn or(self, general: &Self) -> Self {
        let g = general.clone();
        Self {
            customer: self.customer.or(g.customer),
            laboratory: self.laboratory.or(g.laboratory),
            operator: self.operator.or(g.operator),
            place: self.place.or(g.place),
            robot: self.robot.or(g.robot),
            skin_serial: self.skin_serial.or(g.skin_serial),
            reference_sensor: self.reference_sensor.or(g.reference_sensor),
            reference_serial: self.reference_serial.or(g.reference_serial),
            reference_certificate: self.reference_certificate.or(g.reference_certificate),
            reference_date: self.reference_date.or(g.reference_date),
            reference_expanded_uncertainty_kpa: self
                .reference_expanded_uncertainty_kpa
                .or(g.reference_expanded_uncertainty_kpa),
            traceability: self.traceability.or(g.traceability),
            temperature_c: self.temperature_c.or(g.temperature_c),
            humidity_percent: self.humidity_percent.or(g.humidity_percent),
            ambient_kpa: self.ambient_kpa.or(g.ambient_kpa),
            remarks: self.remarks.or(g.remarks),
        }
    }
}
