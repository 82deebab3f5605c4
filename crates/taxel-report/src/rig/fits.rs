//! Models of a skin from a stretch of scans, and how far they are off on scans that they never saw.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::force::Force;
use taxel_engine::force::owner::ZeroState;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_model::{Accumulator, Estimator, FitOptions, FixedPressure, Order, TaxelModel};
use taxel_skin::Time;
use taxel_store::models_json::content_id;

use crate::numbers::mean;
use crate::rig::{Forearm, Scan, Weighed};

/// Below this pressure a relative error says little, kPa.
const RELATIVE_ABOVE_KPA: f64 = 5.0;

/// One line of a diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recipe {
    /// Which least-squares problem.
    pub estimator: Estimator,
    /// Which order.
    pub order: Order,
}

impl Recipe {
    /// Both estimators, orders 3, 5, 9 and chosen per taxel.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let orders = [Order::Fixed(3), Order::Fixed(5), Order::Fixed(9), Order::Auto];
        let both = [Estimator::PerSample, Estimator::PressureBinned];
        both.into_iter().flat_map(|estimator| orders.map(|order| Self { estimator, order })).collect()
    }

    /// As a legend shows it.
    #[must_use]
    pub fn name(&self) -> String {
        let marked = if self.is_default() { " (shipped default)" } else { "" };
        let estimator = match self.estimator {
            Estimator::PerSample => "per sample",
            Estimator::PressureBinned => "binned",
            Estimator::Paper => "paper",
        };
        match self.order {
            Order::Fixed(order) => format!("{estimator}, order {order}{marked}"),
            Order::Auto => format!("{estimator}, auto{marked}"),
        }
    }

    /// Whether it is what the daemon does by default.
    #[must_use]
    pub fn is_default(&self) -> bool {
        *self == Self { estimator: Estimator::default(), order: Order::default() }
    }

    /// The options of a fit with it.
    #[must_use]
    pub fn options(&self, plan: &PatchPlan) -> FitOptions {
        FitOptions { estimator: self.estimator, order: self.order, ..plan.fit }
    }
}

/// One calibration: what was gathered, and the zero before it.
pub struct Calibration {
    /// The taxels at rest, before the ramp.
    pub rest: Vec<TaxelBaseline>,
    /// Sums per taxel.
    pub sums: Vec<Accumulator>,
    /// How many scans.
    pub scans: usize,
}

impl Calibration {
    /// Gathers scans.
    #[must_use]
    pub fn new<'a>(
        forearm: &Forearm,
        rest: Vec<TaxelBaseline>,
        scans: impl ExactSizeIterator<Item = &'a Scan> + Clone,
    ) -> Self {
        let gather = |taxel: usize| {
            let (board, mut sums) = (forearm.board_of(taxel), Accumulator::new());
            let samples =
                scans.clone().map(|scan| (scan.counts[taxel], FixedPressure::from_kpa(scan.gauge_kpa[board])));
            sums.extend(samples, 0);
            sums
        };
        Self { sums: (0..forearm.taxels()).map(gather).collect(), scans: scans.len(), rest }
    }

    /// Fits every taxel.
    #[must_use]
    pub fn fit(&self, options: &FitOptions) -> Vec<TaxelModel> {
        self.sums.iter().map(|sums| sums.fit(options)).collect()
    }

    /// A model set of them for the patch of `plan`.
    #[must_use]
    pub fn model_set(&self, taxels: Vec<TaxelModel>, plan: &PatchPlan) -> ModelSet {
        let set = ModelSet {
            id: String::new(),
            patch: plan.patch.name().to_owned(),
            created_wall_ns: 0,
            session: None,
            method: String::new(),
            board_settings: Vec::new(),
            baseline: self.rest.clone(),
            pressure_max_kpa: plan.session.target.0,
            gauge_gain_rel: plan.fit.gauge.gain_rel,
            gauge_offset_kpa: plan.fit.gauge.offset_kpa,
            taxels,
            recorded: None,
            recalibrated: None,
            maker: taxel_engine::model_set::Maker::default(),
        };
        ModelSet { id: content_id(&set), ..set }
    }
}

/// What a daemon on the simulated bus of this seed would learn from one ramp.
///
/// # Errors
/// A simulation that cannot be set up.
pub fn calibrate(seed: u64) -> anyhow::Result<Arc<ModelSet>> {
    let mut forearm = Forearm::new(seed)?;
    let (plan, rest) = (forearm.plan()?, forearm.rest());
    let scans = forearm.ramp(70.0, 4.0);
    let calibration = Calibration::new(&forearm, rest, scans.iter());
    Ok(Arc::new(calibration.model_set(calibration.fit(&plan.fit), &plan)))
}

