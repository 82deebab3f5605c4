use super::*;
use proptest::prelude::*;

fn frame(id: CanId, kind: FrameKind, bytes: &[u8]) -> Frame {
    Frame::new(id, kind, bytes).unwrap()
}

fn read(line: &str) -> Frame {
    parse_line(line).unwrap().frame
}

fn refusal(line: &str) -> String {
    parse_line(line).unwrap_err().to_string()
}

#[test]
fn the_lines_of_candump() {
    let line = parse_line("(1600000000.000120) can0 4D0#40F0EFEFF1F1EEF0").unwrap();
    let bytes = [0x40, 0xF0, 0xEF, 0xEF, 0xF1, 0xF1, 0xEE, 0xF0];
    let expected = LogLine {
        time: Time::from_nanos(1_600_000_000_000_120_000),
        interface: "can0",
        frame: frame(CanId::Standard(0x4D0), FrameKind::Data, &bytes),
        direction: None,
    };
    assert_eq!(line, expected);

    assert_eq!(read("(0.1) can0 001#"), frame(CanId::Standard(1), FrameKind::Data, &[]));
    assert_eq!(read("(0.1) can0 1fffffff#aB"), frame(CanId::Extended(0x1FFF_FFFF), FrameKind::Data, &[0xAB]));
    assert_eq!(read("(0.1) can0 00000001#").id, CanId::Extended(1));
    assert_eq!(read("(0.1) can0 3A1#R"), frame(CanId::Standard(0x3A1), FrameKind::Remote, &[]));
    assert_eq!(read("(0.1) can0 3A1#R8"), frame(CanId::Standard(0x3A1), FrameKind::Remote, &[0; 8]));
    for code in ['9', 'E', 'F'] {
        assert_eq!(read(&format!("(0.1) can0 123#0011223344556677_{code} R")).bytes().len(), 8);
        assert_eq!(
            read(&format!("(0.1) can0 3A1#R8_{code}")),
            frame(CanId::Standard(0x3A1), FrameKind::Remote, &[0; 8])
        );
    }
    let fd = frame(CanId::Standard(0x123), FrameKind::Fd, &[0xAB; 64]);
    for flags in ['0', '1', '4', '5'] {
        assert_eq!(read(&format!("(0.1) can0 123##{flags}{}", "AB".repeat(64))), fd);
    }
    let error = read("(0.1) can0 20000040#0000000000000000");
    assert_eq!(error, frame(CanId::Extended(0x40), FrameKind::Error, &[0; 8]));
}

#[test]
fn direction_padding_and_line_ends() {
    let of =
        |text: &str| parse_line(text).map(|line| (line.interface.to_owned(), line.frame.bytes().len(), line.direction));
    assert_eq!(of("(0.1) can0 001#11 R"), Ok(("can0".into(), 1, Some(Direction::Received))));
    assert_eq!(of("(0.1) can0 001#R4 T\r\n"), Ok(("can0".into(), 4, Some(Direction::Transmitted))));
    assert_eq!(of("(0.1) can0 001# R\n"), Ok(("can0".into(), 0, Some(Direction::Received))));
    let long = "usb-PEAK-System_PCAN-USB_Pro-0:1";
    assert_eq!(of(&format!("(0.1) {long} 001#\n")), Ok((long.into(), 0, None)), "of python-can");
    assert_eq!(of("(0.1)   vcan0 001#\n"), Ok(("vcan0".into(), 0, None)), "candump pads names");
    assert_eq!(of("  (0.1) can0 001#11 \t \r\n"), Ok(("can0".into(), 1, None)), "blanks around a line");
}

