use taxel_skin::{Module, ModuleKind};
use taxel_wire::array::{CountField, FrameSpec};
use taxel_wire::bits::{BitField, ByteOrder, FrameMatch};
use taxel_wire::icub::BoardConfig;
use taxel_wire::{CanId, Frame};

use super::*;

const LINE: &str = "board 13: type 7; no_load 240; shift 0-2 = 2, 3-4 = 0; cdc_offset 0-2 = 0x2200, 3-4 = 0x2000";
const RANGE: &str = "counts 0 to 255, 1 to a unit";

/// What is said of a set with the one line on a board that is set as the other one says.
fn says(then: &str, now: &str) -> Option<String> {
    difference(&[then.to_owned()], &[now.to_owned()])
}

#[test]
fn a_line_tells_settings_and_modules() {
    let board = |numbers: &[u8]| {
        let modules = numbers.iter().map(|number| (Module::new(*number).unwrap(), ModuleKind::Triangle)).collect();
        Board { modules, ..crate::tests::board(0, 13, &[]) }
    };
    let triangle = |first, last, shift, cdc_offset| TriangleConfig {
        first: Module::new(first).unwrap(),
        last: Module::new(last).unwrap(),
        shift,
        enabled: true,
        cdc_offset,
    };
    let setup = BoardSetup {
        board: BoardConfig { kind: 7, period_ms: 50, no_load: 240 },
        triangles: vec![triangle(0, 15, 2, 0x2200), triangle(3, 4, 0, 0x2000)],
    };
    let of_board = |setup: Option<&BoardSetup>, modules: &[u8]| line(&board(modules), None, setup, CountRange::BYTE);
    assert_eq!(of_board(Some(&setup), &[0, 1, 2, 3, 4]), format!("{LINE}; {RANGE}; modules 0-4"));
    let of_part = of_board(Some(&setup), &[4, 6]);
    assert!(of_part.contains("; shift 4 = 0, 6 = 2; "), "the last command that counts for a module: {of_part}");
    assert_eq!(of_board(None, &[0, 1, 2]), format!("board 13: {RANGE}; modules 0-2"));
    let field = |start| BitField::new(start, 24, ByteOrder::Little, true).unwrap();
    let count = |start, shift| CountField { field: field(start), low: -8_388_608, shift, top: 4095 };
    let frames = |shifts: [u8; 2]| {
        let frames = FrameMatch { id: CanId::Standard(5), selectors: Vec::new() };
        vec![FrameSpec { frames, counts: vec![(0, count(0, shifts[0])), (1, count(24, shifts[1]))] }]
    };
    let of_device = |frames| {
        let device = DevicePlan { frames, sender: Sender::Elsewhere, ..DevicePlan::without_frames() };
        line(&board(&[2, 3]), Some(&device), None, CountRange::to(4095).unwrap())
    };
    assert_eq!(
        of_device(frames([8, 8])),
        "device 13: numbers from -8388608, lowest 8 bits left out; signals 160b768a; counts 0 to 4095, 16 to a unit; modules 2-3",
        "sets on disk have it"
    );
    assert!(!of_device(frames([8, 4])).contains("numbers"), "one line tells of all its taxels");
    assert_eq!(of_device(Vec::new()), "device 13: counts 0 to 4095, 16 to a unit; modules 2-3");
}

#[test]
fn modules_are_told_in_runs_of_one_kind() {
    let module = |number| Module::new(number).unwrap();
    let hand = [
        (module(0), ModuleKind::Fingertip),
        (module(1), ModuleKind::Fingertip),
        (module(3), ModuleKind::Triangle),
        (module(8), ModuleKind::PalmPad11),
        (module(9), ModuleKind::PalmPad7),
        (module(15), ModuleKind::Cells(16)),
    ];
    assert_eq!(in_words(&hand, kind), "0-1 fingertip, 3, 8 palm-pad11, 9 palm-pad7, 15 of 16 taxels");
}

