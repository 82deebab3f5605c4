//! What a host sees of the boards, the gauge and the bus.

use proptest::prelude::*;
use taxel_sim::GaugeConfig;
use taxel_wire::icub::{BoardConfig, Command, TriangleConfig};

use crate::common::*;

fn tell(world: &mut World, address: u8, command: Command) {
    let now = world.now();
    world.send(now, &command.encode(board(address)));
}

fn skin_frames(frames: &[TimedFrame], address: u8) -> usize {
    let of_board = |message: &Message| match message {
        Message::Head { board, .. } | Message::Tail { board, .. } => board.get() == address,
        _ => false,
    };
    messages(frames).iter().filter(|(_, message)| of_board(message)).count()
}

#[test]
fn the_forearm_sends_920_skin_frames_and_100_readings_a_second_in_order() {
    let mut world = streaming(1);
    advance(&mut world, 1.0);
    let frames = advance(&mut world, 11.0);
    let skin = skin_frames(&frames, 13) + skin_frames(&frames, 12);
    assert!(skin.abs_diff(9200) <= 46, "{skin} skin frames in 10 s");
    assert!((frames.len() - skin).abs_diff(1000) <= 1);
    for pair in frames.windows(2) {
        assert!(pair[1].time.since(pair[0].time) > Duration::from_micros(70), "one frame at a time");
    }
    let spec = GaugeConfig::default().signal;
    assert!(frames.iter().filter_map(|timed| spec.decode(&timed.frame).ok()).all(|p| p.0.abs() < 0.1));
}

#[test]
fn a_scan_is_modules_ascending_head_before_tail_and_boards_have_their_own_phase() {
    let mut world = streaming(2);
    advance(&mut world, 1.0);
    let all = messages(&advance(&mut world, 2.0));
    let of = |address: u8| -> Vec<(f64, u8, bool)> {
        let read = |(time, message): &(taxel_skin::Time, Message)| match message {
            Message::Head { board, module, .. } if board.get() == address => {
                Some((time.as_seconds(), module.get(), true))
            }
            Message::Tail { board, module, .. } if board.get() == address => {
                Some((time.as_seconds(), module.get(), false))
            }
            _ => None,
        };
        all.iter().filter_map(read).collect()
    };
    for (address, modules) in [(13, 16), (12, 7)] {
        let halves = of(address);
        let start = halves.iter().position(|(_, module, head)| *module == 0 && *head).unwrap();
        for (n, (time, module, head)) in halves[start..].iter().enumerate() {
            assert_eq!((usize::from(*module), *head), (n / 2 % modules, n % 2 == 0), "board {address} at {time} s");
        }
        let scan = &halves[start..start + 2 * modules];
        let length = scan[scan.len() - 1].0 - scan[0].0;
        let per_frame_us = length / (scan.len() - 1) as f64 * 1e6;
        assert!((115.0..270.0).contains(&per_frame_us), "{per_frame_us} us a frame");
        let period = halves[start + 2 * modules].0 - halves[start].0;
        assert!((period - 0.05).abs() < 0.002, "period {period} s");
    }
    let phase = |address| of(address).iter().find(|(_, module, head)| *module == 0 && *head).unwrap().0 % 0.05;
    assert!((phase(13_u8) - phase(12)).abs() > 1e-4);
}

#[test]
fn boards_wait_for_the_whole_start_sequence() {
    let mut world = silent(1);
    assert_eq!(skin_frames(&advance(&mut world, 1.0), 13), 0);
    tell(&mut world, 13, Command::Start);
    assert_eq!(skin_frames(&advance(&mut world, 2.0), 13), 0, "nothing is enabled");
    world.bring_up_boards(seconds(2.0));
    advance(&mut world, 2.2);
    let frames = advance(&mut world, 3.2);
    assert_eq!((skin_frames(&frames, 13), skin_frames(&frames, 12)), (640, 280));

    tell(&mut world, 13, Command::SetBoardConfig(BoardConfig { kind: 0, period_ms: 50, no_load: 240 }));
    let frames = advance(&mut world, 4.2);
    assert!(skin_frames(&frames, 13) <= 32, "0x4D clears the mask");
    tell(&mut world, 12, Command::Stop);
    advance(&mut world, 4.3);
    assert_eq!(skin_frames(&advance(&mut world, 5.0), 12), 0, "07 01 stops");
}

#[test]
fn configuring_a_module_takes_a_new_zero_of_its_board_and_stops_it() {
    let mut world = streaming(5);
    world.pump(ramp(40.0, 20.0));
    advance(&mut world, 5.0);
    let module = Module::from_nibble(3);
    let again = TriangleConfig { first: module, last: module, shift: 2, enabled: true, cdc_offset: 0x2200 };
    tell(&mut world, 13, Command::SetTriangles(again));
    advance(&mut world, 5.3);
    assert_eq!(skin_frames(&advance(&mut world, 6.0), 13), 0);
    tell(&mut world, 13, Command::Start);
    advance(&mut world, 6.2);
    let frames = advance(&mut world, 7.0);
    let after = taxel_means(&world, &frames);
    assert!((mean_and_sd(&after[..160]).0 - 240.0).abs() < 2.0, "the hand on the skin became the zero");
    assert!(mean_and_sd(&after[160..]).0 < 195.0, "the other board kept its own");
}

#[test]
fn a_query_is_answered_once() {
    let mut world = silent(1);
    tell(&mut world, 12, Command::QueryFirmware { protocol: (2, 0) });
    tell(&mut world, 9, Command::QueryFirmware { protocol: (2, 0) });
    let heard = messages(&advance(&mut world, 1.0));
    let [(_, Message::FirmwareVersion { board, version })] = heard.as_slice() else { panic!("{heard:?}") };
    assert_eq!((board.get(), version.board_type, version.compatible), (12, 11, true));
}

/// A story with every kind of intervention, told at fixed times; `cuts` are further points at which time is cut.
fn story(seed: u64, cuts: &[f64]) -> Vec<TimedFrame> {
    let mut world = silent(seed);
    let mut out = Vec::new();
    let mut reach = |world: &mut World, from: f64, until: f64| {
        for cut in cuts.iter().filter(|cut| (from..until).contains(*cut)) {
            world.advance(seconds(*cut), &mut out);
        }
        world.advance(seconds(until), &mut out);
    };
    world.bring_up_boards(seconds(0.1));
    reach(&mut world, 0.0, 0.5);
    world.pump(ramp(30.0, 15.0));
    reach(&mut world, 0.5, 2.0);
    world.pump(PumpCommand::Vent);
    world.lay(Mass::on_disc(0.5, TaxelIndex(77), 600.0)).unwrap();
    world.inject(Fault::FramesLost { probability: 0.1 }).unwrap();
    let flicker =
        Fault::ModuleFlicker { board: board(13), module: Module::from_nibble(2), probability: 0.3, depth_counts: 30.0 };
    world.inject(flicker).unwrap();
    world.inject(Fault::PowerCycle { board: board(12), off: Duration::from_millis(300) }).unwrap();
    reach(&mut world, 2.0, 4.0);
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn the_same_seed_tells_the_same_story_however_time_is_cut(
        seed in 0_u64..1000, mut cuts in proptest::collection::vec(0.0_f64..4.0, 0..60),
    ) {
        cuts.sort_by(f64::total_cmp);
        let whole = story(seed, &[]);
        prop_assert!(whole.len() > 2000);
        prop_assert_eq!(&whole, &story(seed, &cuts));
        prop_assert_ne!(&whole, &story(seed + 1, &[]));
    }
}
