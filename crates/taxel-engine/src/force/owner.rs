//! The force of one patch: the models in use, their tables at the present zero, and what they make of a scan.
//!
//! Order of calls: [`Force::set_models`] and [`Force::set_zero`] whenever these change, [`Force::follow`] and then
//! [`Force::sample`] for each scan.

mod shortcomings;

use std::sync::Arc;
use taxel_skin::{CountRange, Newton};

use crate::baseline::{Activation, TaxelBaseline};
use crate::force::budget::Term;
use crate::force::contacts::ContactIds;
use crate::force::coverage::Watched;
use crate::force::evaluator::Evaluator;
use crate::force::hysteresis::Hysteresis;
use crate::force::measure::{ForceModel, Layout, Present, Touch};
use crate::force::offsets::Offsets;
use crate::force::reason::{Reason, ReasonCode};
use crate::force::sample::{ForceSample, ForceState};
use crate::force::tables::Tables;
use crate::force::unloading::Unloading;
use crate::force::untouched::{Untouched, Zeros};
use crate::model_set::{GAIN_OF_DAY_REL, ModelSet};
use crate::scan::Scan;

/// The offset of untouched taxels is a mean over about so many scans, and what is left of it where it was taken off, counts.
const OFFSET_SCANS: f64 = 8.0;
const OFFSET_LEFT_COUNTS: f64 = 0.06;

/// Why there is no force and no zero without models, and what to do.
const NO_MODELS: &str = "no model set is in use: `taxeld calibrate` takes the zero and makes one";

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
    /// The same that each taxel has of its own, counts.
    pub missed_counts: f64,
    /// What both weigh on the whole skin.
    pub sigma: Newton,
    /// How much of a load that lies on everything it may hide since it was taken.
    pub hides: Newton,
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
}

/// The force of one patch.
#[derive(Debug)]
pub struct Force {
    model: ForceModel,
    counts: CountRange,
    activation: Activation,
    stale_share_max: f64,
    set: Option<Arc<ModelSet>>,
    /// The id of `set`, as samples carry it.
    id: Option<Arc<str>>,
    /// Why there is none, if there is none.
    lacks_models: Reason,
    /// The zero that the tables are for, if one holds.
    zero: Option<Vec<TaxelBaseline>>,
    /// The same without what it has followed of the temperature since it was taken; empty without a zero.
    taken: Vec<TaxelBaseline>,
    /// The zero that somebody confirmed, if there is one with the zeros that the boards have.
    confirmed: Option<Arc<[TaxelBaseline]>>,
    /// How far it lies towards load from that of the models, as far as that may be what the skin remembers, counts.
    residue_counts: f64,
    evaluator: Option<Evaluator>,
    /// Hysteresis of the active model set at the present zero, where it is compensated.
    hysteresis: Option<Hysteresis>,
    /// Soundness of the scan that it followed last.
    followed: Option<u64>,
    untouched: Untouched,
    /// Soundness of the scan that the selection was last made for.
    selected_for: Option<u64>,
    /// Taxels of modules that are heard, with a usable model, that are not selected.
    watched: Vec<Watched>,
    /// Taxels that are neither read nor beside two that are, ascending.
    uncovered: Arc<[u16]>,
    /// How many taxels are selected.
    usable: usize,
    /// The last total, and by how much it jumped at the last change of zero or model set.
    last: Option<Newton>,
    step: Option<Newton>,
    /// The next total is the first at another zero or model set.
    changed: bool,
    unloading: Unloading,
    /// How far the taxels lie from their zero that nothing touches, counts: the mean of the last scans at this zero.
    off_counts: Option<f64>,
    touch: Touch,
    contact_ids: ContactIds,
}

impl Force {
    /// Without models there is no force.
    pub fn new(plan: ForcePlan) -> Self {
        let ForcePlan { layout, counts, activation, stale_share_max } = plan;
        Self {
            model: ForceModel::new(layout),
            counts,
            activation,
            stale_share_max,
            set: None,
            id: None,
            lacks_models: Reason::new(ReasonCode::NoModelSet, NO_MODELS),
            zero: None,
            taken: Vec::new(),
            confirmed: None,
            residue_counts: 0.0,
            evaluator: None,
            hysteresis: None,
            followed: None,
            untouched: Untouched::default(),
            selected_for: None,
            watched: Vec::new(),
            uncovered: Arc::default(),
            usable: 0,
            last: None,
            step: None,
            changed: false,
            unloading: Unloading::UNKNOWN,
            off_counts: None,
            touch: Touch::default(),
            contact_ids: ContactIds::default(),
        }
    }

    /// The model set in use.
    pub const fn models(&self) -> Option<&Arc<ModelSet>> {
        self.set.as_ref()
    }

    /// Whether there are models and a zero.
    pub const fn is_ready(&self) -> bool {
        self.evaluator.is_some()
    }