#[test]
fn other_signals_and_other_commands_have_other_sums() {
    let line_of = |bit: u16, commands: &[(u16, &[u8])], sender| {
        let field = BitField::new(bit, 16, ByteOrder::Little, false).unwrap();
        let counts = vec![(0, CountField { field, low: 0, shift: 0, top: 4095 })];
        let frames = vec![FrameSpec { frames: FrameMatch { id: CanId::Standard(5), selectors: Vec::new() }, counts }];
        let command =
            |&(id, bytes): &(u16, &[u8])| (std::time::Duration::ZERO, Frame::data(CanId::Standard(id), bytes).unwrap());
        let commands = commands.iter().map(command).collect();
        let device = DevicePlan { frames, commands, sender, ..DevicePlan::without_frames() };
        of_device(&device).join("; ")
    };
    let plain = line_of(0, &[], Sender::Patch);
    assert!(plain.contains("; signals ") && plain.ends_with("; commands none"), "{plain}");
    assert!(!line_of(0, &[], Sender::Elsewhere).contains("commands"), "nobody knows what somebody else sends");
    let sent = |commands: &[(u16, &[u8])]| line_of(0, commands, Sender::Patch);
    let all = [plain, line_of(8, &[], Sender::Patch), sent(&[(7, &[1])]), sent(&[(7, &[2])]), sent(&[(8, &[1])])];
    assert!((0..all.len()).all(|n| all[n + 1..].iter().all(|other| *other != all[n])), "{all:?}");
    assert_eq!(sent(&[(7, &[1])]), line_of(0, &[(7, &[1])], Sender::Elsewhere), "what the configuration says is sent");
}

#[test]
fn all_that_counts_depend_on_is_compared_and_nothing_else() {
    for (is, becomes, then, now) in [
        ("type 7", "type 0", "type 0 on board 13", "type 7"),
        ("no_load 240", "no_load 245", "no_load 245 on board 13", "no_load 240"),
        ("3-4 = 0;", "3-4 = 1;", "shift 0-2 = 2, 3-4 = 1 on board 13", "shift 0-2 = 2, 3-4 = 0"),
        (
            "0x2000",
            "0x0000",
            "cdc_offset 0-2 = 0x2200, 3-4 = 0x0000 on board 13",
            "cdc_offset 0-2 = 0x2200, 3-4 = 0x2000",
        ),
        ("board 13", "board 5", "", ""), // its electronics were replaced: the pads and their converters are the same
    ] {
        let expected = format!("was gathered with {then}, where the configuration has {now}");
        let expected = (!then.is_empty()).then_some(expected);
        assert_eq!(says(&LINE.replacen(is, becomes, 1), LINE), expected, "{is} was {becomes}");
    }
}

#[test]
fn a_range_is_compared_wherever_it_is_known() {
    let device = |told: &str| format!("device 13: {told}");
    let (byte, wide) = (device(RANGE), device("counts 0 to 4095, 16 to a unit"));
    let why = says(&wide, &byte).unwrap();
    assert!(why.contains("counts 0 to 4095, 16 to a unit on device 13, where"), "{why}");
    let unknown = format!("board 13: {RANGE}");
    for board in [&format!("{LINE}; {RANGE}"), &unknown] {
        assert_eq!((says(board, &byte), says(&byte, board)), (None, None), "who knows how those behind it are set");
        assert!(says(board, &wide).is_some() && says(&wide, board).is_some());
    }
    assert_eq!(says(LINE, &unknown), None);
    assert!(differ_in(&[LINE.to_owned()], &[unknown]).is_some(), "counts of both are not fitted together");
    let other_unit = says(&device("counts 0 to 4095, 8 to a unit"), &wide).unwrap();
    assert!(other_unit.contains("8 to a unit on device 13"), "{other_unit}");
}

/// The taxels of one board would get the models of another's; new electronics have new addresses.
#[test]
fn boards_are_compared_by_their_place_and_other_ones_are_told() {
    let lines = |all: &[&str]| all.iter().map(|line| (*line).to_owned()).collect::<Vec<_>>();
    let (twelve, eleven) = (LINE.replace("board 13", "board 12"), LINE.replace("board 13", "board 11"));
    let now = lines(&[LINE, &twelve]);
    let is_fine = |then: &[&str]| assert_eq!(difference(&lines(then), &now), None, "{then:?}");
    is_fine(&[LINE, &twelve]);
    is_fine(&[LINE, &eleven]);
    is_fine(&[LINE, "?", &twelve]); // who knows what they were
    let (other, too) = (LINE.replace("type 7", "type 8"), eleven.replace("type 7", "type 8"));
    let why = difference(&lines(&[&other, &too]), &now).unwrap();
    assert!(why.contains("type 8 on board 13") && why.ends_with("type 7 (and 1 more)"), "{why}");
    let why = difference(&lines(&[&twelve, LINE]), &now).unwrap();
    assert_eq!(
        why,
        "was gathered with board 12, board 13 in this order, where the configuration has board 13, board 12"
    );
    assert!(difference(&lines(&[&eleven, LINE]), &now).is_some(), "board 13 was another one");
    for other in [lines(&[LINE]), lines(&[LINE, &twelve, &eleven])] {
        assert!(difference(&other, &now).unwrap().contains("in this order"), "{other:?}");
    }
}
