//! The fit over a session's samples: run outside the engine, because it takes a tenth of a second to seconds.
//!
//! Everything comes from the samples, faults too, so that a session gives the same models before and after a restart.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use taxel_model::{OneByOne, TaxelModel};

use crate::baseline::TaxelBaseline;
use crate::calibration::branch::Branch;
use crate::calibration::fit::course::{falling, session_clock};
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::FitRecipe;
use crate::calibration::fit::scans::Scans;
use crate::calibration::fit::skin_fit::{SkinScans, share_gauge};
use crate::calibration::gauge_zero::GaugeZero;
use crate::calibration::plateau::scatter_kpa;
use crate::calibration::samples::{RampBaseline, Sample, SessionSamples};
use crate::model_set::{Maker, ModelSet, Recorded};
use crate::plan::PatchPlan;
use crate::statistics::root_mean_square;

/// Between two ramps a zero that moved by more than this, root mean square in counts, did not return: the boards took a
/// new one. Days move it by 3.
const RETURN_MAX_COUNTS: f64 = 3.0;

/// A fit to be run outside the engine.
#[derive(Clone, Debug, Default)]
pub struct FitJob {
    /// The numbers of all sessions whose samples are fitted, ascending.
    pub sessions: Vec<u64>,
    /// The patch.
    pub patch: String,
    /// When it was asked for, nanoseconds since 1970. A session may ask for another one while the first still runs.
    pub wall_ns: i64,
    /// Board settings in words.
    pub board_settings: Vec<String>,
    /// All that was gathered.
    pub samples: Arc<SessionSamples>,
    /// Whether a simulator or a replayed log sent the samples.
    pub simulated: bool,
    /// Which taxels form each module.
    pub modules: Vec<Range<usize>>,
    /// Modules whose counts are not to be used: positions in `modules`.
    pub left_out: Vec<u16>,
    /// How to fit.
    pub recipe: FitRecipe,
}

/// What a fit came to.
#[derive(Clone, Debug)]
pub struct FitOutcome {
    /// Number of the session.
    pub session: u64,
    /// When the fit was asked for, nanoseconds since 1970.
    pub asked_wall_ns: i64,
    /// The model set, or why there is none.
    pub result: Result<Arc<ModelSet>, String>,
}

/// Below the first samples a reading is a straight line from the zero, and skin is softest there: it reads too much, on all
/// taxels alike.
const BEGINS_MAX_KPA: f64 = 5.0;

/// A curve over a wider gap between two pressures, as a share of the highest, is not that of the skin but of its polynomial.
const GAP_MAX_SHARE: f64 = 0.3;

impl FitJob {
    /// The fit of samples of this patch over these branches.
    pub(crate) fn new(plan: &PatchPlan, branches: Branch, samples: Arc<SessionSamples>) -> Self {
        Self {
            patch: plan.patch.name().to_owned(),
            samples,
            simulated: plan.simulated,
            modules: plan.modules(),
            recipe: plan.recipe(branches),
            ..Self::default()
        }
    }

    /// Fits every taxel. `id_of` makes the id of the finished set from its content.
    #[must_use]
    pub fn run(&self, id_of: impl Fn(&ModelSet) -> String) -> FitOutcome {
        let fit = || {
            self.model_set().map(|mut set| {
                set.id = id_of(&set);
                Arc::new(set)
            })
        };
        // A fault of the fit must end the session with a reason, not leave it waiting for ever.
        let result = catch_unwind(AssertUnwindSafe(fit)).unwrap_or_else(|_| {
            Err("the fit ended with an internal error, which is a fault of this program; the samples are kept"
                .to_owned())
        });
        FitOutcome { session: self.session(), asked_wall_ns: self.wall_ns, result }
    }

    /// Number of the session, of several of the newest.
    #[must_use]
    pub fn session(&self) -> u64 {
        self.sessions.last().copied().unwrap_or_default()
    }

    fn model_set(&self) -> Result<ModelSet, String> {
        let samples = &self.samples.samples;
        let (Some(first), Some(rest)) = (samples.first(), self.samples.rest()) else {
            return Err("no sample was gathered: the pressure never rose while every module was heard".to_owned());
        };
        let mut kpa = self.samples.pressures_kpa();
        let (falling, recipe) = (falling(samples, self.recipe.branch), &self.recipe);
        refuse_gaps(&kpa)?;
        refuse_rise_alone(recipe.branch, &falling)?;
        let taxels = first.counts.counts().len();
        let mut columns: Vec<Vec<f64>> = (0..taxels).map(|taxel| self.column(taxel)).collect();
        let time_s = session_clock(samples, f64::from(recipe.faults.stale_after_s));
        let raw = scans(&time_s, &columns);
        let masks = if recipe.is_paper() {
            kpa.iter_mut().zip(falling).filter(|(_, falls)| *falls).for_each(|(p, _)| *p = f64::NAN);
            Masks::missing(&raw)
        } else {
            Masks::find(&raw, &self.modules, &recipe.faults).without_dropouts(&raw, &OneByOne)
        };
        columns.iter_mut().enumerate().for_each(|(taxel, column)| self.shift_to_last_zero(taxel, column));
        let scans = scans(&time_s, &columns);
        let fit = SkinScans { scans: &scans, masks: &masks, kpa: &kpa, zeros: Some(rest), smooth_s: 0.0 };
        let mut set = fit.fit(recipe, &OneByOne).map_err(|why| why.to_string())?;
        if !set.taxels.iter().any(TaxelModel::is_usable) {
            let why = set.taxels.first().map_or_else(String::new, |model| format!("; taxel 0: {}", model.status));
            let samples = samples.len();
            return Err(format!("none of the {taxels} taxels gives a usable model from {samples} samples{why}"));
        }
        let has_falls = recipe.branch == Branch::Both && !recipe.is_paper();
        let recorded = set.recorded.take().filter(|_| has_falls);
        let zero_return_counts = self.zero_between_ramps(&set.taxels);
        let recorded = recorded.map(|recorded| Recorded { zero_return_counts, ..recorded });
        let falls = if has_falls { ", hysteresis from falling" } else { "" };
        let gauge_zero = GaugeZero::of(&self.samples.ramps);
        // All taxels share what was typed wrong, as they share the gauge.
        share_gauge(&mut set, recipe, &gauge_zero, scatter_kpa(&self.samples));
        Ok(ModelSet {
            patch: self.patch.clone(),
            created_wall_ns: self.wall_ns,
            session: self.sessions.last().copied(),
            method: format!("{}{falls}{}{}", set.method, self.together_in_words(), gauge_zero.in_words()),
            board_settings: self.board_settings.clone(),
            baseline: rest.to_vec(),
            pressure_max_kpa: kpa.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            recorded,
            maker: Maker::this(self.simulated),
            ..set
        })
    }