    /// Another model set is in use from now on. How the load came that lies on the skin, its plays have not seen.
    /// `residue_counts` as `Tables::of_range` has it, of the zero that holds.
    pub fn set_models(&mut self, set: Arc<ModelSet>, residue_counts: f64) {
        self.residue_counts = residue_counts;
        self.id = Some(Arc::from(set.id.as_str()));
        self.set = Some(set);
        self.unloading = Unloading::UNKNOWN;
        self.begin(Hysteresis::unknown);
    }

    /// There is a set, and it is not used; why.
    pub fn refuse_models(&mut self, why: &str) {
        self.lacks_models = Reason::new(ReasonCode::NoModelSet, format!("no model set is in use: {why}"));
    }

    /// Why there are no models in use, if there are none, and what to do.
    pub fn lacks_models(&self) -> Option<&Reason> {
        self.set.is_none().then_some(&self.lacks_models)
    }

    /// Another zero was taken, or it was lost: histories begin anew, at rest. `residue_counts` as `Tables::of_range` has it.
    pub fn set_zero(&mut self, zero: Option<&[TaxelBaseline]>, residue_counts: f64) {
        (self.zero, self.residue_counts) = (zero.map(<[TaxelBaseline]>::to_vec), residue_counts);
        self.taken = self.zero.clone().unwrap_or_default();
        self.unloading = Unloading::default();
        self.begin(Hysteresis::new);
    }

    /// A zero that somebody confirmed since the boards took theirs.
    pub fn set_confirmed(&mut self, confirmed: Option<&Arc<[TaxelBaseline]>>) {
        self.confirmed = confirmed.cloned();
        self.selected_for = None;
    }

    /// The zero holds no more for now, or holds again, or has followed the temperature: histories go on. `taken` is the same
    /// zero without what it has followed.
    pub fn move_zero(
        &mut self,
        zero: Option<&[TaxelBaseline]>,
        taken: Option<Vec<TaxelBaseline>>,
        residue_counts: f64,
    ) {
        self.residue_counts = residue_counts;
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
        (self.followed, self.changed) = (None, true);
        self.hysteresis = self.set.as_ref().zip(self.zero.as_ref()).and_then(|(set, zero)| plays(set, zero));
        self.tabulate();
    }

    fn tabulate(&mut self) {
        self.off_counts = None;
        self.evaluator = match (&self.set, &self.zero) {
            (Some(set), Some(zero)) => {
                let (areas, activation) = (&self.model.layout().areas, self.activation);
                let set = Arc::clone(set);
                let (range, residue_counts) = (self.counts, self.residue_counts);
                Some(Evaluator::of(Tables::of_range(range, set, zero, areas, activation, residue_counts)))
            }
            _ => None,
        };
        self.bend();
        self.selected_for = None;
    }

    /// The play operators of sound taxels follow the scan. While the zero is in check they follow by the one that held
    /// before: if it holds again they have missed nothing, and another one begins them anew.
    pub fn follow(&mut self, scan: &Scan<'_>) {
        let Some(hysteresis) = &mut self.hysteresis else { return };
        if self.followed.replace(scan.soundness).is_some_and(|before| before != scan.soundness) {
            hysteresis.on_soundness(scan.time, |taxel| scan.sound[taxel]);
        }
        hysteresis.follow(scan.time, scan.counts, |taxel| scan.sound[taxel]);
        self.bend();
    }

    /// Hysteresis bends what is read while a load decreases, or within the scans in which that shows: one that is put on reads the curve.
    fn bend(&mut self) {
        let (Some(hysteresis), Some(evaluator)) = (&self.hysteresis, &mut self.evaluator) else { return };
        let offsets = Some(hysteresis.offsets());
        evaluator.set_hysteresis(offsets.filter(|offsets| self.unloading.is_under_way() || !offsets.are_known()));
    }

    /// Keeps taxels that are not sound out of the sum; done anew only when that changed.
    fn select(&mut self, scan: &Scan<'_>) {
        let Some(evaluator) = &mut self.evaluator else { return };
        if self.selected_for == Some(scan.soundness) {
            return;
        }
        self.selected_for = Some(scan.soundness);
        evaluator.select(|taxel| scan.sound[taxel]);
        self.uncovered = self.model.uncovered(evaluator.selection()).into();
        self.usable = evaluator.selected().count();
        let layout = self.model.layout();
        let heard = layout.modules.iter().zip(scan.silent).filter(|(_, silent)| !**silent);
        let unread = heard.flat_map(|(taxels, _)| taxels.clone()).filter(|&taxel| !evaluator.selection()[taxel]);
        let (tables, zero) = (evaluator.tables(), self.zero.as_deref().unwrap_or_default());
        let watched = |taxel| Watched::new(tables, zero, self.activation, taxel, scan.sound[taxel]);
        self.watched = unread.filter_map(watched).collect();
        if self.zero.is_some() {
            let zeros = Zeros { taken: &self.taken, confirmed: self.confirmed.as_deref().unwrap_or_default() };
            let relative_sigma = tables.set().gauge_gain_rel.hypot(layout.area_uncertainty).hypot(GAIN_OF_DAY_REL);
            let selected = evaluator.selection();
            self.untouched = Untouched::new(tables, zeros, selected, &layout.modules, relative_sigma);
        }
    }

