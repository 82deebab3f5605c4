//! From evidence to certificate.

use std::time::{Duration, UNIX_EPOCH};

use anyhow::ensure;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use taxel_engine::calibration::Branch;
use taxel_engine::statistics::root_mean_square;
use taxel_engine::verdict::Verdict;
use taxel_proto::Timestamp;
use taxel_proto::v1::{Load, SessionState};

use super::budget::{self, COVERAGE_FACTOR};
use super::course::{Course, LEVELS, deviation};
use super::evidence::Evidence;
use super::taxel::{Examined, examine, per_unit};
use crate::numbers::mean;

/// So many digits of the hash make the number.
const NUMBER_DIGITS: usize = 16;

/// Two ways to the same figure may differ by so much, relative.
const ROUNDING: f64 = 1e-9;

/// A certificate. Pressures in kPa, counts in units (`counts_per_unit` raw counts each), forces in newton.
#[derive(Clone, Debug)]
pub struct Certificate(pub(super) Value);

impl Certificate {
    /// Works out the certificate.
    ///
    /// # Errors
    /// No taxel is usable.
    pub fn of(evidence: &Evidence) -> anyhow::Result<Self> {
        let Evidence { set, samples, stated, .. } = evidence;
        let course = Course::of(samples, evidence.branches, set.pressure_max_kpa);
        let examined = |(taxel, model)| examine(taxel, model, samples, &course);
        let mut taxels: Vec<Examined> = set.taxels.iter().enumerate().filter_map(examined).collect();
        ensure!(!taxels.is_empty(), "{} has no usable taxel", set.id);
        let of_all = |scan: usize| mean(taxels.iter().map(|taxel| taxel.errors[scan]));
        let errors: Vec<f64> = (0..course.kpa.len()).map(of_all).collect();
        let (figures, zero_kpa) = (course.figures(&errors), budget::zero_shift_of_mean_kpa(&taxels, course.ramps));
        let stated_kpa = stated.reference_expanded_uncertainty_kpa;
        let reference_kpa = budget::reference_kpa(set, stated_kpa, samples.gauge_zero_sigma_kpa(set));
        let rows = budget::rows(&taxels, &figures, zero_kpa, reference_kpa, per_unit(samples));
        for taxel in &mut taxels {
            taxel.part["expanded_uncertainty_kpa"] = budget::expanded_of_taxel(taxel, reference_kpa).into();
        }
        let loads = loads(&evidence.loads, &set.id);
        let mut certificate = Self(json!({
            "format": "taxel-certificate",
            "version": 1,
            "number": "",
            "software": concat!("taxel-lab ", env!("CARGO_PKG_VERSION")),
            "simulated": evidence.simulated,
            "stated": stated,
            "verdict": Verdict::of(set, evidence.session.as_ref().map(|session| session.target_kpa), None).lines,
            "set": set_part(evidence, taxels.len()),
            "session": session_part(evidence),
            "ramps": (0..course.ramps).map(|at| ramp(at, &course, &taxels, evidence)).collect::<Vec<_>>(),
            "levels": levels(&course, &taxels, &errors),
            "mean": {
                "rmse_kpa": figures.rmse,
                "bias_kpa": figures.bias,
                "max_error_kpa": figures.max,
                "hysteresis_kpa": figures.hysteresis,
                "repeatability_kpa": figures.repeatability,
                "zero_shift_kpa": zero_kpa,
            },
            "expanded": {
                "coverage_factor": COVERAGE_FACTOR,
                "taxel_kpa": budget::expanded(&rows, |row| row.taxel_kpa),
                "mean_kpa": budget::expanded(&rows, |row| row.mean_kpa),
            },
            "budget": rows,
            "loads_summary": loads_summary(&loads),
            "loads": loads,
            "limits": limits(evidence, taxels.len()),
            "excluded": excluded(evidence),
            "places_mm": evidence.places_mm,
            "taxels": taxels.into_iter().map(|taxel| taxel.part).collect::<Vec<_>>(),
            "hashes": { "samples_csv": sha256(&evidence.samples_csv), "models_json": sha256(&evidence.models_json) },
        }));
        let hash = sha256(&certificate.to_json());
        certificate.0["number"] = format!("c-{}", &hash[..NUMBER_DIGITS]).into();
        Ok(certificate)
    }

    /// Its number: the beginning of the hash of its JSON without the number.
    #[must_use]
    pub fn number(&self) -> &str {
        self.0["number"].as_str().unwrap_or_default()
    }

    /// The certificate as JSON, a field a line.
    #[must_use]
    pub fn to_json(&self) -> String {
        format!("{:#}\n", self.0)
    }
}

