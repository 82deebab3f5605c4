use proptest::prelude::*;
use taxel_skin::ModuleKind;

use super::*;

const LINE: &str =
    "board 13: type 7 period 50 ms no_load 240; 0-15: shift 2 cdc_offset 0x2200, 3-4: shift 0 cdc_offset 0x2000";

fn known(line: &str) -> KnownBoard {
    KnownBoard::read(line).unwrap()
}

/// What is said of a set with the one line on a board that is set as the other one says.
fn says(then: &str, now: &str) -> Option<String> {
    difference(&[then.to_owned()], &[known(now)])
}

#[test]
fn every_line_that_is_written_is_read_as_what_it_was_written_of() {
    let range = || CountRange::to(4095).unwrap().into();
    let all_of = |numbers, signals, commands| BoardSettings::Device { range: range(), numbers, signals, commands };
    let device = |numbers, signals| all_of(numbers, signals, None);
    let commands = || Commands::read("commands 0101, 02FF");
    assert!(commands().is_some());
    let signals = Signals::read("signals 5f3a9c12");
    assert!(signals.is_some());
    let numbers = Numbers { low: -8_388_608, shift: 8 };
    let BoardSettings::Configured(setup) = known(LINE).settings else { panic!("{LINE}") };
    let all: Vec<_> = (0..MODULES).map(|module| (Module::from_nibble(module), ModuleKind::Triangle)).collect();
    let board = |settings, modules| KnownBoard { address: 13, settings, modules };
    let without_modules = BoardSetup { triangles: Vec::new(), ..setup.clone() };
    for settings in [
        BoardSettings::Configured(setup),
        BoardSettings::Configured(without_modules),
        BoardSettings::Listened,
        device(None, None),
        device(Some(numbers), None),
        device(None, signals),
        device(Some(numbers), signals),
        all_of(Some(numbers), signals, commands()),
        all_of(None, None, commands()),
        all_of(None, None, Commands::read("no commands")),
    ] {
        for modules in [None, Some(Modules::of(&all[..1])), Some(Modules::of(&all[2..7]))] {
            let board = board(settings.clone(), modules);
            assert_eq!(known(&board.line()), board);
        }
    }
    assert_eq!(known(LINE).line(), LINE);
    let told = board(device(Some(numbers), signals), None).line();
    let numbers = "numbers from -8388608, lowest 8 bits left out";
    assert_eq!(told, format!("device 13: counts from 0 to 4095, 16 to a unit; {numbers}; signals 5f3a9c12"));
    let of_all = board(all_of(None, signals, commands()), Some(Modules::of(&all[..1]))).line();
    let words = "signals 5f3a9c12; commands 0101, 02FF; modules 0";
    assert_eq!(of_all, format!("device 13: counts from 0 to 4095, 16 to a unit; {words}"));
    let told = board(BoardSettings::Listened, Some(Modules::of(&all))).line();
    assert_eq!(told, "board 13: settings unknown; modules 0-15");
}

#[test]
fn what_no_version_has_written_is_not_known_and_nothing_follows_from_it() {
    let mut odd: Vec<String> =
        ["", "board 13", "board 13: ", "board 13: shift 3", "as they are"].map(String::from).into();
    let broken = [("type 7", "type 700"), ("ms ", ""), ("0-15", "0-16"), ("0-15", "0"), ("0x", ""), ("; ", ", ")];
    odd.extend(broken.map(|(is, becomes)| LINE.replacen(is, becomes, 1)));
    odd.push("device 1: counts from 0 to 4095".to_owned());
    odd.push(format!("{LINE}; modules 3 to 4"));
    odd.push("device 1: counts from 0 to 4095, 16 to a unit; numbers of some kind".to_owned());
    odd.push("device 1: counts from 0 to 4095, 16 to a unit; signals 5f3a9c12; signals 5f3a9c12".to_owned());
    odd.push("device 1: counts from 0 to 4095, 16 to a unit; commands 01; signals 5f3a9c12".to_owned());
    for line in odd {
        assert_eq!(KnownBoard::read(&line), None, "{line}");
        assert_eq!(difference(&[line], &[known(LINE)]), None);
    }
    assert_eq!(difference(&[], &[known(LINE)]), None);
}

