//! Names of recordings: `taxeld-00000012-20261122T071402Z.mcap`, by number and then by the moment of their beginning.
//!
//! The number orders them: the clock of a robot that was just switched on may say anything.

use std::fmt;

use prost_types::Timestamp;

const PREFIX: &str = "taxeld-";
const SUFFIX: &str = ".mcap";

/// The name of a recording.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FileName {
    number: u32,
    moment: String,
}

impl FileName {
    /// The name of the recording of this number that begins at so many nanoseconds since 1970.
    #[must_use]
    pub fn new(number: u32, wall_ns: i64) -> Self {
        Self { number, moment: moment(wall_ns.div_euclid(1_000_000_000)) }
    }

    /// The name that a file has; `None` if it is none of ours.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        let (number, moment) = name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)?.split_once('-')?;
        // As in `20261122T071402Z`.
        let pattern = |byte: u8| if byte.is_ascii_digit() { b'0' } else { byte };
        let is_moment = moment.bytes().map(pattern).eq(*b"00000000T000000Z");
        let ours = Self { number: number.parse().ok()?, moment: moment.to_owned() };
        (is_moment && ours.to_string() == name).then_some(ours)
    }

    /// Its number.
    #[must_use]
    pub const fn number(&self) -> u32 {
        self.number
    }
}

impl fmt::Display for FileName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{PREFIX}{:08}-{}{SUFFIX}", self.number, self.moment)
    }
}

/// A moment in UTC: RFC 3339 without what separates its parts.
fn moment(seconds: i64) -> String {
    Timestamp { seconds, nanos: 0 }.to_string().replace(['-', ':'], "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_calendar() {
        for (seconds, expected) in [
            (0, "19700101T000000Z"),
            (951_782_399, "20000228T235959Z"),
            (951_782_400, "20000229T000000Z"),
            (1_795_331_642, "20261122T071402Z"),
            (-1, "19691231T235959Z"),
            (i64::MAX / 1_000_000_000, "22620411T234716Z"),
        ] {
            assert_eq!(moment(seconds), expected);
        }
    }

    #[test]
    fn a_name_is_read_as_it_is_written_and_no_other_file_has_one() {
        for number in [0, 12, 99_999_999, 100_000_000, u32::MAX] {
            let name = FileName::new(number, 0);
            assert_eq!(FileName::parse(&name.to_string()), Some(name));
        }
        assert_eq!(FileName::parse("taxeld-000000012-20260101T000000Z.mcap"), None, "not as it is written");
        let name = FileName::new(12, 1_795_331_642_500_000_000);
        assert_eq!(name.to_string(), "taxeld-00000012-20261122T071402Z.mcap");
        assert_eq!(FileName::parse(&name.to_string()), Some(name));
        for other in [
            "taxeld-00000012-20261122T071402Z.mcap.bak",
            "taxeld-12-20261122T071402Z.mcap",
            "taxeld-+0000012-20261122T071402Z.mcap",
            "taxeld-00000012-2026112207140200.mcap",
            "taxeld-00000012.mcap",
            "mine.mcap",
        ] {
            assert_eq!(FileName::parse(other), None, "{other}");
        }
    }
}