fn set_part(evidence: &Evidence, usable: usize) -> Value {
    let set = &evidence.set;
    let made = UNIX_EPOCH + Duration::from_nanos(u64::try_from(set.created_wall_ns).unwrap_or(0));
    json!({
        "id": set.id,
        "patch": set.patch,
        "made": Timestamp::from(made).to_string(),
        "method": set.method,
        "fitted_by": Some(&set.maker.software).filter(|name| !name.is_empty()),
        "board_settings": set.board_settings,
        "taxels": set.taxels.len(),
        "usable": usable,
        "pressure_max_kpa": set.pressure_max_kpa,
        "gauge_gain_rel": set.gauge_gain_rel,
        "gauge_offset_kpa": set.gauge_offset_kpa,
    })
}

/// What only the daemon knows is absent in a certificate made of files.
fn session_part(evidence: &Evidence) -> Value {
    let session = evidence.session.as_ref();
    json!({
        "number": evidence.number,
        "started": session.and_then(|session| session.started.as_ref()).map(ToString::to_string),
        "branches": if evidence.branches == Branch::Rising { "rising" } else { "both" },
        "target_kpa": session.map(|session| session.target_kpa),
        "unloaded_confirmed_by": session.map(|session| &session.confirmed_by).filter(|by| !by.is_empty()),
        "scans": evidence.samples.samples.len(),
        "counts_per_unit": per_unit(&evidence.samples),
    })
}

/// One ramp: its branches, its rates, the zero at its beginning less that of the last ramp over the usable taxels, and what the
/// gauge read before it, which is taken off its pressures.
fn ramp(ramp: usize, course: &Course, taxels: &[Examined], evidence: &Evidence) -> Value {
    let (falling, rising): (Vec<usize>, Vec<usize>) = course.scans_of(ramp).partition(|&scan| course.falling[scan]);
    let (first, top, last) = (course.scans_of(ramp).next(), course.top(ramp), course.scans_of(ramp).next_back());
    let kpa = |scan: Option<usize>| scan.map(|scan| course.kpa[scan]);
    let rate = |from: Option<usize>, to: Option<usize>| {
        let (from, to) = (from?, to?);
        let seconds = course.time_s[to] - course.time_s[from];
        (seconds > 0.0).then(|| (course.kpa[to] - course.kpa[from]) / seconds)
    };
    let shifts = || taxels.iter().filter_map(|taxel| taxel.zero_shifts[ramp]);
    json!({
        "ramp": ramp + 1,
        "scans_rising": rising.len(),
        "scans_falling": falling.len(),
        "from_kpa": kpa(first),
        "top_kpa": kpa(top),
        "to_kpa": kpa(last),
        "rise_kpa_per_s": rate(first, top),
        "fall_kpa_per_s": rate(top, last).filter(|_| !falling.is_empty()),
        "zero_mean_counts": mean(shifts()),
        "zero_rms_counts": root_mean_square(shifts()),
        "gauge_zero_kpa": evidence.samples.ramps[ramp].gauge_kpa,
    })
}

/// Every level of both branches that has scans enough: means over all usable taxels and ramps.
fn levels(course: &Course, taxels: &[Examined], errors: &[f64]) -> Vec<Value> {
    let level = |(falling, level): (bool, usize)| {
        let error_kpa = course.mean(errors, falling, level)?;
        let reference_kpa = course.mean(&course.kpa, falling, level)?;
        let own: Vec<f64> = taxels.iter().filter_map(|taxel| course.mean(&taxel.errors, falling, level)).collect();
        Some(json!({
            "branch": if falling { "falling" } else { "rising" },
            "from_kpa": level as f64 * course.level_kpa,
            "to_kpa": (level + 1) as f64 * course.level_kpa,
            "scans": course.scans(falling, level).count(),
            "reference_kpa": reference_kpa,
            "reading_kpa": reference_kpa + error_kpa,
            "error_kpa": error_kpa,
            "spread_kpa": deviation(&own),
        }))
    };
    [false, true].iter().flat_map(|&falling| (0..LEVELS).map(move |level| (falling, level))).filter_map(level).collect()
}

