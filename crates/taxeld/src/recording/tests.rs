use super::*;
use proptest::prelude::*;

#[test]
fn cells_and_rows_that_cannot_be_read_are_counted_with_their_places() {
    let text = "t_s,pressure_kpa,c0,c1\n0.0,1.5,240,239\n0.1,,238,nan\nx,1,2,3\n0.2,1.0,2\n0.3,2.5,1e3,0.1\n";
    let r = Recording::parse(text.as_bytes()).unwrap();
    assert_eq!(r.time_s, [0.0, 0.1, 0.3]);
    assert_eq!((r.refused.rows, r.refused.cells), (2, 1));
    assert!(r.pressure_kpa.as_ref().unwrap().hi[1].is_nan());
    assert_eq!(r.counts[0].hi, [240.0, 238.0, 1000.0]);
    assert!(r.counts[1].lo.as_ref().unwrap()[2] != 0.0, "0.1 is not a double");
    assert!(r.refused.told[1].starts_with("line 4: t_s is `x`"), "{:?}", r.refused.told);
}

#[test]
fn quotes_around_a_cell_are_none_and_a_stray_one_spoils_its_cell_alone() {
    let text = "\"t_s\",\"pressure_kpa\",\"c0\"\n\"0.0\",\" 1.5 \",\"240\"\n0.1,\"2.5,239\n\n0.2,3.5,238\"\n0.3,\"\",237\n\
                0.4,\"4,5\",236\n\"0.5,5.5,235\n0.6,6.5,234\n";
    let r = Recording::parse(text.as_bytes()).unwrap();
    assert_eq!(r.time_s, [0.0, 0.1, 0.2, 0.3, 0.6]);
    assert_eq!(r.lines, [2, 3, 5, 6, 9]);
    let kpa = &r.pressure_kpa.as_ref().unwrap().hi;
    assert!(kpa[1].is_nan() && kpa[3].is_nan() && (kpa[0], kpa[2], kpa[4]) == (1.5, 3.5, 6.5), "{kpa:?}");
    let told = [
        "line 3: `\"2.5` (cell 2) is not a finite number",
        "line 5: `238\"` (cell 3) is not a finite number",
        "line 7: 4 cells, the header has 3",
        "line 8: t_s is `\"0.5`, expected seconds",
    ];
    assert_eq!((r.refused.rows, r.refused.cells, r.refused.told), (2, 2, told.map(str::to_owned).to_vec()));
}

#[test]
fn a_number_that_is_too_large_is_called_that_and_what_is_none_is_not() {
    let text = "t_s,pressure_kpa,c0\n0.0,1e308,240\n0.1,1.5,-1e400\n0.2,inf,nan\n0.3,1e,2\n";
    let told = Recording::parse(text.as_bytes()).unwrap().refused.told;
    let beyond = "is beyond what a pressure or a count can be, expected a number from -1e15 to 1e15";
    let expected = [
        format!("line 2: `1e308` (cell 2) {beyond}"),
        format!("line 3: `-1e400` (cell 3) {beyond}"),
        "line 4: `inf` (cell 2) is not a finite number".to_owned(),
        "line 4: `nan` (cell 3) is not a finite number".to_owned(),
        "line 5: `1e` (cell 2) is not a finite number".to_owned(),
    ];
    assert_eq!(told, expected);
}

#[test]
fn a_header_that_is_something_else_is_refused() {
    for (text, says) in [
        ("time,c0\n0,1\n", "begins with `time,c0`"),
        ("t_s,pressure_kpa\n0,1\n", "no taxel column"),
        ("t_s,c0,c2\n0,1,2\n", "column 3 is `c2`, expected `c1`"),
        // What colours a terminal is shown, and does nothing.
        ("x\u{1b}[31m\u{1b}]0;t\u{7},c0\n0,1\n", "begins with `x\\u{1b}[31m\\u{1b}]0;t\\u{7},c0`"),
        ("t_s,c0\n\u{1b}[8m,1\n", "line 2: t_s is `\\u{1b}[8m`, expected seconds"),
        ("t_s,c0\n", "not one usable row"),
        ("", "header"),
    ] {
        let error = Recording::parse(text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(says), "{text:?}: {error}");
    }
}

/// What is read of a text in one piece.
fn whole(text: &[u8]) -> anyhow::Result<Recording> {
    let mut reader = reader(text, true);
    let mut recording = Recording::under(reader.byte_headers()?)?;
    recording.take_rows(reader, 0, text)?;
    Ok(recording)
}

/// Rows as they come, some that cannot be read, and signs that a table treats in ways of its own.
fn rows() -> impl Strategy<Value = String> {
    let row = prop_oneof![
        12 => (0..100_u32, 0..256_u32).prop_map(|(t, c)| format!("{t}.5,0.1,{c}\n")),
        1 => prop_oneof![Just("x,1,2\n"), Just("\n"), Just("1,2\n"), Just("3,,\n"), Just("4,1,no\n"), Just("5,1,7\r")]
            .prop_map(str::to_owned),
        1 => prop_oneof![Just("6,\"1\",7\n"), Just("7,\"1,2\n"), Just("8,\"1\n")].prop_map(str::to_owned),
    ];
    (proptest::collection::vec(row, 0..40), any::<bool>(), any::<bool>()).prop_map(|(rows, unix, ended)| {
        let mut text = String::from("t_s,pressure_kpa,c0\n") + &rows.concat();
        if !ended {
            text.pop();
        }
        if unix { text } else { text.replace('\n', "\r\n") }
    })
}

/// Found by the property below.
#[test]
fn a_first_block_that_ends_with_the_header_leaves_the_numbers_of_lines_right() {
    let text = "t_s,pressure_kpa,c0\r\n5,1,7\r5,1,7\r0.5,0.1,0\r\n0.5,0.1,0";
    let recording = Recording::parse_in(Parts { block_bytes: 40, least_bytes: 1 }, text.as_bytes()).unwrap();
    assert_eq!(recording.lines, [2, 2, 2, 3]);
}

#[test]
fn a_line_without_an_end_is_refused() {
    let endless = std::io::Read::chain(&b"t_s,c0\n1,2\n"[..], std::io::repeat(b'1'));
    let refused = Recording::parse(endless).unwrap_err().to_string();
    assert_eq!(refused, "line 3 has 1048576 bytes or more, which no row of a recording has");
    assert!(Recording::parse(std::io::repeat(b'1')).unwrap_err().to_string().starts_with("line 1 has"));
}

proptest! {
    #[test]
    fn in_parts_a_file_is_what_it_is_in_one_piece(text in rows(), block in 40..200_usize, least in 1..50_usize) {
        let parts = Recording::parse_in(Parts { block_bytes: block, least_bytes: least }, text.as_bytes());
        let whole = whole(text.replace("\r\n", "\n").as_bytes()).unwrap();
        let Ok(parts) = parts else {
            prop_assert!(whole.time_s.is_empty(), "{whole:?}");
            return Ok(());
        };
        let columns = |of: &Recording| format!("{:?}{:?}{:?}", of.counts, of.pressure_kpa, of.refused.told);
        prop_assert_eq!(&parts.time_s, &whole.time_s);
        prop_assert_eq!(columns(&parts), columns(&whole));
        prop_assert_eq!(&parts.lines, &whole.lines);
    }

    #[test]
    fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let mut text = b"t_s,pressure_kpa,c0\n".to_vec();
        text.extend(bytes);
        let _ = Recording::parse(&text[..]);
    }
}
