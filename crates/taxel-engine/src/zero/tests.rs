//! The owner of the zero, on a board of eight triangles that are scanned every 50 ms.

use std::sync::Arc;

use taxel_skin::{ModuleKind, Time};

use crate::baseline::TaxelBaseline;
use crate::force::reason::ReasonCode;
use crate::force::tests::{REST, set};
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::plan::PatchPlan;
use crate::regions::Regions;
use crate::request::RequestId;
use crate::scan::Scan;
use crate::tests::patch;
use crate::zero::bag::Bag;
use crate::zero::events::{Surroundings, ZeroEvent};
use crate::zero::holder::{Trust, Zero};
use crate::zero::kept::{KeptZero, TakenZero};
use crate::zero::watch::Purpose;

const MODULES: usize = 8;
const TAXELS: usize = 10 * MODULES;
const PERIOD_NS: i64 = 50_000_000;

#[test]
fn a_confirmed_zero_is_known_until_a_board_takes_another_also_one_that_waits_for_the_disk() {
    for for_operator in [false, true] {
        let mut skin = Skin::new();
        skin.models = Some(models());
        let confirmed_by = Some("Ada".to_owned());
        let request = RequestId(1);
        let purpose =
            if for_operator { Purpose::Operator { request, confirmed_by } } else { Purpose::Session { confirmed_by } };
        skin.zero.watch(skin.now().time, purpose, &mut skin.events);
        skin.scan(30, |_| 0);
        if for_operator {
            assert!(skin.zero.confirmed().is_none(), "it does not hold before it is on disk");
            skin.zero.adopt(request).unwrap();
        }
        assert!(skin.zero.holds());
        assert_eq!(skin.zero.confirmed().map(|zero| zero[0].mean), Some(240.0));
        // Another that nobody confirms is told from that one, until a board takes another zero.
        skin.zero.lose(ReasonCode::ZeroLost, "bus-off", &mut skin.events);
        assert!(skin.zero.confirmed().is_some());
        skin.zero.lose_by_board(0, "a power cycle", &mut skin.events);
        assert!(skin.zero.confirmed().is_none());
    }
}

#[test]
fn a_zero_of_before_the_start_is_valid_once_its_counts_have_shown_that_no_board_has_another() {
    for (load, holds) in [(0, true), (20, true), (-3, false)] {
        let mut earlier = Skin::new();
        earlier.models = Some(models());
        earlier.zero.on_models(earlier.models.as_ref().unwrap());
        let earlier = earlier.zeroed(|_| 0);
        let known = earlier.zero.news(7, &KeptZero::default()).unwrap();
        assert!(earlier.zero.news(7, &known).is_none(), "it is noted once");
        let known: KeptZero = serde_json::from_str(&serde_json::to_string(&known).unwrap()).unwrap();
        let mut skin = Skin::new();
        skin.zero.remember(&known);
        skin.zero.on_models(earlier.models.as_ref().unwrap());
        skin.zero.go_on(known.zero.unwrap(), &mut skin.events);
        assert!(!skin.zero.holds(), "it is in check at first");
        // Where a load lies on half of the skin, or what has become lighter.
        skin.scan(21, |taxel| if taxel < TAXELS / 2 { load } else { 0 });
        assert_eq!(skin.zero.holds(), holds, "{load}: {:?}", skin.events);
        assert_eq!(skin.zero.view().epoch, earlier.zero.view().epoch + u64::from(!holds));
        assert_eq!(matches!(skin.zero.trust, Trust::Held(_)), holds);
        assert_eq!(matches!(skin.zero.trust, Trust::None), !holds, "what was refuted is replaced as after any start");
    }
}

#[test]
fn a_zero_of_another_layout_or_one_that_needs_confirmation_is_not_gone_on_with() {
    for (taxels, needs_confirmation) in [(TAXELS - 10, None), (TAXELS, Some("a load vanished".to_owned()))] {
        let numbers = vec![240.0; taxels];
        let zero = TakenZero { mean: numbers.clone(), noise: numbers, ..TakenZero::default() };
        let mut skin = Skin::new();
        skin.zero.remember(&KeptZero { needs_confirmation, ..KeptZero::default() });
        skin.zero.go_on(Arc::new(zero), &mut skin.events);
        assert!(!skin.zero.view().valid && skin.events.is_empty(), "{taxels} taxels");
    }
}