    /// How far usable taxels rest from where they rested a ramp before, root mean square over all ramps, counts.
    fn zero_between_ramps(&self, models: &[TaxelModel]) -> Option<f64> {
        let pair = |pair: &[RampBaseline]| {
            let usable = (0..models.len()).filter(|&t| models[t].is_usable());
            let moved = usable.filter_map(|t| Some(pair[1].taxels.get(t)?.mean - pair[0].taxels.get(t)?.mean));
            Some(root_mean_square(moved)).filter(|rms| *rms <= RETURN_MAX_COUNTS)
        };
        Some(root_mean_square(self.samples.ramps.windows(2).filter_map(pair))).filter(|rms| rms.is_finite())
    }

    /// One taxel's counts in units; NaN where a sample has none, or a ramp began without a zero of the taxel.
    fn column(&self, taxel: usize) -> Vec<f64> {
        let left_out = |module: &u16| self.modules.get(usize::from(*module)).is_some_and(|m| m.contains(&taxel));
        if self.left_out.iter().any(left_out) {
            return vec![f64::NAN; self.samples.samples.len()];
        }
        let known = |sample: &Sample| self.to_last_zero(taxel, sample.ramp).is_finite();
        let units = |sample: &Sample| sample.counts.counts().units(taxel).filter(|_| known(sample)).unwrap_or(f64::NAN);
        self.samples.samples.iter().map(units).collect()
    }

    /// Each ramp has its own zero: counts are brought to that of the last.
    fn shift_to_last_zero(&self, taxel: usize, column: &mut [f64]) {
        let mut counts = column.iter_mut();
        for ramp in self.samples.samples.chunk_by(|a, b| a.ramp == b.ramp) {
            let shift = self.to_last_zero(taxel, ramp[0].ramp);
            counts.by_ref().take(ramp.len()).for_each(|count| *count += shift);
        }
    }

    /// What brings a taxel's counts from its zero of a ramp to that of the last; NaN where either is not known.
    fn to_last_zero(&self, taxel: usize, ramp: u16) -> f64 {
        let of = |zero: &[TaxelBaseline]| zero.get(taxel).map_or(f64::NAN, |taxel| taxel.mean);
        let last = self.samples.rest().map_or(0.0, of);
        last - self.samples.ramps.iter().find(|r| r.ramp == ramp).map_or(last, |ramp| of(&ramp.taxels))
    }

    fn together_in_words(&self) -> String {
        let numbers: Vec<String> = self.sessions.iter().map(u64::to_string).collect();
        if numbers.len() < 2 { String::new() } else { format!(", of sessions {} together", numbers.join(", ")) }
    }
}

/// Whether the pressures that were gathered lie close enough to draw a curve through.
pub(super) fn refuse_gaps(kpa: &[f64]) -> Result<(), String> {
    let mut sorted = kpa.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (Some(begins_kpa), Some(top_kpa)) = (sorted.first(), sorted.last()) else { return Ok(()) };
    if *begins_kpa > BEGINS_MAX_KPA {
        return Err(format!(
            "nothing was gathered below {begins_kpa:.1} kPa, because the pressure rose too fast or a module was not heard, and \
             of lighter touches nothing would be known: pump slowly from the beginning, so that there are samples below \
             {BEGINS_MAX_KPA} kPa"
        ));
    }
    match sorted.windows(2).find(|pair| pair[1] - pair[0] > GAP_MAX_SHARE * top_kpa) {
        Some(gap) => Err(format!(
            "nothing was gathered between {:.1} and {:.1} kPa, because the pressure rose too fast or a module was not heard: \
             pump slowly all the way, so that no gap is wider than {:.0} % of the {top_kpa:.1} kPa that were reached",
            gap[0],
            gap[1],
            100.0 * GAP_MAX_SHARE
        )),
        None => Ok(()),
    }
}

/// Whether a fit over both branches has both.
fn refuse_rise_alone(branch: Branch, falling: &[bool]) -> Result<(), String> {
    if branch == Branch::Rising || falling.contains(&true) {
        return Ok(());
    }
    let why = "nothing was gathered while the pressure fell, so nothing is known of the hysteresis: let it fall slowly after another \
               ramp, or fit the rising branch alone";
    Err(why.to_owned())
}

fn scans<'a>(time_s: &'a [f64], columns: &'a [Vec<f64>]) -> Scans<'a> {
    Scans { time_s, pressure_kpa: None, counts: columns.iter().map(Vec::as_slice).collect() }
}
