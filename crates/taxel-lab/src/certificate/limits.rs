//! Limits of use: what the certificate does not show, in words.

use taxel_engine::calibration::Branch;
use taxel_proto::v1::{Session, SessionState};

use super::document::SetPart;
use super::evidence::Evidence;

/// Two ways to the same figure may differ by so much, relative.
const ROUNDING: f64 = 1e-9;

/// A line each.
pub(super) fn limits(evidence: &Evidence, set: &SetPart, ramps: usize) -> Vec<String> {
    let Evidence { stated, samples, .. } = evidence;
    let mut lines = Vec::new();
    let mut say = |holds: bool, line: &str| lines.extend(holds.then(|| line.to_owned()));
    say(evidence.simulated, "Simulated or replayed: no skin was measured, and nothing is certified.");
    say(true, "Pressure along the normals of the skin, slowly changing. Shear was not measured.");
    let range = format!(
        "Up to {:.1} kPa, and for each taxel within its own range of counts. A reading beyond it is not certified.",
        set.pressure_max_kpa
    );
    say(true, &range);
    say(
        true,
        "The bag presses on all taxels alike. How well a force over a small area is read is shown by known loads alone.",
    );
    let excluded = set.taxels - set.usable;
    let percent = 100.0 * excluded as f64 / set.taxels as f64;
    let without = format!("{excluded} of {} taxels ({percent:.1} %) have no model and read nothing.", set.taxels);
    say(excluded > 0, &without);
    say(
        evidence.branches == Branch::Rising,
        "Rising pressure only: the hysteresis was not measured and is not in the uncertainties.",
    );
    say(
        ramps < 2,
        "A single ramp: repeatability and the shift of the zero were not determined and are not in the uncertainties.",
    );
    say(
        (0..set.taxels).any(|taxel| evidence.set.plays(taxel).is_some()),
        "In use the hysteresis is compensated. The uncertainties are those without compensation, which are greater.",
    );
    say(
        stated.traceability.is_none() || stated.reference_certificate.is_none(),
        "Traceability of the reference sensor is not stated: the pressures are traceable to nothing.",
    );
    let of_zero_kpa = samples.gauge_zero_doubt_kpa(&evidence.set) * (1.0 + ROUNDING);
    let nothing_stated = set.gauge_gain_rel == 0.0 && set.gauge_offset_kpa <= of_zero_kpa;
    say(
        nothing_stated && stated.reference_expanded_uncertainty_kpa.is_none(),
        "The uncertainty of the reference sensor is not stated and counts as 0.",
    );
    say(stated.temperature_c.is_none(), "The temperature during the calibration is not stated.");
    lines.extend(evidence.session.iter().flat_map(|session| of_session(session, set)));
    lines
}

fn of_session(session: &Session, set: &SetPart) -> Vec<String> {
    let mut lines = Vec::new();
    if session.model_set != set.id {
        lines.push(format!(
            "Session {} has another model set of its own now ({}): this one was fitted with other options or before the \
             last ramp. All figures are over all scans that the session holds now.",
            session.session, session.model_set
        ));
    }
    if matches!(session.state(), SessionState::Discarded | SessionState::Aborted | SessionState::Failed) {
        let state = session.state().as_str_name().trim_start_matches("SESSION_STATE_");
        lines.push(format!("The session is {state}: its models were not accepted by the operator."));
    }
    lines
}
