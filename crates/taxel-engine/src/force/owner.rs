//! The force of one patch: the models in use, their tables at the present zero, and what they make of a scan.
//!
//! Order of calls: [`Force::set_models`] and [`Force::set_zero`] whenever these change, [`Force::follow`] and then
//! [`Force::sample`] for each scan.

mod bound;
mod shortcomings;

use std::sync::Arc;
use taxel_skin::{CountRange, Newton};

use self::bound::{Bound, HeldBound};
use crate::baseline::{Activation, TaxelBaseline};
use crate::force::evaluator::Evaluator;
use crate::force::hysteresis::Hysteresis;
use crate::force::lately::Lately;
use crate::force::measure::{Coverage, ForceModel, Layout, Present};
use crate::force::offsets::Offsets;
use crate::force::reason::{Reason, ReasonCode, positions};
use crate::force::remainder::{FLOOR_SIGMAS, Remainder, Rest, newton_per_count};
use crate::force::sample::{ForceSample, ForceState};
use crate::force::tables::Tables;
use crate::force::touch::{Hiding, Touch};
use crate::model_set::ModelSet;
use crate::scan::Scan;

/// Why there is no force without models.
const NO_MODELS: &str = "no model set is active";

/// What is said while the models in use say nothing of the skin at rest.
const NO_REST: &str = "the model set has no zero of its own and takes it from the next confirmed tare: unload the skin, then \
                       taxeld tare --confirmed-by NAME";

/// What the force needs to know of a patch.
#[derive(Clone, Debug)]
pub struct ForcePlan {
    /// Areas, geometry and outputs.
    pub layout: Layout,
    /// The range of the raw counts.
    pub counts: CountRange,
    /// When a taxel counts as touched.
    pub activation: Activation,
    /// Above this share of silent taxels there is no force at all.
    pub stale_share_max: f64,
}

/// What the zero says of itself to the force.
#[derive(Clone, Debug, Default)]
pub struct ZeroState {
    /// Why there is none, if there is none.
    pub lacks: Option<Reason>,
    /// Standard uncertainty that all taxels share, counts.
    pub sigma_counts: f64,
    /// How much of a load that lies on everything it may have taken in since it was taken.
    pub absorbed: Newton,
    /// What keeps a force at it from being a good one.
    pub shortcoming: Option<Reason>,
    /// That a load has just vanished from a whole board at once, if one has.
    pub load_vanished: Option<Reason>,
}

/// The tables of the models at the present zero, and what hysteresis adds to each taxel, where it is compensated.
pub type SharedTables = (Arc<Tables>, Option<Offsets>);

/// A sample, and the taxels whose force is in its total, ascending.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// What readers see.
    pub sample: ForceSample,
    /// Taxels in the total, ascending.
    pub active: Box<[u16]>,
    /// A total above this is there, whatever the zero may hide beside.
    pub told: Newton,
    /// The detection floor without what may lie on excluded taxels: what grows while a zero is worn.
    pub worn: Newton,
}

/// The force of one patch.
#[derive(Debug)]
pub struct Force {
    plan: ForcePlan,
    model: ForceModel,
    set: Option<Arc<ModelSet>>,
    /// The id of `set`, as samples carry it.
    id: Option<Arc<str>>,
    /// Why there is none, if there is none.
    lacks_models: Reason,
    /// The zero that the tables are for, if one holds.
    zero: Option<Vec<TaxelBaseline>>,
    /// The same without what it has followed of the temperature since it was taken; empty without a zero.
    taken: Vec<TaxelBaseline>,
    /// The zero that somebody vouched for, if there is one with the zeros that the boards have.
    vouched: Option<Arc<[TaxelBaseline]>>,
    /// How far it lies towards load from that of the models, as far as that may be what the skin remembers, counts.
    residue_counts: f64,
    evaluator: Option<Evaluator>,
    /// Hysteresis of the active model set at the present zero, where it is compensated.
    hysteresis: Option<Hysteresis>,
    /// Soundness of the scan that it followed last.
    followed: Option<u64>,
    remainder: Remainder,
    /// What it read in the scans before.
    lately: Lately,
    coverage: Coverage,
    /// Soundness of the scan that the selection was last made for.
    selected_for: Option<u64>,
    /// Taxels of modules that are heard, with a usable model and a fault.
    faulty: Vec<usize>,
    /// Taxels of modules that are heard with a usable model and no zero: they had a fault or moved when it was taken.
    without_zero: Arc<[u16]>,
    /// Those of them that have no fault, each with its zero in the models and the way that load moves it.
    live_without_zero: Vec<(u16, f64, f64)>,
    /// The same of those that have one.
    faulty_without_zero: Vec<(u16, f64, f64)>,
    /// What makes the total a lower bound now or did so a moment ago.
    bound: HeldBound,
    /// Taxels that [`Coverage::blind`] counts.
    blind: Arc<[u16]>,
    /// How many taxels are selected.
    usable: usize,
    /// The others, ascending.
    excluded: Vec<usize>,
    touch: Touch,
}

