//! Frames that are lost, torn or not ours: counted, and never in a force.

use std::cell::RefCell;
use std::collections::HashSet;
use std::rc::Rc;

use proptest::prelude::*;
use taxel_wire::FrameKind;
use taxel_wire::icub::{Message, decode};

use crate::prelude::*;

/// Halves of one module that the boards sent together, as taxel counts.
#[derive(Default)]
struct Truth {
    head: [u8; 7],
    whole: HashSet<Vec<u16>>,
    orphans: u64,
    kept_head: bool,
    state: u64,
}

impl Truth {
    /// Takes note of a frame of the module and says whether it gets through.
    fn passes(&mut self, frame: &Frame) -> bool {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let kept = (self.state >> 33) % 10 < 7;
        match decode(frame) {
            Ok(Message::Head { values, .. }) => {
                self.head = values;
                self.kept_head = kept;
            }
            Ok(Message::Tail { values, .. }) => {
                let all = [self.head.as_slice(), &values].concat();
                let taxels = ModuleKind::Triangle.taxel_slots().iter().map(|&slot| u16::from(all[slot as usize]));
                self.whole.insert(taxels.collect());
                self.orphans += u64::from(self.kept_head != kept);
            }
            _ => return true,
        }
        kept
    }
}

#[test]
fn no_torn_module_is_ever_published_and_orphans_are_counted() {
    let mut bench = small().in_use();
    bench.seconds(1.1); // counters are shown once a second
    let before = bench.host.health().boards[0].orphans; // it may have begun to listen between two halves
    let truth = Rc::new(RefCell::new(Truth::default()));
    truth.borrow_mut().whole.insert(bench.host.snapshot().taxels[..10].iter().map(|t| t.count).collect());
    let first = bench.host.snapshots.len();
    let ear = Rc::clone(&truth);
    bench.passes =
        Box::new(move |frame| frame.frame.id != CanId::Standard(0x4D0) || ear.borrow_mut().passes(&frame.frame));
    bench.ramp(40.0, 8.0); // so that every scan differs from the one before
    bench.seconds(8.0);
    bench.passes = Box::new(|_| true);
    let truth = truth.borrow();
    let mut seen = HashSet::new();
    for snapshot in &bench.host.snapshots[first..] {
        let counts: Vec<u16> = snapshot.taxels[..10].iter().map(|t| t.count).collect();
        assert!(truth.whole.contains(&counts), "{counts:?} was never sent together");
        seen.insert(counts);
    }
    assert!(seen.len() > 50, "{} different scans got through", seen.len());
    bench.seconds(2.0);
    let board = &bench.host.health().boards[0];
    assert!(truth.orphans > 40);
    assert_eq!(board.orphans - before, truth.orphans, "every half without a partner is counted once");
}

/// A still skin for 1.2 s, as frames.
struct Still {
    begin: Time,
    plan: Arc<Plan>,
    log: Vec<TimedFrame>,
    forces: Vec<(ForceState, Option<u64>)>,
}

const STILL: Duration = Duration::from_millis(1_200);

/// State and bits of every force.
fn forces(host: &Host) -> Vec<(ForceState, Option<u64>)> {
    host.snapshots.iter().map(|s| (s.force.state, s.force.total.map(|t| t.0.to_bits()))).collect()
}

fn still() -> &'static Still {
    static STILL_SKIN: OnceLock<Still> = OnceLock::new();
    STILL_SKIN.get_or_init(|| {
        let mut bench = small().in_use();
        let begin = bench.now();
        bench.log = Some(Vec::new());
        bench.run(STILL);
        let mut patch = PatchPlan { bring_up: Vec::new(), ..patch_plan(&small().skin) };
        patch.tare.duration = Duration::from_millis(500);
        let mut still = Still { begin, plan: plan(patch), log: bench.log.take().unwrap(), forces: Vec::new() };
        still.forces = forces(&play(&still, &still.log));
        assert!(still.forces.iter().filter(|(state, _)| *state == ForceState::Ok).count() > 5);
        still
    })
}

