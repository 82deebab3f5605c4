//! The skin of a whole iCub: 4,448 taxels on 44 boards, 13 patches on seven buses.

use std::sync::Arc;

use taxel_engine::plan::{BoardSetup, PatchPlan, Plan};
use taxel_engine::snapshot::Health;
use taxel_engine::{Engine, Input, Now, Output, Restored};
use taxel_sim::{Config, HOST_BOARD_CONFIG, Skin, World};
use taxel_skin::{Board, BusIndex, Module, ModuleKind, Patch, Time};
use taxel_wire::icub::TriangleConfig;
use taxel_wire::{CanId, TimedFrame};

use crate::host::SLOT;
use crate::rig::{board, module};

/// The gauges of the simulated buses, which no patch reads here.
const GAUGE: CanId = CanId::Standard(0x5F1);

/// Address and modules of a board.
type Modules = (u8, &'static [u8]);

/// The parts of one bus.
type Bus = &'static [(&'static str, &'static [Modules])];

const FULL: &[u8] = &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
const SHANK: &[u8] = &[0, 3, 4, 5, 6, 9, 10, 11, 14, 15];
const CALF: &[u8] = &[1, 2, 3, 4, 5, 6, 7, 8, 12, 13];

const ARM: Bus = &[
    ("hand", &[(14, &[0, 1, 2, 3, 4, 8, 9, 10, 11])]),
    ("forearm", &[(13, FULL), (12, &[0, 1, 3, 6, 8, 9, 12, 13])]),
    (
        "arm",
        &[
            (11, &[2, 3, 4, 5, 6]),
            (10, &[0, 1, 6, 8, 9, 10, 11, 12, 13, 14, 15]),
            (9, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13]),
            (8, &[0, 5, 8, 9, 10, 11, 13, 15]),
        ],
    ),
];
const THIGH: Bus = &[(
    "leg_upper",
    &[
        (1, FULL),
        (2, SHANK),
        (3, CALF),
        (4, &[5, 6, 8, 9, 10]),
        (5, &[0, 1, 2, 12, 14, 15]),
        (6, &[1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13]),
        (7, &[0, 1, 8, 10, 11, 12, 13, 14, 15]),
    ],
)];
const FOOT: Bus = &[
    ("foot", &[(13, &[0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 13, 14, 15]), (12, &[1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13])]),
    ("leg_lower", &[(8, SHANK), (9, &[0, 1, 3, 4, 5, 6, 7, 12]), (10, SHANK), (11, CALF)]),
];
const TORSO: Bus = &[(
    "torso",
    &[
        (7, &[5, 6, 7, 8, 9, 10, 11]),
        (8, &[1, 2, 3, 6, 7, 8, 9, 10, 11, 12, 13]),
        (9, FULL),
        (10, &[1, 2, 4, 8, 9, 10, 11, 12, 13, 14]),
    ],
)];
const ROBOT: [(&str, Bus); 7] = [
    ("left", ARM),
    ("right", ARM),
    ("left", THIGH),
    ("left", FOOT),
    ("right", THIGH),
    ("right", FOOT),
    ("middle", TORSO),
];

fn boards(bus: usize, part: &str, list: &[Modules]) -> Vec<Board> {
    let kind = |number: u8| match (part, number) {
        ("hand", 0..=4) => ModuleKind::Fingertip,
        ("hand", 11) => ModuleKind::PalmPad7,
        ("hand", _) => ModuleKind::PalmPad11,
        _ => ModuleKind::Triangle,
    };
    let of = |(address, modules): &Modules| Board {
        bus: BusIndex(bus as u8),
        address: board(*address),
        modules: modules.iter().map(|number| (module(*number), kind(*number))).collect(),
    };
    list.iter().map(of).collect()
}

/// A command for each run of consecutive modules.
fn setup(board: &Board) -> BoardSetup {
    let numbers: Vec<Module> = board.modules.iter().map(|(number, _)| *number).collect();
    let runs = numbers.chunk_by(|a, b| a.get() + 1 == b.get());
    let triangles = runs.map(|run| TriangleConfig {
        first: run[0],
        last: run[run.len() - 1],
        shift: 2,
        enabled: true,
        cdc_offset: 0x2200,
    });
    BoardSetup { board: HOST_BOARD_CONFIG, triangles: triangles.collect() }
}

fn plan() -> Plan {
    let patches = ROBOT.iter().enumerate().flat_map(|(bus, (side, parts))| {
        parts.iter().map(move |(part, list)| {
            let patch = Patch::new(format!("{side}_{part}"), boards(bus, part, list)).unwrap();
            PatchPlan { bring_up: patch.boards().iter().map(setup).collect(), ..PatchPlan::new(patch) }
        })
    });
    Plan { buses: ROBOT.len(), patches: patches.collect() }
}

/// One simulated world a bus, with all of its boards.
fn worlds() -> Vec<World> {
    let world = |(bus, (_, parts)): (usize, &(&str, Bus))| {
        let boards = parts.iter().flat_map(|(part, list)| boards(0, part, list)).collect();
        let mut config = Config::seeded(1 + bus as u64);
        config.gauge.signal.id = GAUGE; // its usual one is that of a module of the arm
        World::new(Skin::sleeve(Patch::new("bus", boards).unwrap()), config)
    };
    ROBOT.iter().enumerate().map(world).collect()
}

#[test]
fn a_whole_robot_is_brought_up_and_no_frame_of_it_is_lost() {
    let plan = Arc::new(plan());
    let count = |of: &dyn Fn(&Patch) -> usize| plan.patches.iter().map(|p| of(&p.patch)).sum::<usize>();
    let counts = [count(&|p| p.taxels().len()), count(&|p| p.modules().len()), count(&|p| p.boards().len())];
    assert_eq!(counts, [4_448, 442, 44], "taxels, modules and boards");
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
    assert!(sent >= 4 * 44, "{sent} commands for 44 boards");
    let skin: u64 = health.boards.iter().map(|board| board.scans).sum();
    // More than four seconds of 442 modules at 20 Hz.
    assert!(skin > 4 * 442 * 20, "{skin} scans");
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