#[test]
fn all_that_counts_depend_on_is_compared_and_nothing_else() {
    for (is, becomes, then, now) in [
        ("type 7", "type 0", "type 0 on board 13", "type 7"),
        ("no_load 240", "no_load 245", "no_load 245 on board 13", "no_load 240"),
        ("shift 0", "shift 1", "shift 1 on module 3 of board 13", "shift 0 (and 1 more)"),
        ("0x2000", "0x0000", "cdc_offset 0x0000 on module 3 of board 13", "cdc_offset 0x2000 (and 1 more)"),
        ("shift 2", "shift 1", "shift 1 on module 0 of board 13", "shift 2 (and 13 more)"),
        ("period 50", "period 20", "", ""),
        ("board 13", "board 5", "", ""), // its electronics were replaced: the pads and their converters are the same
    ] {
        let expected = format!("was gathered with {then}, where the configuration has {now}");
        let expected = (!then.is_empty()).then_some(expected);
        assert_eq!(says(&LINE.replacen(is, becomes, 1), LINE), expected, "{is} was {becomes}");
    }
}

#[test]
fn a_module_is_compared_by_the_last_command_that_counts_for_it_where_both_have_one() {
    let whole = "board 13: type 7 period 50 ms no_load 240; 0-2: shift 2 cdc_offset 0x2200, 3-4: shift 0 cdc_offset \
                 0x2000, 5-15: shift 2 cdc_offset 0x2200";
    assert_eq!((says(LINE, whole), says(whole, LINE)), (None, None), "in other words");
    let part = "board 13: type 7 period 50 ms no_load 240; 3-9: shift 2 cdc_offset 0x2200";
    let why = says(LINE, part).unwrap();
    assert!(why.contains("shift 0 on module 3 of board 13") && why.contains("(and 3 more)"), "{why}");
    assert_eq!(says(LINE, &part.replace("3-9", "5-9")), None);
}

#[test]
fn a_range_is_compared_wherever_it_is_known() {
    let device = |told: &str| format!("device 13: {told}");
    let (byte, wide) = (device("counts from 0 to 255, 1 to a unit"), device("counts from 0 to 4095, 16 to a unit"));
    let why = says(&wide, &byte).unwrap();
    assert!(why.contains("counts from 0 to 4095, 16 to a unit on device 13, where"), "{why}");
    for board in [LINE, "board 13: settings unknown"] {
        assert_eq!((says(board, &byte), says(&byte, board)), (None, None), "who knows how those behind it are set");
        assert!(says(board, &wide).is_some() && says(&wide, board).is_some());
    }
    assert_eq!(says(LINE, "board 13: settings unknown"), None);
    let other_unit = says(&device("counts from 0 to 4095, 8 to a unit"), &wide).unwrap();
    assert!(other_unit.contains("8 to a unit on device 13"), "{other_unit}");
    let numbers = |low: i64, shift: u8| format!("{wide}; numbers from {low}, lowest {shift} bits left out");
    assert_eq!((says(&wide, &numbers(0, 0)), says(&numbers(0, 4), &wide)), (None, None));
    assert_eq!(says(&numbers(-9, 4), &numbers(-9, 4)), None);
    let why = says(&numbers(0, 4), &numbers(0, 3)).unwrap();
    assert!(
        why.contains("lowest 4 bits left out on device 13, where the configuration has numbers from 0, lowest 3"),
        "{why}"
    );
    assert!(says(&numbers(0, 4), &numbers(5, 4)).is_some());
    let signals = |line: &str, which: &str| format!("{line}; signals {which}");
    let (one, other) = (signals(&numbers(0, 4), "00000001"), signals(&numbers(0, 4), "00000002"));
    let why = says(&one, &other).unwrap();
    let then = "signals 00000001 as its taxels on device 13, where the configuration has signals 00000002";
    assert!(why.contains(then), "{why}");
    assert_eq!((says(&numbers(0, 4), &one), says(&one, &numbers(0, 4)), says(&one, &one)), (None, None, None));
    assert!(says(&signals(&wide, "00000001"), &other).is_some(), "whatever is known of the numbers");
    assert!(differ_in(std::slice::from_ref(&one), &[other]).is_some() && differ_in(&[one], &[numbers(0, 4)]).is_none());
}