impl Force {
    /// Without models there is no force.
    #[must_use]
    pub fn new(plan: ForcePlan) -> Self {
        Self {
            model: ForceModel::new(&plan.layout),
            plan,
            set: None,
            id: None,
            lacks_models: Reason::new(ReasonCode::NoModelSet, NO_MODELS),
            zero: None,
            taken: Vec::new(),
            vouched: None,
            residue_counts: 0.0,
            evaluator: None,
            hysteresis: None,
            followed: None,
            remainder: Remainder::default(),
            lately: Lately::default(),
            coverage: Coverage { uncovered_share: 1.0, blind: 0 },
            selected_for: None,
            faulty: Vec::new(),
            without_zero: Arc::default(),
            live_without_zero: Vec::new(),
            faulty_without_zero: Vec::new(),
            bound: HeldBound::default(),
            blind: Arc::default(),
            usable: 0,
            excluded: Vec::new(),
            touch: Touch::default(),
        }
    }

    /// The model set in use.
    #[must_use]
    pub const fn models(&self) -> Option<&Arc<ModelSet>> {
        self.set.as_ref()
    }

    /// Whether there are models and a zero.
    #[must_use]
    pub const fn is_ready(&self) -> bool {
        self.evaluator.is_some()
    }

    /// Another model set is in use from now on. How the load came that lies on the skin, its plays have not seen.
    /// `residue_counts` as [`Tables::with_residue`] has it, of the zero that holds.
    pub fn set_models(&mut self, set: Arc<ModelSet>, residue_counts: f64) {
        self.residue_counts = residue_counts;
        self.id = Some(Arc::from(set.id.as_str()));
        self.set = Some(set);
        self.begin(Hysteresis::unknown);
    }

    /// There is a set, and it is not used; why.
    pub fn refuse_models(&mut self, why: &str) {
        self.lacks_models = Reason::new(ReasonCode::NoModelSet, format!("{NO_MODELS}: {why}"));
    }

    /// Another zero was taken, or it was lost: histories begin anew, at rest. `residue_counts` as [`Tables::with_residue`] has it.
    pub fn set_zero(&mut self, zero: Option<&[TaxelBaseline]>, residue_counts: f64) {
        (self.zero, self.residue_counts) = (zero.map(<[TaxelBaseline]>::to_vec), residue_counts);
        self.taken = self.zero.clone().unwrap_or_default();
        self.begin(Hysteresis::new);
    }

    /// A zero that somebody confirmed since the boards took theirs.
    pub fn set_vouched(&mut self, vouched: Option<&Arc<[TaxelBaseline]>>) {
        self.vouched = vouched.cloned();
        self.selected_for = None;
    }

    /// The zero holds no more for now, or holds again, or has followed the temperature: histories go on. `taken` is the same
    /// zero without what it has followed.
    pub fn move_zero(&mut self, zero: Option<&[TaxelBaseline]>, taken: Option<Vec<TaxelBaseline>>) {
        self.zero = zero.map(<[TaxelBaseline]>::to_vec);
        self.taken = taken.unwrap_or_default();
        if let Some(zero) = &self.zero {
            match &mut self.hysteresis {
                Some(hysteresis) => hysteresis.shift_zero(zero),
                // The models came while there was no zero.
                None => self.hysteresis = self.set.as_ref().and_then(|set| Hysteresis::unknown(set, zero)),
            }
        }
        self.tabulate();
    }

    fn begin(&mut self, plays: fn(&Arc<ModelSet>, &[TaxelBaseline]) -> Option<Hysteresis>) {
        self.followed = None;
        (self.lately, self.bound) = (Lately::default(), HeldBound::default());
        self.hysteresis = self.set.as_ref().zip(self.zero.as_ref()).and_then(|(set, zero)| plays(set, zero));
        self.tabulate();
    }

    fn tabulate(&mut self) {
        self.evaluator = match (&self.set, &self.zero) {
            (Some(set), Some(zero)) => {
                let (areas, activation) = (&self.plan.layout.areas, self.plan.activation);
                let set = Arc::clone(set);
                let (range, residue_counts) = (self.plan.counts, self.residue_counts);
                Some(Evaluator::of(Tables::of_range(range, set, zero, areas, activation, residue_counts)))
            }
            _ => None,
        };
        if let (Some(hysteresis), Some(evaluator)) = (&self.hysteresis, &mut self.evaluator) {
            evaluator.set_hysteresis(Some(hysteresis.offsets()));
        }
        self.selected_for = None;
    }

