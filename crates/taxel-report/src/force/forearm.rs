//! Simulated forearms with everything that the simulator knows to be in the way, and known masses on them.

use std::sync::Arc;

use anyhow::Context as _;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{Outputs, PatchPlan};
use taxel_model::Sign;
use taxel_sim::Effect;
use taxel_skin::area;

use super::recipe::{Beyond, Outcome, Recipe, Recording, Source, end_of, scan_us};
use crate::numbers::mean;
use crate::rig::fits::{Live, forces};
use crate::rig::{Forearm, PERIOD, Scan, Weighed};

/// Skins: quick and full.
const SKINS: [u64; 2] = [1, 10];

/// The bag's highest pressure, and how fast it rises and falls.
const TARGET_KPA: f64 = 70.0;
const KPA_PER_S: f64 = 1.0;

/// What a mass of 0.4 kg presses with on 600 mm2.
const LOW_KPA: f64 = 6.5;

/// The smallest of the masses, where biases show, kg.
const LIGHT_KG: f64 = 0.2;

/// Calibrates and weighs.
///
/// # Errors
/// A simulation that cannot be set up.
pub fn measure(seed: u64, quick: bool) -> anyhow::Result<Source> {
    let (skins, repetitions) = (SKINS[usize::from(!quick)], if quick { 1 } else { 5 });
    let tried = (0..skins).map(|skin| Tried::new(seed.wrapping_add(skin), skin as usize));
    let tried = tried.collect::<anyhow::Result<Vec<Tried>>>()?;
    let outcomes = Recipe::all().into_iter().map(|recipe| outcome(&recipe, &tried, repetitions));
    Ok(Source {
        id: "forearm",
        skin: "simulated forearms of 230 taxels",
        caption: format!(
            "Calibrated in the bag to {TARGET_KPA} kPa and back (the low range: to {LOW_KPA} kPa), judged by masses of 0.2 to 1 \
             kg on 600 mm2 at places all over {skins} skins with all effects of the simulator."
        ),
        exams: vec!["masses", "0.2 kg, bias"],
        // `taxeld demo` judges what was promised for masses, by the whole procedure.
        promised_percent: Vec::new(),
        outcomes: outcomes.collect::<anyhow::Result<_>>()?,
    })
}

/// What a recipe comes to. What it costs is that of the first skin: all cost the same.
fn outcome(recipe: &Recipe, tried: &[Tried], repetitions: usize) -> anyhow::Result<Outcome> {
    let (mut percent, mut light_percent, mut first) = (Vec::new(), Vec::new(), None);
    for tried in tried {
        let (outcome, errors) = tried.weigh(recipe, if first.is_none() { repetitions } else { 1 })?;
        first.get_or_insert(outcome);
        percent.extend(errors.iter().map(|(_, error)| 100.0 * error.abs()));
        light_percent.extend(errors.iter().filter(|(kg, _)| *kg == LIGHT_KG).map(|(_, error)| 100.0 * error));
    }
    let force_percent = [percent, light_percent].map(|percent| mean(percent.into_iter())).to_vec();
    Ok(Outcome { force_percent, ..first.context("no skin was tried")? })
}

/// A skin that was in the bag and under masses.
struct Tried {
    calibration: Recording,
    /// With everything, and as the paper has it.
    plans: [PatchPlan; 2],
    rest: Vec<taxel_engine::baseline::TaxelBaseline>,
    weighings: Vec<Weighed>,
}

impl Tried {
    fn new(seed: u64, skin: usize) -> anyhow::Result<Self> {
        let mut forearm = Forearm::with(&Effect::ALL, seed)?;
        let mut plan = forearm.plan()?;
        let equal = PatchPlan { geometry: None, outputs: Outputs::default(), ..plan.clone() };
        plan.areas = area::template(&plan.patch, plan.areas[0]);
        let scans = forearm.cycle(TARGET_KPA, KPA_PER_S);
        forearm.vent();
        let rest = forearm.rest();
        let weighings = forearm.weigh_all(skin)?;
        Ok(Self { calibration: recording(&scans), plans: [plan, equal], rest, weighings })
    }

    /// What a recipe costs on this skin, and by weighing the mass in kg and force over weight less 1.
    fn weigh(&self, recipe: &Recipe, repetitions: usize) -> anyhow::Result<(Outcome, Vec<(f64, f64)>)> {
        let (set, fit_ms, scans) = self.calibration.fit(recipe, repetitions)?;
        let plan = &self.plans[usize::from(recipe.is_paper())];
        let held = (recipe.low == Some(Beyond::Held)).then(|| self.held(&set));
        let weighings = held.as_deref().unwrap_or(&self.weighings);
        let mut live = Live::new(Arc::clone(&set), plan, &self.rest);
        let all: Vec<Vec<u8>> = weighings.iter().flat_map(|one| &one.scans).map(|scan| scan.counts.clone()).collect();
        let scan_us = scan_us(&all, repetitions, |counts| live.read(counts));
        let usable = set.taxels.iter().filter(|model| model.is_usable()).count();
        let read = forces(ModelSet::clone(&set), plan, &self.rest, weighings);
        let errors = read.into_iter().zip(weighings).map(|(n, one)| (one.kilogram, n / one.true_n - 1.0)).collect();
        Ok((Outcome { scans, usable, fit_ms, scan_us, force_percent: Vec::new() }, errors))
    }

    /// The weighings with counts that never go beyond what was calibrated.
    fn held(&self, set: &ModelSet) -> Vec<Weighed> {
        let ends: Vec<Option<f64>> = (0..set.taxels.len())
            .map(|taxel| Some(end_of(&set.taxels[taxel])?.0 - set.baseline[taxel].mean + self.rest[taxel].mean))
            .collect();
        let held = |scan: &Scan| {
            let count = |(taxel, &count): (usize, &u8)| match (ends[taxel], set.taxels[taxel].sign) {
                (Some(end), Sign::Falling) => count.max(end.ceil() as u8),
                (Some(end), Sign::Rising) => count.min(end.floor() as u8),
                (None, _) => count,
            };
            Scan { counts: scan.counts.iter().enumerate().map(count).collect(), ..scan.clone() }
        };
        let all = |scans: &[Scan]| scans.iter().map(held).collect();
        let one = |one: &Weighed| Weighed {
            before: all(&one.before),
            scans: all(&one.scans),
            after: all(&one.after),
            ..*one
        };
        self.weighings.iter().map(one).collect()
    }
}

/// The scans with the mean of what the gauge said when the boards sent.
fn recording(scans: &[Scan]) -> Recording {
    let taxels = scans.first().map_or(0, |scan| scan.counts.len());
    Recording {
        time_s: (0..scans.len()).map(|i| i as f64 * PERIOD.as_secs_f64()).collect(),
        pressure_kpa: scans.iter().map(|scan| mean(scan.gauge_kpa.iter().copied())).collect(),
        counts: (0..taxels).map(|taxel| scans.iter().map(|scan| f64::from(scan.counts[taxel])).collect()).collect(),
        low_kpa: LOW_KPA,
    }
}
