//! What several commands print for people: columns and moments.

use chrono::{DateTime, Local};
use taxel_skin::columns;

/// Prints rows under a header.
pub fn print(header: &[&str], rows: &[Vec<String>]) {
    columns(header, rows).iter().for_each(|line| say!("{line}"));
}

/// A moment by the clock on the wall here; empty if there is none.
pub fn moment(time: Option<&taxel_proto::Timestamp>) -> String {
    let utc = time.and_then(|time| DateTime::from_timestamp(time.seconds, 0));
    utc.map(|utc| utc.with_timezone(&Local).format("%Y-%m-%d %H:%M:%S").to_string()).unwrap_or_default()
}