#[test]
fn commands_are_compared_where_both_are_known() {
    let with =
        |commands: &str| format!("device 1: counts from 0 to 255, 1 to a unit{commands}; modules 0 of 16 taxels");
    let (one, other, unknown) = (with("; commands 0101"), with("; commands 0102"), with(""));
    let why = says(&one, &other).unwrap();
    assert_eq!(why, "was gathered with commands 0101 on device 1, where the configuration has commands 0102");
    assert_eq!((says(&one, &one), says(&unknown, &one), says(&one, &unknown)), (None, None, None));
    let (none, why) = (with("; no commands"), "was gathered with no commands on device 1, where the configuration has");
    assert_eq!(says(&none, &one).unwrap(), format!("{why} commands 0101"));
    let differ = |a: &String, b: &String| differ_in(std::slice::from_ref(a), std::slice::from_ref(b)).is_some();
    assert!(differ(&one, &other) && !differ(&one, &one) && !differ(&one, &unknown) && !differ(&unknown, &one));
}

#[test]
fn boards_are_compared_by_their_place_and_the_first_difference_is_told() {
    let lines = |all: [&str; 2]| all.map(str::to_owned);
    let other = LINE.replace("board 13", "board 12").replace("type 7", "type 8");
    let now = [known(LINE), known(&other)];
    assert_eq!(difference(&lines([LINE, &other]), &now), None);
    // New electronics have new addresses.
    let (first, second) = (LINE.replace("board 13", "board 3"), other.replace("board 12", "board 4"));
    assert_eq!(difference(&lines([&first, &second]), &now), None);
    let (first, second) = (first.replace("type 7", "type 8"), second.replace("type 8", "type 7"));
    let why = difference(&lines([&first, &second]), &now).unwrap();
    assert!(why.contains("type 8 on board 13") && why.ends_with("type 7 (and 1 more)"), "{why}");
    let why = difference(&lines(["?", &second]), &now).unwrap();
    assert!(why.contains("type 7 on board 12"), "{why}");
}

/// The taxels of one board would get the models of another's.
#[test]
fn boards_in_another_order_or_number_are_told() {
    let lines = |all: &[&str]| all.iter().map(|line| (*line).to_owned()).collect::<Vec<_>>();
    let (twelve, eleven) = (LINE.replace("board 13", "board 12"), LINE.replace("board 13", "board 11"));
    let now = [known(LINE), known(&twelve)];
    let why = difference(&lines(&[&twelve, LINE]), &now).unwrap();
    assert_eq!(
        why,
        "was gathered with board 12, board 13 in this order, where the configuration has board 13, board 12"
    );
    assert!(difference(&lines(&[&eleven, LINE]), &now).is_some(), "board 13 was another one");
    assert_eq!(difference(&lines(&[LINE, &eleven]), &now), None, "new electronics");
    for other in [lines(&[LINE]), lines(&[LINE, &twelve, &eleven])] {
        assert!(difference(&other, &now).unwrap().contains("in this order"), "{other:?}");
    }
    assert_eq!(difference(&lines(&[LINE, "?", &twelve]), &now), None, "who knows what they were");
}

#[test]
fn modules_are_compared_where_both_are_known() {
    let with = |modules: &str| format!("{LINE}; modules {modules}");
    let why = says(&with("0-3"), &with("1-4")).unwrap();
    assert_eq!(why, "was gathered with modules 0-3 on board 13, where the configuration has modules 1-4");
    assert!(says(&with("0-3 fingertip"), &with("0-3")).is_some(), "of other values");
    for (then, now) in [(with("0-3"), with("0-3")), (LINE.to_owned(), with("0-3")), (with("0-3"), LINE.to_owned())] {
        assert_eq!(says(&then, &now), None);
        assert_eq!(differ_in(&[then], &[now]), None);
    }
    assert!(differ_in(&[with("0-3")], &[with("1-4")]).is_some());
    let device = |taxels: u8| format!("device 1: counts from 0 to 255, 1 to a unit; modules 0 of {taxels} taxels");
    assert!(says(&device(16), &device(16)).is_none() && says(&device(16), &device(8)).is_some());
}

proptest! {
    #[test]
    fn any_text_is_read_or_not(text in "(board|device) 1: .{0,60}(; modules .{0,20})?", other in ".*") {
        for line in [text, other] {
            let _ = KnownBoard::read(&line);
        }
    }
}
