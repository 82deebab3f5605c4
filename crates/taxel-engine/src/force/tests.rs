//! The force of a patch as a whole: what degrades it, what leaves it without an upper bound, and which taxels are in it; and a
//! small skin for all tests of the force: taxels whose counts fall from 240 by one a kilopascal.

use proptest::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use taxel_model::{FitOptions, GaugeUncertainty, Plays, Samples, Status, TaxelModel, fit};
use taxel_skin::{CountRange, Geometry, Newton, SquareMillimetre, TaxelPose, Time};

use crate::baseline::{Activation, TaxelBaseline};
use crate::force::evaluator::Evaluator;
use crate::force::measure::{Layout, Outputs};
use crate::force::owner::{Force, ForcePlan, Measured, ZeroState};
use crate::force::reason::{Reason, ReasonCode};
use crate::force::sample::ForceState;
use crate::model_set::{ModelSet, Recorded, RecordedTaxel};
use crate::scan::Scan;

mod jumps;

/// Noise must not decide which taxels at the rim of a contact are summed.
#[test]
fn what_lies_beside_a_touch_is_summed_with_its_sign() {
    let total = |before: u16, after: u16| {
        let mut skin = Skin::new(Some(row(TAXELS))).press(24..25, 30);
        (skin.counts[23], skin.counts[25]) = (before, after);
        skin.measured().sample.total.unwrap().0
    };
    let alone = total(REST, REST);
    assert!(
        (total(REST + 1, REST - 1) - alone).abs() < 1e-6,
        "as much too little on one side as too much on the other"
    );
    assert!((total(REST - 1, REST - 1) - alone - 0.2).abs() < 0.03, "a count of a taxel weighs 0.1 N");
    assert!((total(REST, REST) - total(REST + 1, REST + 1) - 0.2).abs() < 0.03);
}

/// What has become lighter bears no load: all of the skin has. What has become heavier may.
#[test]
fn a_force_is_read_from_where_the_untouched_skin_lies_if_that_is_lighter() {
    let total = |rest: u16| {
        let mut skin = Skin::new(Some(row(TAXELS)));
        skin.counts.fill(rest);
        skin.counts[20..24].fill(REST - 30);
        let of_scan = |skin: &mut Skin| skin.measured().sample.total.unwrap().0;
        (0..100).map(|_| of_scan(&mut skin)).last().unwrap()
    };
    let lighter = total(REST + 1) - total(REST);
    assert!((lighter - 0.4).abs() < 0.05, "{lighter} N of four taxels, those beside them lying where all do");
    // One taxel beside reads more.
    assert!((total(REST - 1) - total(REST) - 0.1).abs() < 0.05, "{}", total(REST - 1) - total(REST));
}

/// The count at rest.
pub const REST: u16 = 240;
/// A taxel is touched from three counts on: below 237.
pub const ACTIVATION: Activation = Activation { sigmas: 4.0, floor_counts: 3.0 };
/// 1 kPa is 0.1 N.
pub const AREA: SquareMillimetre = SquareMillimetre(100.0);

/// A zero of so many taxels.
pub fn rest(taxels: usize) -> Vec<TaxelBaseline> {
    vec![TaxelBaseline { mean: f64::from(REST), noise: 0.5 }; taxels]
}

/// A model of 0 to 70 kPa.
pub fn model() -> TaxelModel {
    let kpa: Vec<f64> = (0..700).map(|k| f64::from(k) / 10.0).collect();
    let counts: Vec<f64> = kpa.iter().map(|kpa| (f64::from(REST) - kpa).round()).collect();
    fit(&Samples::new(&counts, &kpa), &FitOptions::default())
}

/// The same model for so many taxels.
pub fn set(taxels: usize) -> Arc<ModelSet> {
    Arc::new(ModelSet {
        id: "m-test".to_owned(),
        patch: "p".to_owned(),
        baseline: rest(taxels),
        pressure_max_kpa: 70.0,
        taxels: vec![model(); taxels],
        ..ModelSet::default()
    })
}

/// Plays for that model.
pub fn plays() -> Plays {
    let model = model();
    Plays {
        range: model.range.unwrap(),
        sign: model.sign,
        radii_counts: [4.0, 10.0, 0.0, 0.0],
        weights_kpa: [0.8, 0.4, 0.0, 0.0],
        slack_counts: 0.0,
    }
}