/// What `candump -ta` shows, with what its other options add.
#[test]
fn the_lines_of_a_screen() {
    let of = |text: &str| {
        let line = parse_line(text).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        (line.time.as_nanos(), line.interface.to_owned(), line.frame, line.direction)
    };
    let at = 1_600_000_000_000_120_000;
    let eight = frame(CanId::Standard(0x4D0), FrameKind::Data, &[0x40, 0xF0, 0xEF, 0xEF, 0xF1, 0xF1, 0xEE, 0xF0]);
    let expected = (at, "can0".to_owned(), eight, None);
    assert_eq!(of(" (1600000000.000120)  can0  4D0   [8]  40 F0 EF EF F1 F1 EE F0\n"), expected);
    assert_eq!(of(" (2020-09-13 12:26:40.000120)  can0  4D0   [8]  40 F0 EF EF F1 F1 EE F0"), expected);
    assert_eq!(of(" (1600000000.000120)  can0       4D0   [8]  40 F0 EF EF F1 F1 EE F0   '@.......'"), expected);
    let (.., received) = of(" (1600000000.000120)  can0  RX - -  4D0   [8]  40 F0 EF EF F1 F1 EE F0");
    assert_eq!(received, Some(Direction::Received));

    let read = |rest: &str| of(&format!(" (000.000000)  can0  {rest}")).2;
    assert_eq!(read("TX B E  12345678  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B"), {
        frame(CanId::Extended(0x1234_5678), FrameKind::Fd, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])
    });
    assert_eq!(read("123  [08]  11 22 33 44 55 66 77 88").kind, FrameKind::Fd);
    assert_eq!(read("123   {F}  11 22 33 44 55 66 77 88"), read("123   [8]  11 22 33 44 55 66 77 88"));
    assert_eq!(read("4D0   [0]"), frame(CanId::Standard(0x4D0), FrameKind::Data, &[]));
    assert_eq!(read("4D0   [0]  remote request"), frame(CanId::Standard(0x4D0), FrameKind::Remote, &[]));
    assert_eq!(read("4D0   [4]  remote request"), frame(CanId::Standard(0x4D0), FrameKind::Remote, &[0; 4]));
    let error = frame(CanId::Extended(0x40), FrameKind::Error, &[0; 8]);
    assert_eq!(read("20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME"), error);
    assert_eq!(read("20000040   [8]  00 00 00 00 00 00 00 00"), error);
}

#[test]
fn a_line_of_a_screen_that_is_none_is_refused_with_the_column() {
    let table = [
        (
            "  can0  4D0   [8]  40 F0 EF EF F1 F1 EE F0",
            "column 3: found `c`, expected `(` and a time: record with `candump -l` or `candump -ta`",
        ),
        (" (1.0)  c  001   8  11", "column 18: found `8`, expected `[` and the length"),
        (" (1.0)  c  001   [9]  11", "column 19: found `9`, expected a length from 0 to 8"),
        (" (1.0)  c  001   [65]  11", "column 19: found `6`, expected a length from 00 to 64"),
        (" (1.0)  c  001   [123]", "column 21: found `3`, expected `]` after one or two digits of the length"),
        (
            " (1.0)  c  001   [2]  11",
            "column 25: found the line's end, expected a space and a data byte of two hexadecimal digits: the length says \
             that there are more",
        ),
        (
            " (1.0)  c  001   [1]  1",
            "column 24: found the line's end, expected the second hexadecimal digit of a data byte",
        ),
        (
            " (1.0)  c  001   [1]  11 22",
            "column 26: found `2`, expected the line's end: so many data bytes are what the length says",
        ),
        (
            " (1.0)  c  001   [1]  01100110",
            "column 25: found `1`, expected the line's end: so many data bytes are what the length says",
        ),
        (
            " (1.0)  c  RX 0 -  001   [0]",
            "column 15: found `0`, expected `B` or `-`, whether the bit rate was switched",
        ),
        ("(2020-13-01 00:00:00.0) c 001#", "column 7: found `1`, expected a month from 01 to 12"),
        ("(2021-02-29 00:00:00.0) c 001#", "column 10: found `2`, expected a day of that month"),
        ("(1969-01-01 00:00:00.0) c 001#", "column 2: found `1`, expected a year from 1970"),
        ("(2020-01-01 24:00:00.0) c 001#", "column 13: found `2`, expected an hour from 00 to 23"),
    ];
    for (line, expected) in table {
        assert_eq!(refusal(line), expected, "line {line:?}");
    }
    let latest = LogError::TimeRange { column: 2 };
    assert_eq!(parse_line("(9999-12-31 23:59:59.0) c 001#"), Err(latest));
}

#[test]
fn dates_are_seconds_since_1970() {
    let seconds = |date: &str| parse_line(&format!("({date}.5) c 001#")).unwrap().time.as_nanos() / 1_000_000_000;
    for (date, expected) in [
        ("1970-01-01 00:00:00", 0),
        ("1972-03-01 00:00:00", 68_256_000),
        ("2000-02-29 23:59:59", 951_868_799),
        ("2016-12-31 23:59:60", 1_483_228_800),
        ("2100-03-01 00:00:00", 4_107_542_400),
    ] {
        assert_eq!(seconds(date), expected, "{date}");
    }
}

