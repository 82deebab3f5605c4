//! The skin of a whole robot: some 4,400 taxels on 42 boards, 14 patches on seven buses.

use taxel_engine::snapshot::Health;
use taxel_engine::{Engine, Now, Output};
use taxel_sim::Skin;
use taxel_skin::{BusIndex, Module};

use crate::host::SLOT;
use crate::prelude::*;
use crate::rig::setup;

/// The gauges of the simulated buses, which no patch reads here.
const GAUGE: CanId = CanId::Standard(0x5F1);

const BUSES: u8 = 7;

/// The two parts of a bus: a hand, and a limb of five boards with up to eleven modules each.
fn parts(bus: u8, of_patch: u8) -> [(String, Vec<Board>); 2] {
    let of = |address: u8, modules: Vec<(Module, ModuleKind)>| Board {
        bus: BusIndex(bus),
        address: board(address),
        modules,
    };
    let kind = |number: u8| match number {
        0..=4 => ModuleKind::Fingertip,
        11 => ModuleKind::PalmPad7,
        _ => ModuleKind::PalmPad11,
    };
    let hand = [0, 1, 2, 3, 4, 8, 9, 10, 11].map(|number| (module(number), kind(number)));
    let limb = (8..13).map(|address| {
        let there = (0..16).filter(|number| (number + address) % 3 != 0);
        of(address, there.map(|number| (module(number), ModuleKind::Triangle)).collect())
    });
    [(format!("hand_{of_patch}"), vec![of(14, hand.into())]), (format!("limb_{of_patch}"), limb.collect())]
}

fn plan() -> Plan {
    let patches = (0..BUSES).flat_map(|bus| parts(bus, bus)).map(|(name, boards)| {
        let patch = Patch::new(name, boards).unwrap();
        PatchPlan { bring_up: patch.boards().iter().map(setup).collect(), ..PatchPlan::new(patch) }
    });
    Plan { buses: BUSES.into(), patches: patches.collect() }
}

/// One simulated world a bus, with all of its boards.
fn worlds() -> Vec<World> {
    let world = |bus: u8| {
        let boards = parts(0, bus).into_iter().flat_map(|(_, boards)| boards).collect();
        let mut config = Config::seeded(1 + u64::from(bus));
        config.gauge.signal.id = GAUGE; // its usual one is that of a module
        World::new(Skin::sleeve(Patch::new("bus", boards).unwrap()), config)
    };
    (0..BUSES).map(world).collect()
}

#[test]
fn a_whole_robot_is_brought_up_and_no_frame_of_it_is_lost() {
    let plan = Arc::new(plan());
    let modules = plan.patches.iter().map(|p| p.patch.modules().len() as u64).sum::<u64>();
    assert!(modules > 430 && plan.patches.iter().map(|p| p.patch.taxels().len()).sum::<usize>() > 4_300);
    let mut engine = Engine::new(Arc::clone(&plan), Restored::default());
    let (mut worlds, mut now) = (worlds(), worlds()[0].now());
    let (mut health, mut sent, mut heard) = (Arc::<Health>::default(), 0_u64, 0_u64);
    let skin_frames = |frames: &[TimedFrame]| frames.iter().filter(|timed| timed.frame.id != GAUGE).count() as u64;
    let mut step = |engine: &mut Engine, worlds: &mut Vec<World>, time: Time, input: Input<'_>| {
        let mut out = Vec::new();
        engine.step(Now { time, wall_ns: time.as_nanos() }, input, &mut out);
        for output in out {
            match output {
                Output::Send(bus, frame) => {
                    sent += 1;
                    worlds[usize::from(bus.0)].send(time, &frame);
                }
                Output::Health(newest) => health = newest,
                _ => {}
            }
        }
    };
    step(&mut engine, &mut worlds, now, Input::Tick);
    for _ in 0..500 {
        now = now + SLOT;
        for bus in 0..worlds.len() {
            let mut frames = Vec::new();
            worlds[bus].advance(now, &mut frames);
            heard += skin_frames(&frames);
            step(&mut engine, &mut worlds, now, Input::Frames(BusIndex(bus as u8), &frames));
        }
        step(&mut engine, &mut worlds, now, Input::Tick);
    }
    now = now + SLOT * 200; // the last health
    step(&mut engine, &mut worlds, now, Input::Tick);
    assert!(sent >= 4 * 42, "{sent} commands for 42 boards");
    let skin: u64 = health.boards.iter().map(|board| board.scans).sum();
    assert!(skin > 4 * modules * 20, "{skin} scans of more than four seconds at 20 Hz");
    for bus in &health.buses {
        assert_eq!((bus.malformed, bus.dropped), (0, 0), "{bus:?}");
    }
    let taken: u64 = health.buses.iter().map(|bus| bus.frames).sum();
    assert_eq!(taken, heard, "every frame concerns a patch");
    for board in &health.boards {
        assert_eq!(board.bring_up, "verified", "{board:?}");
    }
    // The end may cut one scan of each bus in half.
    let orphans: u64 = health.boards.iter().map(|board| board.orphans).sum();
    assert!(orphans <= 7, "{orphans} halves without a partner");
}
