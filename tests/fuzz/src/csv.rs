//! DATA.csv of `taxel-lab fit` and `taxel-lab apply`.

use taxel_lab::recording::Recording;

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
    let columns: Vec<&Vec<f64>> = recording.pressure_kpa.iter().chain(&recording.counts).collect();
    assert!(columns.iter().all(|column| column.len() == scans && !column.iter().any(|value| value.is_infinite())));
    let missing = columns.iter().copied().flatten().filter(|value| value.is_nan()).count() as u64;
    assert!(refused.cells <= missing, "a cell that is no number is missing");
}