/// What models are judged by.
pub struct Exam {
    /// The zero before the ramp, and the ramp.
    pub ramp: (Vec<TaxelBaseline>, Vec<Scan>),
    /// The zero before the weighings, and what lay on the skin with what was read.
    pub weighings: (Vec<TaxelBaseline>, Vec<Weighed>),
}

/// How far off some models are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    /// Root mean square error of the pressure on the ramp, mean over the usable taxels, kPa.
    pub rmse_kpa: f64,
    /// Mean over the scans of the ramp above 5 kPa of |sum of forces / its truth - 1|, usable taxels, percent.
    pub ramp_force_percent: f64,
    /// Mean over the weighings of |force / weight - 1|, percent.
    pub weight_percent: f64,
    /// Usable taxels.
    pub usable: usize,
}

/// Judges the models of `set`.
#[must_use]
pub fn judge(set: ModelSet, forearm: &Forearm, plan: &PatchPlan, exam: &Exam) -> Score {
    let usable: Vec<usize> = (0..set.taxels.len()).filter(|&taxel| set.taxels[taxel].is_usable()).collect();
    let (rest, scans) = &exam.ramp;
    let mut squares = vec![0.0; usable.len()];
    let mut sums = vec![(0.0, 0.0); scans.len()];
    for (&taxel, squares) in usable.iter().zip(&mut squares) {
        let (model, board) = (&set.taxels[taxel], forearm.board_of(taxel));
        let table = model.tabulate(set.baseline[taxel].mean - rest[taxel].mean);
        for (scan, sums) in scans.iter().zip(&mut sums) {
            let read = f64::from(table.pressure_kpa[usize::from(scan.counts[taxel])]);
            *squares += (read - scan.true_kpa[board]).powi(2);
            *sums = (sums.0 + read, sums.1 + scan.true_kpa[board]);
        }
    }
    let high = sums.iter().filter(|sum| sum.1 > RELATIVE_ABOVE_KPA * usable.len() as f64);
    let (rest, weighings) = &exam.weighings;
    let read = forces(set, plan, rest, weighings).into_iter();
    let errors = read.zip(weighings).map(|(read_n, weighed)| (read_n / weighed.true_n - 1.0).abs());
    Score {
        rmse_kpa: mean(squares.iter().map(|sum| (sum / scans.len() as f64).sqrt())),
        ramp_force_percent: 100.0 * mean(high.map(|(read, truth)| (read / truth - 1.0).abs())),
        weight_percent: 100.0 * mean(errors),
        usable: usable.len(),
    }
}

/// The engine's own force of each weighing at the zero `rest`, N.
#[must_use]
pub fn forces(set: ModelSet, plan: &PatchPlan, rest: &[TaxelBaseline], weighings: &[Weighed]) -> Vec<f64> {
    let mut live = Live::new(Arc::new(set), plan, rest);
    let mut force = |weighed: &Weighed| {
        let mut read = |scans: &[Scan]| mean(scans.iter().map(|scan| live.read(&scan.counts)));
        let _ = read(&weighed.before);
        let force = read(&weighed.scans);
        let _ = read(&weighed.after);
        force
    };
    weighings.iter().map(&mut force).collect()
}

/// The engine's force on bare counts, scan after scan.
pub struct Live {
    force: Force,
    now: Time,
    period: Duration,
    sound: Vec<bool>,
    silent: Vec<bool>,
    pads: Vec<[u8; 2]>,
}

impl Live {
    /// With these models at the zero `rest`.
    #[must_use]
    pub fn new(set: Arc<ModelSet>, plan: &PatchPlan, rest: &[TaxelBaseline]) -> Self {
        let (taxels, modules) = (plan.areas.len(), plan.patch.modules().len());
        let mut force = Force::new(plan.force());
        force.set_models(set, 0.0);
        force.set_zero(Some(rest), 0.0);
        let (now, period) = (Time::default(), plan.period);
        Self {
            force,
            now,
            period,
            sound: vec![true; taxels],
            silent: vec![false; modules],
            pads: vec![[0; 2]; modules],
        }
    }

    /// The force of the next scan, N; NaN if there is none. Hysteresis follows, where it is compensated.
    pub fn read(&mut self, counts: &[u8]) -> f64 {
        let scan = taxel_engine::Scan {
            time: self.now,
            whole: true,
            counts: counts.into(),
            pads: &self.pads,
            silent: &self.silent,
            sound: &self.sound,
            soundness: 0,
            jumps: &[],
        };
        self.now = self.now + self.period;
        self.force.follow(&scan);
        self.force.sample(&scan, 0, &ZeroState::default()).sample.total.map_or(f64::NAN, |total| total.0)
    }
}