/// A skin, and what its zero told.
struct Skin {
    zero: Zero,
    scans: i64,
    events: Vec<ZeroEvent>,
    models: Option<ModelSet>,
}

impl Skin {
    fn new() -> Self {
        let mut plan = PatchPlan::new(patch(&[ModuleKind::Triangle; MODULES]));
        plan.tare.at_start = false;
        let regions = Regions::new(&plan.patch);
        Self { zero: Zero::new(Arc::new(plan), regions), scans: 0, events: Vec::new(), models: None }
    }

    fn now(&self) -> Now {
        Now { time: Time::from_nanos(self.scans * PERIOD_NS), wall_ns: self.scans * PERIOD_NS + 1 }
    }

    /// Takes so many scans at 240 counts, going up and down by one, with `load` counts on each taxel; how the counts of the
    /// last of them are does not matter to their mean if they are even in number.
    fn scan(&mut self, scans: usize, load: impl Fn(usize) -> i16) {
        for _ in 0..scans {
            self.scans += 1;
            let wiggle = |taxel: usize| if (self.scans as usize + taxel).is_multiple_of(2) { 1 } else { -1 };
            let counts: Vec<u16> = (0..TAXELS).map(|taxel| (240 - load(taxel) + wiggle(taxel)) as u16).collect();
            let now = self.now();
            let scan = Scan {
                time: now.time,
                whole: true,
                counts: (&counts).into(),
                pads: &[[100; 2]; MODULES],
                silent: &[false; MODULES],
                sound: &[true; TAXELS],
                soundness: 0,
                jumps: &[],
            };
            let around = Surroundings {
                models: self.models.as_ref(),
                boards_ready: true,
                configuring: false,
                bag: Bag::default(),
                parts_left_out: false,
                no_rest: false,
            };
            self.zero.on_scan(now, &scan, around, &mut self.events);
        }
    }

    /// With a zero that was taken under `load`, which the first session of a skin need not prove.
    fn zeroed(mut self, load: impl Fn(usize) -> i16) -> Self {
        self.zero.watch(self.now().time, Purpose::Session { confirmed_by: None }, &mut self.events);
        self.scan(20, load);
        assert!(matches!(self.events[..], [ZeroEvent::Taken(_)]), "{:?}", self.events);
        self.events.clear();
        self
    }

    fn lost(&self) -> Option<&str> {
        self.events.iter().find_map(|event| match event {
            ZeroEvent::Lost(why) => Some(why.as_str()),
            _ => None,
        })
    }
}

/// Models of the skin at its zero.
fn models() -> ModelSet {
    let baseline = vec![TaxelBaseline { mean: f64::from(REST), noise: 1.0 }; TAXELS];
    ModelSet { baseline, ..ModelSet::clone(&set(TAXELS)) }
}

/// Another patch of the same board proves some scans later that it has a new zero. A load that vanished here with it lies
/// there still, as far as anybody knows.
#[test]
fn a_new_zero_that_another_patch_proves_is_one_here_and_hides_what_lay_here() {
    for (scans_after, needed) in [(4, true), (30, true), (40, false)] {
        let mut skin = Skin::new();
        skin.models = Some(models());
        skin.zero.on_models(skin.models.as_ref().unwrap());
        let mut skin = skin.zeroed(|_| 0);
        skin.scan(20, |taxel| if taxel < 30 { 20 } else { 0 });
        skin.scan(scans_after, |_| 0);
        assert!(skin.zero.holds(), "nothing here shows it: {:?}", skin.events);
        let why = "board 12 has taken a new zero";
        skin.zero.lose_by_another(0, why, &mut skin.events);
        assert_eq!((skin.lost(), skin.zero.zero()), (Some(why), None));
        assert_eq!(skin.zero.needs_confirmation(), needed.then_some(why), "{scans_after} scans after");
    }
}