#[test]
fn times_to_the_nanosecond_and_to_the_end_of_the_clock() {
    let nanos = |text: &str| parse_line(&format!("({text}) c 001#")).map(|line| line.time.as_nanos());
    assert_eq!(nanos("0.5"), Ok(500_000_000));
    assert_eq!(nanos("0000000012.000000001"), Ok(12_000_000_001));
    assert_eq!(nanos("9223372036.854775807"), Ok(i64::MAX));
    assert_eq!(nanos("9223372036.854775808"), Err(LogError::TimeRange { column: 2 }));
    assert_eq!(nanos("99999999999999999999999999.0"), Err(LogError::TimeRange { column: 2 }));
}

#[test]
fn refusals_name_column_and_expectation() {
    let table = [
        ("", "column 1: found the line's end, expected `(` and a time: record with `candump -l` or `candump -ta`"),
        ("# comment", "column 1: found `#`, expected `(` and a time: record with `candump -l` or `candump -ta`"),
        ("(-1.0) c 001#", "column 2: found `-`, expected a digit of the seconds"),
        ("(1) c 001#", "column 3: found `)`, expected `.` and the fraction of the seconds"),
        ("(1.) c 001#", "column 4: found `)`, expected a digit of the fraction"),
        ("(1.0123456789) c 001#", "column 13: found `9`, expected `)` after one to nine digits of the fraction"),
        ("(1.0)c 001#", "column 6: found `c`, expected a space"),
        ("(1.0) ", "column 6: found the line's end, expected a space"),
        ("(1.0) \u{e9}th 001#", "column 7: found `\\xc3`, expected an interface name of visible ASCII characters"),
        ("(1.0) c 001#1122334455667788_8", "column 30: found `8`, expected a raw length code, `9` to `F`"),
        ("(1.0) c 001#11_9", "column 15: found `_`, expected the line's end, or a space and the direction"),
        ("(1.0) c 01#", "column 11: found `#`, expected an identifier of three or eight hexadecimal digits"),
        ("(1.0) c 0123#", "column 13: found `#`, expected an identifier of three or eight hexadecimal digits"),
        ("(1.0) c 012345678#", "column 17: found `8`, expected `#` after three or eight digits of the identifier"),
        ("(1.0) c 00G#", "column 11: found `G`, expected an identifier of three or eight hexadecimal digits"),
        ("(1.0) c 001:11", "column 12: found `:`, expected `#` after the identifier, or a space and the length"),
        ("(1.0) c 001 11", "column 13: found `1`, expected `[` and the length"),
        ("(1.0) c 800#", "column 9: identifier 800 is too large, expected at most 7FF"),
        ("(1.0) c 40000001#", "column 9: identifier 40000001 is too large, expected at most 3FFFFFFF"),
        ("(1.0) c 001##", "column 14: found the line's end, expected a hexadecimal digit, the flags of a CAN FD frame"),
        ("(1.0) c 001##51", "column 16: found the line's end, expected the second hexadecimal digit of a data byte"),
        (
            "(1.0) c 20000040##0",
            "column 18: found `#`, expected the end of up to eight data bytes, two hexadecimal digits each",
        ),
        ("(1.0) c 001#1", "column 14: found the line's end, expected the second hexadecimal digit of a data byte"),
        ("(1.0) c 001#1 R", "column 14: found ` `, expected the second hexadecimal digit of a data byte"),
        (
            "(1.0) c 001#112233445566778899",
            "column 29: found `9`, expected the end of up to eight data bytes, two hexadecimal digits each",
        ),
        (
            "(1.0) c 001#11.22",
            "column 15: found `.`, expected the end of up to eight data bytes, two hexadecimal digits each",
        ),
        ("(1.0) c 001#R9", "column 14: found `9`, expected a length from 0 to 8"),
        ("(1.0) c 001#R12", "column 15: found `2`, expected the line's end, or a space and the direction"),
        (
            "(1.0) c 20000040#R",
            "column 18: found `R`, expected the end of up to eight data bytes, two hexadecimal digits each",
        ),
        ("(1.0) c 001#11 X", "column 16: found `X`, expected the direction, `R` or `T`"),
        ("(1.0) c 001#11  R", "column 16: found ` `, expected the direction, `R` or `T`"),
        ("(1.0) c 001#11 RT", "column 17: found `T`, expected the line's end"),
    ];
    for (line, expected) in table {
        assert_eq!(refusal(line), expected, "line {line:?}");
    }
}

