//! From evidence to certificate.

use std::time::{Duration, UNIX_EPOCH};

use anyhow::ensure;
use sha2::{Digest, Sha256};
use taxel_engine::calibration::Branch;
use taxel_model::TaxelModel;
use taxel_proto::Timestamp;

use super::budget;
use super::course::Course;
use super::document::{Certificate, ExcludedPart, Expanded, Hashes, MeanPart, SessionPart, SetPart, TaxelPart};
use super::evidence::Evidence;
use super::figures::Figures;
use super::levels::{levels, ramps};
use super::limits::limits;
use super::loads;
use super::taxel::{Examined, examine, per_unit};

/// The word by which a file of this kind is known, and its version.
const FORMAT: (&str, u32) = ("taxel-certificate", 1);

/// What makes certificates, as the certificate names it.
const SOFTWARE: &str = concat!("taxel-lab ", env!("CARGO_PKG_VERSION"));

/// So many digits of the hash make the number.
const NUMBER_DIGITS: usize = 16;

impl Certificate {
    /// Works out the certificate.
    ///
    /// # Errors
    /// No taxel is usable.
    pub fn of(evidence: &Evidence) -> anyhow::Result<Self> {
        let Evidence { set, samples, stated, .. } = evidence;
        let course = Course::of(samples, evidence.branches, set.pressure_max_kpa);
        let examined = |taxel: usize| examine(taxel, set.taxels.get(taxel)?, samples, &course);
        let taxels: Vec<Examined> = (0..set.taxels.len()).filter_map(examined).collect();
        ensure!(!taxels.is_empty(), "{} has no usable taxel", set.id);
        let figures = mean_of(&taxels, &course);
        let mean = MeanPart {
            rmse_kpa: figures.rmse_kpa,
            bias_kpa: figures.bias_kpa,
            max_error_kpa: figures.max_kpa,
            hysteresis_kpa: figures.hysteresis_kpa,
            repeatability_kpa: figures.repeatability_kpa,
            zero_shift_kpa: budget::zero_shift_of_mean_kpa(&taxels),
        };
        let stated_kpa = stated.reference_expanded_uncertainty_kpa;
        let reference_kpa = budget::reference_kpa(set, stated_kpa, samples.gauge_zero_doubt_kpa(set));
        let rows = budget::rows(&taxels, &mean, reference_kpa, per_unit(samples));
        let expanded = Expanded {
            coverage_factor: budget::COVERAGE_FACTOR,
            taxel_kpa: budget::expanded(&rows, |row| row.taxel_kpa),
            mean_kpa: budget::expanded(&rows, |row| row.mean_kpa),
        };
        let (levels, ramps) = (levels(&course, &taxels, &figures), ramps(&course, &taxels, samples));
        let loads = loads::parts(&evidence.loads, &set.id);
        let finished = |taxel: Examined| {
            let expanded_uncertainty_kpa = budget::expanded_of_taxel(&taxel, reference_kpa);
            TaxelPart { expanded_uncertainty_kpa, ..taxel.part }
        };
        let part = set_part(evidence, taxels.len());
        let mut certificate = Self {
            format: FORMAT.0,
            version: FORMAT.1,
            number: String::new(),
            software: SOFTWARE.to_owned(),
            simulated: evidence.simulated,
            stated: stated.clone(),
            session: session_part(evidence),
            hashes: Hashes { samples_csv: sha256(&evidence.samples_csv), models_json: sha256(&evidence.models_json) },
            limits: limits(evidence, &part, ramps.len()),
            set: part,
            ramps,
            levels,
            mean,
            budget: rows,
            expanded,
            loads_summary: loads::summary(&loads),
            loads,
            taxels: taxels.into_iter().map(finished).collect(),
            excluded: excluded(&set.taxels),
        };
        let hash = sha256(&certificate.to_json()?);
        certificate.number = format!("c-{}", &hash[..NUMBER_DIGITS]);
        Ok(certificate)
    }

    /// Its number: the beginning of the hash of its JSON without the number.
    #[must_use]
    pub fn number(&self) -> &str {
        &self.number
    }

    /// The certificate as JSON, a field a line.
    ///
    /// # Errors
    /// What of it JSON cannot hold.
    pub fn to_json(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// The figures of the mean reading of all usable taxels.
fn mean_of(taxels: &[Examined], course: &Course) -> Figures {
    let mut errors = vec![0.0; course.kpa.len()];
    for taxel in taxels {
        errors.iter_mut().zip(&taxel.errors).for_each(|(sum, error)| *sum += error);
    }
    errors.iter_mut().for_each(|sum| *sum /= taxels.len() as f64);
    Figures::of(&errors, course)
}

fn set_part(evidence: &Evidence, usable: usize) -> SetPart {
    let set = &evidence.set;
    let made = UNIX_EPOCH + Duration::from_nanos(u64::try_from(set.created_wall_ns).unwrap_or(0));
    SetPart {
        id: set.id.clone(),
        patch: set.patch.clone(),
        made: Timestamp::from(made).to_string(),
        method: set.method.clone(),
        fitted_by: Some(set.maker.software.clone()).filter(|name| !name.is_empty()),
        board_settings: set.board_settings.clone(),
        taxels: set.taxels.len(),
        usable,
        pressure_max_kpa: set.pressure_max_kpa,
        gauge_gain_rel: set.gauge_gain_rel,
        gauge_offset_kpa: set.gauge_offset_kpa,
    }
}

fn session_part(evidence: &Evidence) -> SessionPart {
    let session = evidence.session.as_ref();
    SessionPart {
        number: evidence.number,
        started: session.and_then(|session| session.started.as_ref()).map(ToString::to_string),
        branches: match evidence.branches {
            Branch::Rising => "rising",
            Branch::Both => "both",
        },
        target_kpa: session.map(|session| session.target_kpa),
        rest_confirmed_by: session.map(|session| session.confirmed_by.clone()).filter(|by| !by.is_empty()),
        scans: evidence.samples.samples.len(),
        refused: session.map(|session| session.refused.clone()).unwrap_or_default(),
        counts_per_unit: per_unit(&evidence.samples),
    }
}

fn excluded(models: &[TaxelModel]) -> Vec<ExcludedPart> {
    let unusable = models.iter().enumerate().filter(|(_, model)| !model.is_usable());
    let part = |(taxel, model): (usize, &TaxelModel)| ExcludedPart {
        taxel,
        status: model.status.code(),
        reason: model.status.to_string(),
    };
    unusable.map(part).collect()
}

/// The hash of a text in hexadecimal digits.
fn sha256(text: &str) -> String {
    Sha256::digest(text.as_bytes()).as_slice().iter().map(|byte| format!("{byte:02x}")).collect()
}
