//! DATA.csv of `taxeld fit` and `taxeld apply`.

use crate::recording::{Column, Recording};

/// A table: what of it can be used has its row and column, and what cannot is counted.
pub fn run(data: &[u8]) {
    let recording = match Recording::parse(data) {
        Ok(recording) => recording,
        Err(error) => {
            let said = format!("{error:#}");
            assert!(!said.is_empty() && said.len() < 1_000 && !said.contains(char::is_control), "{said}");
            return;
        }
    };
    let (scans, refused) = (recording.scans(), &recording.refused);
    let lines = data.split(|byte| matches!(byte, b'\n' | b'\r')).count() as u64;
    assert!(scans > 0 && scans as u64 + refused.rows < lines, "{scans} scans, {} refused, {lines} lines", refused.rows);
    assert!(recording.time_s.iter().all(|time| time.is_finite()));
    assert_eq!(recording.lines.len(), scans);
    assert!(recording.lines.is_sorted() && recording.lines.iter().all(|line| (1..=lines).contains(line)));
    let told = refused.told.len() as u64;
    assert_eq!(told, (refused.rows + refused.cells).min(5), "the first few are told");
    let is_line = |line: &String| !line.is_empty() && line.len() < 1_000 && !line.contains(char::is_control);
    assert!(refused.told.iter().all(is_line), "{:?}", refused.told);
    let columns: Vec<&Column> = recording.pressure_kpa.iter().chain(&recording.counts).collect();
    columns.iter().for_each(|column| check(column, scans));
    let missing = columns.iter().flat_map(|column| &column.hi).filter(|value| value.is_nan()).count() as u64;
    assert!(refused.cells <= missing, "a cell that is no number is missing");
    check_written(&recording, &columns);
}

/// As many values as scans, each finite or missing, and rests smaller than half a step of their double.
fn check(column: &Column, scans: usize) {
    assert_eq!(column.hi.len(), scans);
    assert!(column.hi.iter().all(|value| !value.is_infinite()));
    if let Some(rests) = &column.lo {
        assert_eq!(rests.len(), scans);
        for (value, rest) in column.hi.iter().zip(rests) {
            assert!(rest.is_finite(), "{value} and {rest}");
            assert!(value.is_nan() || value + rest == *value, "{rest} is no rest of {value}");
        }
    }
}

/// A table of the nearest doubles is read as these doubles.
fn check_written(recording: &Recording, columns: &[&Column]) {
    let mut text = String::from("t_s");
    text += if recording.pressure_kpa.is_some() { ",pressure_kpa" } else { "" };
    (0..recording.counts.len()).for_each(|taxel| text += &format!(",c{taxel}"));
    for (row, time) in recording.time_s.iter().enumerate() {
        text += &format!("\n{time:?}");
        for column in columns {
            let value = column.hi[row];
            text += &if value.is_nan() { ",".to_owned() } else { format!(",{value:?}") };
        }
    }
    let again = Recording::parse(text.as_bytes()).expect("what was written is read");
    assert_eq!((again.refused.rows, again.refused.cells), (0, 0));
    assert_eq!(again.time_s, recording.time_s);
    for (column, expected) in again.pressure_kpa.iter().chain(&again.counts).zip(columns) {
        let bits = |column: &Column| column.hi.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let missing = |column: &Column| column.hi.iter().map(|value| value.is_nan()).collect::<Vec<_>>();
        assert_eq!(missing(column), missing(expected));
        let same = column.hi.iter().zip(&expected.hi).all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan());
        assert!(same, "{:?} became {:?}", bits(expected), bits(column));
    }
}