#[test]
fn written_as_candump_writes() {
    let written = |nanos, id, kind, bytes: &[u8]| {
        let mut out = String::new();
        write_line(&mut out, Time::from_nanos(nanos), "can0", &frame(id, kind, bytes)).unwrap();
        out
    };
    let standard = CanId::Standard(0x4D);
    assert_eq!(
        written(1_600_000_000_000_120_000, standard, FrameKind::Data, &[0x40, 0xF]),
        "(1600000000.000120) can0 04D#400F\n"
    );
    assert_eq!(written(1, standard, FrameKind::Remote, &[1; 4]), "(0.000000001) can0 04D#R4\n");
    assert_eq!(written(-1, standard, FrameKind::Remote, &[]), "(0.000000) can0 04D#R\n");
    assert_eq!(written(0, CanId::Extended(0x4D), FrameKind::Data, &[]), "(0.000000) can0 0000004D#\n");
    assert_eq!(written(0, CanId::Extended(0x40), FrameKind::Error, &[0]), "(0.000000) can0 20000040#00\n");
}

fn any_frame() -> impl Strategy<Value = Frame> {
    let standard = (0..=0x7FF_u16).prop_map(CanId::Standard);
    let extended = (0..=0x1FFF_FFFF_u32).prop_map(CanId::Extended);
    let plain =
        (prop_oneof![standard, extended.clone()], prop::sample::select(vec![FrameKind::Data, FrameKind::Remote]));
    let error = extended.clone().prop_map(|id| (id, FrameKind::Error));
    let fd =
        (extended, prop::collection::vec(any::<u8>(), 0..=64)).prop_map(|(id, bytes)| frame(id, FrameKind::Fd, &bytes));
    let classic = (prop_oneof![3 => plain, 1 => error], prop::collection::vec(any::<u8>(), 0..=8))
        .prop_map(|((id, kind), bytes)| frame(id, kind, &bytes));
    prop_oneof![3 => classic, 1 => fd]
}

/// Lines that are nearly right: the bytes of a log, a few of them changed.
fn any_near_line() -> impl Strategy<Value = Vec<u8>> {
    let seeds = prop::sample::select(vec![
        "(1600000000.000120) can0 4D0#40F0EFEFF1F1EEF0",
        "(1600000000.000000001) can0 18AAA301#0102 R",
        "(9223372036.854775807) abcdefghijklmno 20000040#R8 T",
        " (1600000000.000120)  can0  4D0   [3]  40 F0 EF   '@..'",
        " (2020-09-13 12:26:40.000120)  can0  TX B -  18AAA301  [02]  01 02",
    ]);
    let byte = prop_oneof![prop::sample::select(b"()#. R0F9[]-\r\n".to_vec()), any::<u8>()];
    let changes = prop::collection::vec((any::<prop::sample::Index>(), 0..3_u8, byte), 0..4);
    (seeds, changes).prop_map(|(seed, changes)| {
        let mut line = seed.as_bytes().to_vec();
        for (index, what, byte) in changes {
            match what {
                0 if !line.is_empty() => drop(line.remove(index.index(line.len()))),
                1 => line.insert(index.index(line.len() + 1), byte),
                _ if !line.is_empty() => {
                    let at = index.index(line.len());
                    line[at] = byte;
                }
                _ => {}
            }
        }
        line
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn lines_survive_writing_and_reading(frame in any_frame(), nanos in 0..=i64::MAX, interface in "[!-~]{1,15}") {
        let mut line = String::new();
        write_line(&mut line, Time::from_nanos(nanos), &interface, &frame).unwrap();
        let expected = LogLine { time: Time::from_nanos(nanos), interface: &interface, frame, direction: None };
        prop_assert_eq!(parse_line(&line), Ok(expected));
    }

    #[test]
    fn reading_is_total(line in prop_oneof![any_near_line(), prop::collection::vec(any::<u8>(), 0..80)]) {
        match parse_line_bytes(&line) {
            Ok(read) => {
                let mut again = String::new();
                write_line(&mut again, read.time, read.interface, &read.frame).unwrap();
                prop_assert_eq!(parse_line(&again), Ok(LogLine { direction: None, ..read }));
            }
            Err(LogError::Syntax { column, found, .. }) => {
                let text = line.trim_ascii_end();
                prop_assert!(column <= text.len() + 1);
                prop_assert_eq!(found, text.get(column - 1).copied());
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