    /// The play operators of sound taxels follow the scan. While the zero is in doubt they follow by the one that held
    /// before: if it holds again they have missed nothing, and another one begins them anew.
    pub fn follow(&mut self, scan: &Scan<'_>) {
        let Some(hysteresis) = &mut self.hysteresis else { return };
        if self.followed.replace(scan.soundness).is_some_and(|before| before != scan.soundness) {
            hysteresis.on_soundness(scan.time, |taxel| scan.sound[taxel]);
        }
        hysteresis.follow(scan.time, scan.counts, |taxel| scan.sound[taxel]);
        if let Some(evaluator) = &mut self.evaluator {
            evaluator.set_hysteresis(Some(hysteresis.offsets()));
        }
    }

    /// Keeps taxels that are not sound out of the sum; done anew only when that changed.
    fn select(&mut self, scan: &Scan<'_>) {
        let Some(evaluator) = &mut self.evaluator else {
            self.coverage = Coverage { uncovered_share: 1.0, blind: 0 };
            return;
        };
        if self.selected_for == Some(scan.soundness) {
            return;
        }
        self.selected_for = Some(scan.soundness);
        evaluator.select(|taxel| scan.sound[taxel]);
        let (coverage, blind) = self.model.coverage(evaluator.selection());
        (self.coverage, self.blind) = (coverage, blind.into());
        self.usable = evaluator.selected().count();
        self.excluded = (0..scan.sound.len()).filter(|&taxel| !evaluator.selection()[taxel]).collect();
        let tables = evaluator.tables();
        let heard = self.plan.layout.modules.iter().zip(scan.silent).filter(|(_, silent)| !**silent);
        let heard = heard.flat_map(|(taxels, _)| taxels.clone());
        self.faulty = heard.clone().filter(|&t| tables.has(t) && !scan.sound[t]).collect();
        let without_zero = heard.filter(|&t| tables.set().taxels[t].is_usable() && !tables.has(t));
        self.without_zero = positions(without_zero).into();
        let set = tables.set();
        let to_compare = |&taxel: &u16| {
            let place = usize::from(taxel);
            (taxel, set.baseline[place].mean, set.taxels[place].sign.as_f64())
        };
        let compared = self.without_zero.iter().map(to_compare);
        (self.live_without_zero, self.faulty_without_zero) =
            compared.partition(|&(taxel, ..)| scan.sound[usize::from(taxel)]);
        if let Some(zero) = &self.zero {
            let (activation, modules) = (self.plan.activation, &self.plan.layout.modules);
            let zero = Rest { zero, taken: &self.taken, vouched: self.vouched.as_deref().unwrap_or_default() };
            let relative_sigma = tables.set().gauge_gain_rel.hypot(self.plan.layout.area_uncertainty);
            let selected = evaluator.selection();
            self.remainder = Remainder::new(tables, zero, activation, selected, modules, relative_sigma);
        }
    }

