//! From evidence to certificate.

use std::collections::BTreeMap;

use taxel_engine::calibration::{Branch, SampleRefusal};
use taxel_engine::model_set::ModelSet;

use crate::budget;
use crate::course::Course;
use crate::document::{Certificate, ExcludedPart, Expanded, Hashes, MeanPart, SessionPart, SetPart, TaxelPart};
use crate::evidence::Evidence;
use crate::figures::Figures;
use crate::levels::{levels, ramps};
use crate::limits::limits;
use crate::loads;
use crate::moment::moment;
use crate::raw::{samples_sha256, sha256};
use crate::taxel::{Examined, examine, per_unit};

/// The word by which a file of this kind is known, and its version.
const FORMAT: (&str, u32) = ("taxeld-certificate", 1);

/// So many digits of the hash make the number.
const NUMBER_DIGITS: usize = 16;

impl Certificate {
    /// Works out the certificate.
    ///
    /// # Errors
    /// Why the set cannot be certified by these samples, in words.
    pub fn of(evidence: &Evidence<'_>) -> Result<Self, String> {
        evidence.check()?;
        let Evidence { set, samples, session, entered, .. } = *evidence;
        let course = Course::of(samples, session.branches, set.pressure_max_kpa);
        let taxels: Vec<Examined> = (0..set.taxels.len()).filter_map(|taxel| one(evidence, taxel, &course)).collect();
        if taxels.is_empty() {
            return Err(format!("{} has no usable taxel", set.id));
        }
        let figures = mean_of(&taxels, &course);
        let mean = MeanPart {
            rmse_kpa: figures.rmse_kpa,
            bias_kpa: figures.bias_kpa,
            max_error_kpa: figures.max_kpa,
            hysteresis_kpa: figures.hysteresis_kpa,
            repeatability_kpa: figures.repeatability_kpa,
            zero_shift_kpa: budget::zero_shift_of_mean_kpa(&taxels),
        };
        let (gain, offset) = (set.gauge_gain_rel, set.gauge_offset_kpa);
        let stated_kpa = entered.reference_expanded_uncertainty_kpa;
        let zero_kpa = samples.gauge_zero_doubt_kpa(set);
        let reference_kpa = budget::reference_kpa(gain, offset, set.pressure_max_kpa, stated_kpa, zero_kpa);
        let rows = budget::rows(&taxels, &mean, reference_kpa, per_unit(samples));
        let expanded = Expanded {
            coverage_factor: budget::COVERAGE_FACTOR,
            taxel_kpa: budget::expanded(&rows, |row| row.taxel_kpa),
            mean_kpa: budget::expanded(&rows, |row| row.mean_kpa),
        };
        let (levels, ramps) = (levels(&course, &taxels, &figures), ramps(&course, &taxels, samples));
        let loads = loads::judged(evidence.loads, &set.id);
        let finished = |taxel: Examined| {
            let expanded_uncertainty_kpa = budget::expanded_of_taxel(&taxel, reference_kpa);
            TaxelPart { expanded_uncertainty_kpa, ..taxel.part }
        };
        let taxels: Vec<TaxelPart> = taxels.into_iter().map(finished).collect();
        let part = set_part(set, taxels.len());
        let mut certificate = Self {
            format: FORMAT.0,
            version: FORMAT.1,
            number: String::new(),
            software: evidence.software.to_owned(),
            simulated: evidence.is_simulated(),
            stated: entered.clone(),
            session: session_part(evidence),
            hashes: Hashes {
                samples_csv: samples_sha256(evidence.about, samples),
                models_json: sha256(evidence.models_json),
            },
            limits: limits(evidence, &part, &taxels, ramps.len()),
            set: part,
            ramps,
            levels,
            mean,
            budget: rows,
            expanded,
            loads: loads.loads.iter().map(loads::part).collect(),
            loads_summary: loads::summary(&loads),
            taxels,
            excluded: excluded(evidence),
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
    pub fn to_json(&self) -> Result<String, String> {
        let mut text = serde_json::to_string_pretty(self).map_err(|error| error.to_string())?;
        text.push('\n');
        Ok(text)
    }
}

fn one(evidence: &Evidence<'_>, taxel: usize, course: &Course) -> Option<Examined> {
    let set = evidence.set;
    let place = evidence.places.get(taxel).cloned().unwrap_or_default();
    let smooth_s = set.recorded.as_ref().map_or(0.0, |recorded| recorded.smooth_s);
    examine(taxel, (set.taxels.get(taxel)?, set.plays(taxel), place), (evidence.samples, course), smooth_s)
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

fn set_part(set: &ModelSet, usable: usize) -> SetPart {
    SetPart {
        id: set.id.clone(),
        patch: set.patch.clone(),
        made: moment(set.created_wall_ns),
        method: set.method.clone(),
        fitted_by: Some(set.maker.software.clone()).filter(|name| !name.is_empty()),
        board_settings: set.board_settings.clone(),
        taxels: set.taxels.len(),
        usable,
        pressure_max_kpa: set.pressure_max_kpa,
        gauge_gain_rel: set.gauge_gain_rel,
        gauge_offset_kpa: set.gauge_offset_kpa,
        smooth_s: set.recorded.as_ref().map_or(0.0, |recorded| recorded.smooth_s),
    }
}

fn session_part(evidence: &Evidence<'_>) -> SessionPart {
    let session = evidence.session;
    let counted = SampleRefusal::ALL.iter().map(|reason| (reason.name(), session.refused.get(*reason)));
    SessionPart {
        number: session.number,
        started: moment(session.started_wall_ns),
        branches: match session.branches {
            Branch::Rising => "rising",
            Branch::Both => "both",
        },
        target_kpa: session.target_kpa,
        rest_confirmed_by: session.confirmed_by.clone(),
        left_out: evidence.left_out.to_vec(),
        scans: evidence.samples.samples.len(),
        refused: counted.filter(|(_, scans)| *scans > 0).collect::<BTreeMap<_, _>>(),
        counts_per_unit: per_unit(evidence.samples),
    }
}

fn excluded(evidence: &Evidence<'_>) -> Vec<ExcludedPart> {
    let unusable = evidence.set.taxels.iter().enumerate().filter(|(_, model)| !model.is_usable());
    let part = |(taxel, model): (usize, &taxel_model::TaxelModel)| ExcludedPart {
        taxel,
        place: evidence.places.get(taxel).cloned().unwrap_or_default(),
        status: model.status.code(),
        reason: model.status.to_string(),
    };
    unusable.map(part).collect()
}
