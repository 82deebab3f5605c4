//! What several commands print for people: columns, moments, and how something is. `say` leaves the colour out where there is no
//! terminal, or `NO_COLOR` is set.

use chrono::{DateTime, Local};
use taxel_skin::columns;

/// Prints rows under a header.
pub fn print(header: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    columns(header, &rows.collect::<Vec<_>>()).iter().for_each(|line| say!("{line}"));
}

/// A moment by the clock on the wall here; empty if there is none.
pub fn moment(time: Option<&taxel_proto::Timestamp>) -> String {
    let utc = time.and_then(|time| DateTime::from_timestamp(time.seconds, 0));
    utc.map(|utc| utc.with_timezone(&Local).format("%Y-%m-%d %H:%M:%S").to_string()).unwrap_or_default()
}

/// How something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Usable, with a reservation.
    Warn,
    /// Not usable.
    Bad,
}

impl Tone {
    /// The text in this tone.
    pub fn paint(self, text: &str) -> String {
        let colour = match self {
            Self::Good => 32,
            Self::Warn => 33,
            Self::Bad => 31,
        };
        format!("\x1b[1;{colour}m{text}\x1b[0m")
    }
}