    /// The force of a scan, its state and the reasons for it. `silent` is how many taxels are silent.
    pub fn sample(&mut self, scan: &Scan<'_>, silent: usize, zero: &ZeroState) -> Measured {
        self.select(scan);
        let taxels = scan.counts.len();
        if self.set.is_none() {
            return self.nothing(ForceState::Uncalibrated, self.lacks_models.clone(), silent, taxels);
        }
        if silent as f64 > self.stale_share_max * taxels as f64 {
            let text = format!("{silent} of {taxels} taxels are silent");
            let why = Reason::about(self.silent(scan), ReasonCode::TaxelsSilent, text);
            return self.nothing(ForceState::Stale, why, silent, taxels);
        }
        if self.set.as_ref().is_some_and(|set| !set.knows_rest()) {
            let why = Reason::new(ReasonCode::NotUnloaded, NO_REST);
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
        self.model.touch(evaluator, scan.counts, &mut touch);
        let summed = touch.active.iter().map(|(taxel, _)| *taxel).chain(touch.ring.iter().map(|(taxel, _)| *taxel));
        let below = self.untouched.below(scan.counts, summed, [zero.hides.0, zero.sigma.0]);
        let before = self.off_counts.unwrap_or(below.off_counts);
        let off_counts = before + (below.off_counts - before) / OFFSET_SCANS;
        self.off_counts = Some(off_counts);
        // What has become heavier may be load.
        let zero_sigma_counts = zero.sigma_counts.hypot(off_counts.max(OFFSET_LEFT_COUNTS));
        let off_counts = evaluator.tables().offset_of_touched(off_counts.min(0.0));
        let (jumps, gone_n) = (scan.jumps, self.unloading.gone_n());
        let present = Present {
            zero_sigma_counts,
            missed_counts: zero.missed_counts,
            off_counts,
            choice_n: below.choice_n,
            jumps,
            gone_n,
        };
        let in_total = in_order(&touch);
        let mut sample = self.model.measure(evaluator, scan.counts, &mut touch, present);
        self.unloading.follow(sample.total, sample.budget.of(Term::Readings).0);
        self.contact_ids.give(&mut sample.contacts);
        sample.undetected = Some(below.undetected);
        sample.model_set = self.id.clone();
        let (stale, excluded) = (silent as u32, (taxels - self.usable).saturating_sub(silent) as u32);
        (sample.stale, sample.excluded) = (stale, excluded);
        let is_number = sample.most(1.0).is_some_and(|most| most.0.is_finite());
        self.judge(scan, &touch, &in_total, zero, &mut sample);
        self.touch = touch;
        if !is_number {
            let text = "the models give a force or an uncertainty that is no finite number: calibrate again";
            let why = Reason::new(ReasonCode::NoUsableTaxel, text);
            return self.nothing(ForceState::Uncalibrated, why, silent, taxels);
        }
        if std::mem::take(&mut self.changed) {
            self.step = sample.total.zip(self.last).map(|(now, before)| Newton(now.0 - before.0));
        }
        (self.last, sample.step) = (sample.total, self.step);
        Measured { sample, active: in_total }
    }

    fn nothing(&mut self, state: ForceState, reason: Reason, silent: usize, taxels: usize) -> Measured {
        self.last = None;
        self.unloading = Unloading::UNKNOWN;
        let sample = ForceSample {
            state,
            reasons: vec![reason],
            stale: silent as u32,
            excluded: taxels as u32,
            model_set: self.id.clone(),
            ..ForceSample::default()
        };
        Measured { sample, ..Measured::default() }
    }

    /// How much a count more of each taxel weighs below its threshold, N; empty without models or zero.
    pub fn newton_per_count(&self) -> Vec<f64> {
        let tables = self.evaluator.as_ref().map(Evaluator::tables);
        let of = |tables: &Arc<Tables>| {
            let newton = (0..tables.taxels()).map(|taxel| tables.light(taxel).newton_per_count);
            newton.map(|newton| if newton.is_finite() { newton } else { 0.0 }).collect()
        };
        tables.map_or_else(Vec::new, of)
    }

    /// The tables at the present zero and what each taxel's history adds, for readers of taxels.
    pub fn tables(&self) -> Option<SharedTables> {
        self.evaluator.as_ref().map(|e| (Arc::clone(e.tables()), e.hysteresis().cloned()))
    }
}

fn in_order(touch: &Touch) -> Box<[u16]> {
    let mut active: Box<[u16]> = touch.active.iter().filter_map(|&(taxel, _)| u16::try_from(taxel).ok()).collect();
    active.sort_unstable();
    active
}
