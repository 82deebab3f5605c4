//! Limits of use: what the certificate does not show, in words.

use taxel_engine::calibration::{Branch, SessionState};

use crate::document::{SetPart, TaxelPart};
use crate::evidence::Evidence;

/// A line each.
pub(crate) fn limits(evidence: &Evidence<'_>, set: &SetPart, taxels: &[TaxelPart], ramps: usize) -> Vec<String> {
    let no_skin = "Simulated or replayed: no skin was measured, and nothing is certified.".to_owned();
    let mut limits: Vec<String> = evidence.is_simulated().then_some(no_skin).into_iter().collect();
    limits.extend([
        "Pressure along the normals of the skin, slowly changing; shear was not measured.".to_owned(),
        format!(
            "Up to {:.1} kPa, and for each taxel within its own range of counts; a reading beyond it is not certified.",
            set.pressure_max_kpa
        ),
        "The bag presses on all taxels alike. The uncertainties are those of such a pressure; how well a force over a \
         small area is read is shown by known loads alone."
            .to_owned(),
    ]);
    let excluded = set.taxels - set.usable;
    if excluded > 0 {
        let percent = 100.0 * excluded as f64 / set.taxels as f64;
        limits.push(format!("{excluded} of {} taxels ({percent:.1} %) have no model and read nothing.", set.taxels));
    }
    if evidence.session.branches == Branch::Rising {
        limits
            .push("Rising pressure only: the hysteresis was not measured and is not in the uncertainties.".to_owned());
    }
    if ramps < 2 {
        limits.push(
            "A single ramp: repeatability and the shift of the zero were not determined and are not in the uncertainties."
                .to_owned(),
        );
    }
    if taxels.iter().any(|taxel| taxel.plays.is_some()) {
        limits.push(
            "In use the hysteresis is compensated; the uncertainties are those without compensation, which are greater."
                .to_owned(),
        );
    }
    limits.extend(not_stated(evidence));
    limits.extend(of_session(evidence, set));
    limits
}

/// Two ways to the same figure may differ by so much, relative.
const ROUNDING: f64 = 1e-9;

fn not_stated(evidence: &Evidence<'_>) -> Vec<String> {
    let stated = evidence.entered;
    let mut lines = Vec::new();
    if stated.traceability.is_none() || stated.reference_certificate.is_none() {
        lines.push(
            "Traceability of the reference sensor is not stated: the pressures are traceable to nothing.".to_owned(),
        );
    }
    let of_zero_kpa = evidence.samples.gauge_zero_doubt_kpa(evidence.set);
    if evidence.set.gauge_gain_rel == 0.0
        && evidence.set.gauge_offset_kpa <= of_zero_kpa * (1.0 + ROUNDING)
        && stated.reference_expanded_uncertainty_kpa.is_none()
    {
        lines.push("The uncertainty of the reference sensor is not stated and counts as 0.".to_owned());
    }
    if stated.temperature_c.is_none() {
        lines.push("The temperature during the calibration is not stated.".to_owned());
    }
    lines
}

fn of_session(evidence: &Evidence<'_>, set: &SetPart) -> Vec<String> {
    let session = evidence.session;
    let mut lines = Vec::new();
    if session.model_set.as_deref() != Some(set.id.as_str()) {
        let own = session.model_set.as_deref().unwrap_or("none");
        lines.push(format!(
            "Session {} has another model set of its own now ({own}): this one was fitted with other options or before \
             the last ramp. All figures are over all scans that the session holds now.",
            session.number
        ));
    }
    if matches!(session.state, SessionState::Discarded | SessionState::Aborted | SessionState::Failed) {
        lines.push(format!("The session is {}: its models were not accepted by the operator.", session.state.name()));
    }
    lines
}