/// The loads that were read with this model set and not replaced by another, oldest first.
fn loads(loads: &[Load], model_set: &str) -> Vec<Value> {
    let replaced = |number: u64| loads.iter().any(|load| load.replaces == number);
    let mut own: Vec<&Load> = loads.iter().filter(|load| load.model_set == model_set && !replaced(load.load)).collect();
    own.sort_by_key(|load| load.load);
    let part = |load: &Load| {
        let scatter_of_mean_n = load.read_scatter_n / f64::from(load.scans.max(1)).sqrt();
        let sigma_n = load.read_sigma_n.hypot(load.force_sigma_n).hypot(scatter_of_mean_n);
        json!({
            "load": load.load,
            "time": load.time.as_ref().map(ToString::to_string).unwrap_or_default(),
            "by": load.by,
            "note": load.note,
            "mass_kg": load.mass_kg,
            "force_n": load.force_n,
            "force_sigma_n": load.force_sigma_n,
            "read_n": load.read_n,
            "read_sigma_n": load.read_sigma_n,
            "read_scatter_n": load.read_scatter_n,
            "scans": load.scans,
            "error_percent": 100.0 * (load.read_n / load.force_n - 1.0),
            "normalised_error": (load.read_n - load.force_n) / (COVERAGE_FACTOR * sigma_n),
        })
    };
    own.into_iter().map(part).collect()
}

/// All of them: the mean error, and how many are within their expanded uncertainty; `None` without any.
fn loads_summary(loads: &[Value]) -> Option<Value> {
    let of = |name: &'static str| loads.iter().filter_map(move |load| load[name].as_f64()).map(f64::abs);
    (!loads.is_empty()).then(|| {
        json!({
            "loads": loads.len(),
            "mean_absolute_error_percent": mean(of("error_percent")),
            "within": of("normalised_error").filter(|error| *error <= 1.0).count(),
        })
    })
}

/// Taxels without a usable model.
fn excluded(evidence: &Evidence) -> Vec<Value> {
    let unusable = evidence.set.taxels.iter().enumerate().filter(|(_, model)| !model.is_usable());
    let part = |(taxel, model): (usize, &taxel_model::TaxelModel)| json!({ "taxel": taxel, "status": model.status.code(), "reason": model.status.to_string() });
    unusable.map(part).collect()
}

/// Limits of use: what the certificate does not show, in words.
fn limits(evidence: &Evidence, usable: usize) -> Vec<String> {
    let Evidence { stated, samples, set, .. } = evidence;
    let (taxels, excluded) = (set.taxels.len(), set.taxels.len() - usable);
    let mut lines = Vec::new();
    let mut say = |holds: bool, line: &str| lines.extend(holds.then(|| line.to_owned()));
    say(evidence.simulated, "Simulated or replayed: no skin was measured, and nothing is certified.");
    say(true, "Pressure along the normals of the skin, slowly changing. Shear was not measured.");
    let range = format!("Up to {:.1} kPa, and for each taxel within its own range of counts.", set.pressure_max_kpa);
    say(true, &format!("{range} A reading beyond it is not certified."));
    say(true, "The bag presses on all taxels alike. Only known loads show how well a force on a small area is read.");
    let percent = 100.0 * excluded as f64 / taxels as f64;
    let without = format!("{excluded} of {taxels} taxels ({percent:.1} %) have no model and read nothing.");
    say(excluded > 0, &without);
    let rising = evidence.branches == Branch::Rising;
    say(rising, "Rising pressure only: the hysteresis was not measured and is not in the uncertainties.");
    let single = samples.ramps.len() < 2;
    say(single, "A single ramp: repeatability and shift of the zero are unknown and not in the uncertainties.");
    let compensated = (0..taxels).any(|taxel| set.plays(taxel).is_some());
    say(compensated, "In use the hysteresis is compensated. The uncertainties are those without, which are greater.");
    let traceable = stated.traceability.is_some() && stated.reference_certificate.is_some();
    say(!traceable, "Traceability of the reference sensor is not stated: the pressures are traceable to nothing.");
    let of_zero_kpa = samples.gauge_zero_sigma_kpa(set) * (1.0 + ROUNDING);
    let in_set = set.gauge_gain_rel > 0.0 || set.gauge_offset_kpa > of_zero_kpa;
    let known = in_set || stated.reference_expanded_uncertainty_kpa.is_some();
    say(!known, "The uncertainty of the reference sensor is not stated and counts as 0.");
    say(stated.temperature_c.is_none(), "The temperature during the calibration is not stated.");
    let Some(session) = &evidence.session else { return lines };
    let other = format!(
        "Session {} has another model set of its own now ({}): this one was fitted with other options or before the last \
         ramp. All figures are over all scans that the session holds now.",
        session.session, session.model_set
    );
    say(session.model_set != set.id, &other);
    let state = session.state();
    let name = state.as_str_name().trim_start_matches("SESSION_STATE_");
    say(
        matches!(state, SessionState::Discarded | SessionState::Aborted | SessionState::Failed),
        &format!("The session is {name}: its models were not accepted by the operator."),
    );
    lines
}

/// The hash of a text in hexadecimal digits.
fn sha256(text: &str) -> String {
    Sha256::digest(text.as_bytes()).as_slice().iter().map(|byte| format!("{byte:02x}")).collect()
}
