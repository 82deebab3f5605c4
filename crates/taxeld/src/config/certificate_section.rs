//! `[certificate]` and `[patch.certificate]`: what people state of a calibration, for its certificate.

use std::ops::RangeInclusive;

use serde::Deserialize;

use super::fault::Fault;

/// Longest text, in bytes.
const TEXT_BYTES_MAX: usize = 1024;

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

impl CertificateSection {
    /// What is wrong with it, if anything is: key, value and what was expected.
    pub fn problem(&self) -> Option<Fault> {
        let texts = [
            ("customer", &self.customer),
            ("laboratory", &self.laboratory),
            ("operator", &self.operator),
            ("place", &self.place),
            ("robot", &self.robot),
            ("skin_serial", &self.skin_serial),
            ("reference_sensor", &self.reference_sensor),
            ("reference_serial", &self.reference_serial),
            ("reference_certificate", &self.reference_certificate),
            ("reference_date", &self.reference_date),
            ("traceability", &self.traceability),
            ("remarks", &self.remarks),
        ];
        let too_long = |(key, text): &(&str, &Option<String>)| {
            let bytes = text.as_ref().map_or(0, String::len);
            let key = format!("certificate.{key}");
            let words = format!("{key}: {bytes} bytes, at most {TEXT_BYTES_MAX}");
            (bytes > TEXT_BYTES_MAX).then(|| Fault::of(key, words))
        };
        let numbers: [(&str, Option<f64>, RangeInclusive<f64>); 4] = [
            ("reference_expanded_uncertainty_kpa", self.reference_expanded_uncertainty_kpa, 0.0..=100.0),
            ("temperature_c", self.temperature_c, -50.0..=100.0),
            ("humidity_percent", self.humidity_percent, 0.0..=100.0),
            ("ambient_kpa", self.ambient_kpa, 0.0..=200.0),
        ];
        let beyond = |(key, value, range): &(&str, Option<f64>, RangeInclusive<f64>)| {
            let value = value.filter(|value| !range.contains(value))?;
            Some(Fault::range(&format!("certificate.{key}"), value, *range.start(), *range.end()))
        };
        texts.iter().find_map(too_long).or_else(|| numbers.iter().find_map(beyond))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_have_a_length_and_numbers_a_range() {
        let ok =
            CertificateSection { temperature_c: Some(21.5), customer: Some("x".repeat(1024)), ..Default::default() };
        assert_eq!(ok.problem(), None);
        let long = CertificateSection { robot: Some("x".repeat(1025)), ..Default::default() };
        assert!(long.problem().unwrap().words().contains("certificate.robot: 1025 bytes"));
        let wet = CertificateSection { humidity_percent: Some(f64::NAN), ..Default::default() };
        assert!(wet.problem().unwrap().words().contains("humidity_percent = NaN: expected 0 to 100"));
    }
}