fn play(still: &Still, log: &[TimedFrame]) -> Host {
    let mut host = Host::new(Arc::clone(&still.plan), small().restored(), still.begin);
    host.play(log, still.begin + STILL + Duration::from_millis(300), |n| n);
    host
}

/// The log with strangers in it.
fn mixed(still: &Still, strangers: &[(u64, Frame)]) -> Vec<TimedFrame> {
    let late = |&(us, frame): &(u64, Frame)| TimedFrame { time: still.begin + Duration::from_micros(us), frame };
    let mut log = still.log.clone();
    log.extend(strangers.iter().map(late));
    log.sort_by_key(|f| f.time);
    log
}

fn any_id() -> impl Strategy<Value = CanId> {
    let ours = (prop::sample::select(vec![0x2_u16, 0x3, 0x4, 0x6, 0x7]), 12_u16..14, 0_u16..16)
        .prop_map(|(class, board, low)| CanId::Standard(class << 8 | board << 4 | low));
    prop_oneof![
        6 => ours,
        2 => (0_u16..0x800).prop_map(CanId::Standard),
        1 => Just(CanId::Standard(0x3A1)), // the gauge
        1 => (0_u32..0x2000_0000).prop_map(CanId::Extended),
    ]
}

/// Any frame that a bus can bring, often one that looks like skin.
fn any_frame() -> impl Strategy<Value = Frame> {
    let kind = prop_oneof![8 => Just(FrameKind::Data), 1 => Just(FrameKind::Remote), 1 => Just(FrameKind::Error)];
    let marker = prop_oneof![2 => Just(0x40_u8), 2 => Just(0xC0_u8), 1 => any::<u8>()];
    let bytes =
        (marker, prop::collection::vec(any::<u8>(), 0..=7), any::<bool>()).prop_map(|(marker, mut bytes, full)| {
            if full {
                bytes.resize(7, 200);
            }
            bytes.insert(0, marker);
            bytes
        });
    let bytes = prop_oneof![9 => bytes, 1 => Just(Vec::new())];
    (any_id(), kind, bytes).prop_map(|(id, kind, bytes)| Frame::new(id, kind, &bytes).unwrap())
}

fn strangers() -> impl Strategy<Value = Vec<(u64, Frame)>> {
    prop::collection::vec((0..STILL.as_micros() as u64, any_frame()), 1..60)
}

fn is_skin_data(frame: &Frame) -> bool {
    matches!(decode(frame), Ok(Message::Head { .. } | Message::Tail { .. }))
}

/// An identifier that one of the plan's modules sends its data with.
fn is_of_a_module(frame: &Frame) -> bool {
    let CanId::Standard(id) = frame.id else { return false };
    let (class, board, module) = (id >> 8, id >> 4 & 0xF, id & 0xF);
    matches!(class, 3 | 4 | 6) && (board == 13 && module < 6 || board == 12 && module < 2)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    /// Those that look like skin cannot be told from it: what comes of them is wrong, but never nonsense
    /// ([`crate::watch::check`] looks at every snapshot).
    #[test]
    fn any_frame_is_counted_and_one_that_is_no_skin_data_changes_no_force(all in strangers()) {
        let still = still();
        let others: Vec<_> = all.iter().filter(|(_, frame)| !is_skin_data(frame)).copied().collect();
        for strangers in [&all, &others] {
            let host = play(still, &mixed(still, strangers));
            let bus = &host.health().buses[0];
            let sent = (still.log.len() + strangers.len()) as u64;
            prop_assert_eq!(bus.frames + bus.foreign + bus.malformed, sent, "every frame is counted: {:?}", bus);
            prop_assert_eq!(bus.malformed == 0, bus.last_malformed.is_empty());
            if strangers.len() == others.len() {
                prop_assert_eq!(&forces(&host), &still.forces);
                let malformed = strangers.iter().filter(|(_, frame)| is_of_a_module(frame)).count() as u64;
                prop_assert!(bus.malformed >= malformed, "{} of at least {malformed}: {:?}", bus.malformed, bus);
            }
        }
    }

}