/// The set with these plays, which follow the mean of so many seconds.
pub fn with_plays(taxels: usize, smooth_s: f64) -> Arc<ModelSet> {
    let taxel = RecordedTaxel { sensitivity: 1.0, plays: Some(plays()) };
    let recorded = Recorded {
        smooth_s,
        module_size: 10,
        unloading_share: Some(0.0),
        plays_error_ratio: Some(0.5),
        taxels: vec![Some(taxel); taxels],
        ..Recorded::default()
    };
    Arc::new(ModelSet { recorded: Some(recorded), ..ModelSet::clone(&set(taxels)) })
}

/// Taxels in a row, 6 mm apart, with 100 mm from each module of ten to the next.
pub fn row(taxels: usize) -> Geometry {
    let x = |i: usize| 0.006 * i as f64 + 0.1 * (i / 10) as f64;
    let pose = |i: usize| TaxelPose { position: [x(i), 0.0, 0.0], normal: [0.0, 0.0, 1.0] };
    Geometry::from_poses((0..taxels).map(|i| Some(pose(i))).collect())
}

/// Modules of ten taxels; the total alone is asked for.
pub fn layout(taxels: usize, geometry: Option<Geometry>) -> Layout {
    Layout {
        areas: vec![AREA; taxels],
        area_uncertainty: 0.05,
        outputs: Outputs::default(),
        geometry,
        modules: (0..taxels / 10).map(|module| 10 * module..10 * module + 10).collect(),
    }
}

/// What a force needs to know of such a skin; up to a fifth of it may be silent.
pub fn plan(taxels: usize, geometry: Option<Geometry>) -> ForcePlan {
    ForcePlan {
        layout: layout(taxels, geometry),
        counts: CountRange::BYTE,
        activation: ACTIVATION,
        stale_share_max: 0.2,
    }
}

const TAXELS: usize = 100;

/// A skin of ten modules at rest.
struct Skin {
    force: Force,
    counts: Vec<u16>,
    sound: Vec<bool>,
    silent: Vec<bool>,
    zero: ZeroState,
    soundness: u64,
    jumps: Vec<f32>,
    time: Time,
}

impl Skin {
    fn new(geometry: Option<Geometry>) -> Self {
        Self::with_models(geometry, set(TAXELS))
    }

    fn with_models(geometry: Option<Geometry>, set: Arc<ModelSet>) -> Self {
        let mut force = Force::new(plan(TAXELS, geometry));
        force.set_models(set, 0.0);
        force.set_zero(Some(&rest(TAXELS)), 0.0);
        Self {
            force,
            counts: vec![REST; TAXELS],
            sound: vec![true; TAXELS],
            silent: vec![false; TAXELS / 10],
            // A tenth of a count on all of the skin, of which a taxel weighs 0.1 N a count.
            zero: ZeroState { sigma_counts: 0.1, sigma: Newton(0.01 * TAXELS as f64), ..ZeroState::default() },
            soundness: 0,
            jumps: vec![0.0; TAXELS / 10],
            time: Time::default(),
        }
    }

    fn press(mut self, taxels: std::ops::Range<usize>, counts: u16) -> Self {
        self.counts[taxels].fill(REST - counts);
        self
    }

    fn fault(mut self, taxel: usize) -> Self {
        self.sound[taxel] = false;
        self
    }

    fn silence(mut self, module: usize) -> Self {
        self.silent[module] = true;
        self.sound[10 * module..10 * module + 10].fill(false);
        self
    }

    fn zero(mut self, zero: ZeroState) -> Self {
        self.zero = zero;
        self
    }

    fn measured(&mut self) -> Measured {
        self.soundness += 1;
        let silent_taxels = 10 * self.silent.iter().filter(|silent| **silent).count();
        let scan = Scan {
            time: self.time,
            whole: true,
            counts: (&self.counts).into(),
            pads: &[],
            silent: &self.silent,
            sound: &self.sound,
            soundness: self.soundness,
            jumps: &self.jumps,
        };
        self.force.sample(&scan, silent_taxels, &self.zero)
    }

    /// State, reasons and whether nothing bounds the force above.
    fn verdict(mut self) -> (ForceState, Vec<String>, bool) {
        let sample = self.measured().sample;
        (sample.state, words(&sample.reasons), sample.unbounded)
    }
}

fn words(reasons: &[Reason]) -> Vec<String> {
    reasons.iter().map(|reason| reason.text().to_owned()).collect()
}

