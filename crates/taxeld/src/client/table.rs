//! What several commands print for people: columns and moments.

use chrono::{DateTime, Local};

/// Prints rows under a header, each column as wide as its widest cell; the last one is not padded.
pub fn print(header: &[&str], rows: &[Vec<String>]) {
    lines(header, rows).iter().for_each(|line| say!("{line}"));
}

fn lines(header: &[&str], rows: &[Vec<String>]) -> Vec<String> {
    let header: Vec<String> = header.iter().map(|cell| (*cell).to_owned()).collect();
    let all = || std::iter::once(&header).chain(rows);
    let width = |column: usize| all().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..header.len()).map(|column| width(column).unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    all().map(line).collect()
}

/// A moment by the clock on the wall here; empty if there is none.
pub fn moment(time: Option<&taxel_proto::Timestamp>) -> String {
    let utc = time.and_then(|time| DateTime::from_timestamp(time.seconds, 0));
    utc.map(|utc| utc.with_timezone(&Local).format("%Y-%m-%d %H:%M:%S").to_string()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [vec!["1".to_owned(), "left_forearm".to_owned()], vec!["12".to_owned(), String::new()]];
        assert_eq!(lines(&["id", "patch"], &rows), ["id  patch", "1   left_forearm", "12"]);
    }
}