    /// The force of a scan, its state and the reasons for it. `silent` is how many taxels are silent.
    pub fn sample(&mut self, scan: &Scan<'_>, silent: usize, zero: &ZeroState) -> Measured {
        self.select(scan);
        let taxels = scan.counts.len();
        if self.set.is_none() {
            return self.nothing(ForceState::Uncalibrated, self.lacks_models.clone(), silent, taxels);
        }
        if silent as f64 > self.plan.stale_share_max * taxels as f64 {
            let text = format!("{silent} of {taxels} taxels are silent");
            let why = Reason::about(self.silent(scan), ReasonCode::TaxelsSilent, text);
            return self.nothing(ForceState::Stale, why, silent, taxels);
        }
        if self.set.as_ref().is_some_and(|set| !set.knows_rest()) {
            let why = Reason::new(ReasonCode::RestNotProven, NO_REST);
            return self.nothing(ForceState::TareInvalid, why, silent, taxels);
        }
        if let Some(why) = &zero.lacks {
            return self.nothing(ForceState::TareInvalid, why.clone(), silent, taxels);
        }
        let Some(evaluator) = &self.evaluator else {
            let why = Reason::new(ReasonCode::ZeroNotTaken, "no zero has been taken yet");
            return self.nothing(ForceState::TareInvalid, why, silent, taxels);
        };
        if self.usable == 0 {
            let why = Reason::new(ReasonCode::NoUsableTaxel, "no taxel has a usable model and is free of faults");
            return self.nothing(ForceState::Uncalibrated, why, silent, taxels);
        }
        let mut touch = std::mem::take(&mut self.touch);
        self.model.touch(evaluator, &self.remainder, scan.counts, self.coverage, &mut touch);
        let active = touch.active.iter().map(|&(taxel, _)| taxel);
        let mut unseen = self.remainder.unseen(scan.counts, active, zero.sigma_counts);
        let taken_by_noise = self.lately.at_least(scan.time, unseen.read_n) - unseen.read_n;
        let jumped_n = self.remainder.jumped_n(&self.plan.layout.modules, scan.jumps);
        unseen.floor = Newton(unseen.floor.0 + taken_by_noise + zero.absorbed.0 + jumped_n);
        let worn = unseen.floor;
        // What noise alone activated shows nothing of the taxels beside it.
        let (beside, touched) =
            if unseen.has_contact { (&touch.missing[..], &touch.active[..]) } else { Default::default() };
        let hiding = Hiding { excluded: &self.excluded, beside, touched };
        unseen.floor = self.model.untouched_floor(evaluator, &self.remainder, scan.counts, hiding, unseen.floor);
        // Where the untouched taxels lie away from their zero, the touched ones may, too.
        let zero_sigma_counts = zero.sigma_counts.hypot(unseen.offset_counts);
        let present = Present { coverage: self.coverage, zero_sigma_counts, jumps: scan.jumps };
        // What noise alone activated is no contact that others may bear.
        let faulty = if unseen.has_contact { self.faulty_beside(&touch) } else { Vec::new() };
        let in_total = in_order(&touch);
        let mut sample = self.model.measure(evaluator, scan.counts, &mut touch, unseen, present);
        if !is_number(&sample) {
            let text = "the models give a force or an uncertainty that is no finite number: calibrate again";
            let why = Reason::new(ReasonCode::NoUsableTaxel, text);
            return self.nothing(ForceState::Uncalibrated, why, silent, taxels);
        }
        sample.stale = silent as u32;
        sample.excluded = (taxels - self.usable).saturating_sub(silent) as u32;
        let shown = Bound {
            beside: touch.hides_more_than(sample.room_above(FLOOR_SIGMAS)).filter(|_| unseen.has_contact),
            // Told of all, for a tip may press on one taxel alone; it degrades the force beside a contact.
            faulty_is_pressed: self.is_a_faulty_one_pressed(scan).then_some(()),
            loaded: self.loaded_without_zero(scan),
            beyond_range: (sample.out_of_range > 0).then(|| self.out_of_range(scan, &in_total)),
        };
        self.touch = touch;
        let bound = self.bound.with(scan.time, shown);
        sample.lower_bound =
            self.coverage.blind > 0 || bound.is_any() || sample.stale > 0 || zero.load_vanished.is_some();
        sample.reasons = self.shortcomings(scan, sample.stale, faulty, bound, zero);
        sample.state = if sample.reasons.is_empty() { ForceState::Ok } else { ForceState::Degraded };
        Measured { sample, active: in_total, told: unseen.told, worn }
    }

    /// Does what [`Self::sample`] does and forgets what came of it, so that code and tables are in the processor's caches when
    /// the sample is taken. That is the same as without.
    pub fn warm_up(&mut self, scan: &Scan<'_>, silent: usize, zero: &ZeroState) {
        if self.selected_for != Some(scan.soundness) {
            return; // the selection is for the scan to make
        }
        let histories = (self.lately, self.bound.clone());
        std::hint::black_box(self.sample(scan, silent, zero));
        (self.lately, self.bound) = histories;
    }

    fn nothing(&self, state: ForceState, reason: Reason, silent: usize, taxels: usize) -> Measured {
        let sample = ForceSample {
            state,
            reasons: vec![reason],
            stale: silent as u32,
            excluded: taxels as u32,
            uncovered_share: 1.0,
            model_set: self.id.clone(),
            ..ForceSample::default()
        };
        Measured { sample, ..Measured::default() }
    }

    /// How much a count more of each taxel weighs below its threshold, N, negative where counts fall with load; empty
    /// without models or zero.
    #[must_use]
    pub fn newton_per_count(&self) -> Vec<f64> {
        let known = self.evaluator.as_ref().zip(self.zero.as_ref());
        known.map_or_else(Vec::new, |(e, zero)| newton_per_count(e.tables(), zero, self.plan.activation))
    }

    /// The tables at the present zero and what each taxel's history adds, for readers of taxels.
    #[must_use]
    pub fn tables(&self) -> Option<SharedTables> {
        self.evaluator.as_ref().map(|e| (Arc::clone(e.tables()), e.hysteresis().cloned()))
    }
}

/// Whether a force says how much it is, and how far it may be off.
fn is_number(sample: &ForceSample) -> bool {
    [sample.total, sample.total_sigma, sample.detection_floor].iter().all(|n| n.is_some_and(|n| n.0.is_finite()))
}

fn in_order(touch: &Touch) -> Box<[u16]> {
    let mut active: Box<[u16]> = touch.active.iter().filter_map(|&(taxel, _)| u16::try_from(taxel).ok()).collect();
    active.sort_unstable();
    active
}