#[test]
fn each_reason_has_a_code_and_names_the_taxels_that_it_is_about() {
    use ReasonCode::{TaxelsExcluded, TaxelsFaulty, TaxelsOutOfRange, TaxelsSilent, TaxelsWithoutZero};
    fn told(mut skin: Skin) -> Vec<(ReasonCode, Vec<u16>)> {
        let sample = skin.measured().sample;
        sample.reasons.iter().map(|reason| (reason.code(), reason.taxels().to_vec())).collect()
    }
    let skin = || Skin::new(Some(row(TAXELS)));
    assert_eq!(told(skin().press(20..24, 30).fault(24).fault(75)), [(TaxelsFaulty, vec![24])]);
    assert_eq!(told(skin().silence(5)), [(TaxelsSilent, (50..60).collect())]);
    assert_eq!(told((50..60).fold(skin(), Skin::fault)), [(TaxelsExcluded, (50..60).collect())]);
    assert_eq!(told(skin().press(20..22, 100)), [(TaxelsOutOfRange, vec![20, 21])]);
    let mut without_zero = skin();
    let mut zero = rest(TAXELS);
    zero[50..60].fill(TaxelBaseline { mean: f64::NAN, noise: f64::NAN });
    without_zero.force.set_zero(Some(&zero), 0.0);
    assert_eq!(told(without_zero), [(TaxelsExcluded, (50..60).collect()), (TaxelsWithoutZero, (50..60).collect())]);
    let most = (0..6).fold(skin(), Skin::silence);
    let silent = told(most);
    assert_eq!(silent, [(TaxelsSilent, (0..60).collect())], "no force at all");
}

/// A load came while the zero was taken, and the taxel under it has none therefore; or it stands still at the end of its range and
/// was taken for broken.
#[test]
fn a_taxel_beside_a_contact_that_cannot_be_used_and_reads_a_load_leaves_the_force_without_an_upper_bound() {
    let judged = |counts: u16, has_fault: bool, geometry: Option<Geometry>| {
        let mut skin = Skin::new(geometry).press(20..24, 30).press(24..25, counts);
        if has_fault {
            skin.sound[24] = false;
        } else {
            let mut zero = rest(TAXELS);
            zero[24] = TaxelBaseline::UNKNOWN;
            skin.force.set_zero(Some(&zero), 0.0);
        }
        let sample = skin.measured().sample;
        (sample.unbounded, sample.reasons.iter().map(Reason::code).collect::<Vec<_>>())
    };
    use ReasonCode::{TaxelsExcluded, TaxelsFaulty};
    for geometry in [Some(row(TAXELS)), None] {
        assert_eq!(judged(16, false, geometry.clone()), (false, vec![]), "as far as days differ");
        assert_eq!(judged(17, false, geometry.clone()), (true, vec![TaxelsExcluded]));
        assert_eq!(judged(3, true, geometry.clone()), (false, vec![TaxelsFaulty]));
        assert_eq!(judged(200, true, geometry), (true, vec![TaxelsFaulty, TaxelsExcluded]));
    }
}

/// The taxels beside one say how much it may bear: more than they do themselves if it has few of them.
#[test]
fn more_than_the_contact_itself_on_unread_taxels_leaves_the_force_without_an_upper_bound() {
    let skin = || Skin::new(Some(row(TAXELS)));
    let (state, reasons, unbounded) = skin().press(22..24, 60).fault(24).fault(25).fault(21).fault(20).verdict();
    assert!(state == ForceState::Degraded && unbounded && reasons.len() > 1, "{reasons:?}");
    let (state, _, unbounded) = skin().press(20..24, 60).press(25..30, 60).fault(24).verdict();
    assert_eq!((state, unbounded), (ForceState::Degraded, false), "a fault beside a wide contact");
}

#[test]
fn a_fault_away_from_the_contact_degrades_nothing_and_one_beside_it_does() {
    let (state, reasons, bound) = Skin::new(Some(row(TAXELS))).press(20..24, 30).fault(75).verdict();
    assert_eq!((state, reasons.as_slice(), bound), (ForceState::Ok, [].as_slice(), false));
    let (state, reasons, bound) = Skin::new(Some(row(TAXELS))).press(20..24, 30).fault(24).verdict();
    assert_eq!(
        (state, reasons, bound),
        (ForceState::Degraded, vec!["1 taxel beside the contact has a fault".to_owned()], false)
    );
    let without_positions = |fault: usize| Skin::new(None).press(20..24, 30).fault(fault).verdict().0;
    let states = [without_positions(75), without_positions(25)];
    assert_eq!(states, [ForceState::Ok, ForceState::Degraded], "any of the module may be beside it");
}

/// Found by the simulation, seed 1003775: the tip of a load on a taxel without a model, less than a third of it on one beside it, and
/// something light on many others.
#[test]
fn what_may_lie_on_a_taxel_without_a_model_is_in_the_interval() {
    let mut models = ModelSet::clone(&set(TAXELS));
    models.taxels[22] = TaxelModel::without_curve(Status::NoData, GaugeUncertainty::default());
    let mut skin = Skin::with_models(Some(row(TAXELS)), Arc::new(models)).press(24..30, 6).press(23..24, 20);
    let sample = skin.measured().sample;
    let newton = |value: Option<Newton>| value.unwrap().0;
    let (felt, undetected) = (5.6, 7.0);
    let high = newton(sample.most(3.0));
    assert!((newton(sample.total) - felt).abs() < 0.3 && high > felt + undetected, "{:?} to {high}", sample.total);
}

/// An untouched skin would be DEGRADED for one scan in twenty, for whatever taxel the noise activates beside a faulty one.
#[test]
fn a_single_active_taxel_beside_one_with_a_fault_degrades_nothing_and_two_do() {
    let state = |pressed: Range<usize>| Skin::new(Some(row(TAXELS))).press(pressed, 4).fault(24).verdict().0;
    assert_eq!((state(23..24), state(22..24)), (ForceState::Ok, ForceState::Degraded));
}

#[test]
fn what_the_zero_says_of_itself_degrades_the_force() {
    let vanished = Some(Reason::new(ReasonCode::LoadVanished, "a load vanished"));
    let vanished = ZeroState { load_vanished: vanished, ..ZeroState::default() };
    let (state, reasons, bound) = Skin::new(None).zero(vanished).verdict();
    assert!(state == ForceState::Degraded && bound && reasons.len() == 1, "{reasons:?}");
    let short = ZeroState { shortcoming: Some(Reason::new(ReasonCode::DriftBounded, "drift")), ..ZeroState::default() };
    let (state, reasons, bound) = Skin::new(None).zero(short).verdict();
    assert_eq!((state, reasons, bound), (ForceState::Degraded, vec!["drift".to_owned()], false));
    let lost = ZeroState { lacks: Some(Reason::new(ReasonCode::ZeroLost, "power cycle")), ..ZeroState::default() };
    let mut skin = Skin::new(None).zero(lost);
    let sample = skin.measured().sample;
    assert_eq!((sample.state, sample.total), (ForceState::TareInvalid, None));
    assert_eq!(sample.reasons, [Reason::new(ReasonCode::ZeroLost, "power cycle")]);
}

/// Six taxels beside each other are pressed, and those at their ends lie under the edge.
#[test]
fn taxels_under_the_edge_of_a_touch_bear_what_their_dead_zone_swallows() {
    let total = |dead_zone_kpa: f64| {
        let models = ModelSet { dead_zone_kpa, ..ModelSet::clone(&set(TAXELS)) };
        Skin::with_models(Some(row(TAXELS)), Arc::new(models)).press(22..28, 30).measured().sample.total.unwrap().0
    };
    let (without, with) = (total(0.0), total(1.5));
    assert!(
        (with - without - 0.15).abs() < 1e-3,
        "{with} N, {without} N without: one at each end bears half of 1.5 kPa"
    );
}

#[test]
fn the_step_of_the_total_at_another_zero_is_told_until_the_next_one() {
    let mut skin = Skin::new(None).press(20..26, 30);
    let before = skin.measured().sample;
    assert_eq!(before.step, None, "there was no force before");
    let mut zero = rest(TAXELS);
    zero[20..26].iter_mut().for_each(|taxel| taxel.mean -= 10.0);
    skin.force.set_zero(Some(&zero), 0.0);
    let after = skin.measured().sample;
    let step = after.total.unwrap().0 - before.total.unwrap().0;
    assert!(step < -1.0 && after.step == Some(Newton(step)), "{step} {:?}", after.step);
    assert_eq!(skin.measured().sample.step, after.step);
    skin.force.set_zero(None, 0.0);
    assert_eq!(skin.measured().sample.total, None);
    skin.force.set_zero(Some(&zero), 0.0);
    assert_eq!(skin.measured().sample.step, None, "from none to one is no step");
}

proptest! {
    #[test]
    fn without_positions_the_total_is_the_sum_of_the_active_taxels(
        pressed in proptest::collection::vec(0..70_u16, TAXELS), faulty in proptest::collection::vec(0..TAXELS, 0..20)
    ) {
        let mut skin = faulty.into_iter().fold(Skin::new(None), Skin::fault);
        skin.counts.iter_mut().zip(&pressed).for_each(|(count, pressed)| *count -= pressed);
        let mut evaluator = Evaluator::new(set(TAXELS), &rest(TAXELS), &[AREA; TAXELS], ACTIVATION);
        evaluator.select(|taxel| skin.sound[taxel]);
        let total = evaluator.active(&skin.counts).iter().fold(0.0, |sum, (_, newton)| sum + newton);
        prop_assert_eq!(skin.measured().sample.total.map(|t| t.0.to_bits()), Some(total.to_bits()));
    }
}
