//! The time of a line: seconds, or a date.

use std::ops::RangeInclusive;

use taxel_skin::Time;

use super::cursor::Cursor;
use super::line::{LogError, NANOS_PER_SECOND};

impl Cursor<'_> {
    /// `(1600000000.000120)`, or `(2020-09-13 12:26:40.000120)`.
    pub(super) fn time(&mut self) -> Result<Time, LogError> {
        self.take(b'(', "`(` and a time: record with `candump -l` or `candump -ta`")?;
        let out_of_range = LogError::TimeRange { column: self.at + 1 };
        let is_date = self.line.get(self.at + 4) == Some(&b'-');
        let seconds = if is_date { self.date()? } else { self.seconds(out_of_range)? };
        self.take(b'.', "`.` and the fraction of the seconds")?;
        let nanos = self.fraction()?;
        self.take(b')', "`)` after one to nine digits of the fraction")?;
        let total = seconds.checked_mul(NANOS_PER_SECOND).and_then(|whole| whole.checked_add(nanos));
        total.map(Time::from_nanos).ok_or(out_of_range)
    }

    fn seconds(&mut self, out_of_range: LogError) -> Result<i64, LogError> {
        let mut seconds = self.digit().ok_or_else(|| self.refuse("a digit of the seconds"))?;
        while let Some(digit) = self.digit() {
            // Bounded here, so that no number of digits overflows.
            if seconds > i64::MAX / NANOS_PER_SECOND {
                return Err(out_of_range);
            }
            seconds = seconds * 10 + digit;
        }
        Ok(seconds)
    }

    /// Nanoseconds.
    fn fraction(&mut self) -> Result<i64, LogError> {
        let mut nanos = 0;
        let mut unit = NANOS_PER_SECOND;
        while unit > 1 {
            let Some(digit) = self.digit() else { break };
            unit /= 10;
            nanos += digit * unit;
        }
        if unit == NANOS_PER_SECOND {
            return Err(self.refuse("a digit of the fraction"));
        }
        Ok(nanos)
    }

    /// Seconds since 1970, as if the date were one of UTC.
    fn date(&mut self) -> Result<i64, LogError> {
        let year = self.number(4, 1970..=9999, "a year from 1970")?;
        self.take(b'-', "`-` and the month")?;
        let month = self.number(2, 1..=12, "a month from 01 to 12")?;
        self.take(b'-', "`-` and the day")?;
        let day = self.number(2, 1..=days_in(year, month), "a day of that month")?;
        self.take(b' ', "a space and the hour")?;
        let hour = self.number(2, 0..=23, "an hour from 00 to 23")?;
        self.take(b':', "`:` and the minute")?;
        let minute = self.number(2, 0..=59, "a minute from 00 to 59")?;
        self.take(b':', "`:` and the second")?;
        // 60 is a leap second.
        let second = self.number(2, 0..=60, "a second from 00 to 60")?;
        Ok(((days_before(year, month) + day - 1) * 24 + hour) * 3600 + minute * 60 + second)
    }

    fn number(&mut self, digits: usize, range: RangeInclusive<i64>, expected: &'static str) -> Result<i64, LogError> {
        let start = self.at;
        let mut number = 0;
        for _ in 0..digits {
            number = 10 * number + self.digit().ok_or_else(|| self.refuse(expected))?;
        }
        if !range.contains(&number) {
            self.at = start;
            return Err(self.refuse(expected));
        }
        Ok(number)
    }
}

fn is_leap(year: i64) -> bool {
    year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)
}

fn days_in(year: i64, month: i64) -> i64 {
    match month {
        2 => 28 + i64::from(is_leap(year)),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days from 1970 to the beginning of a month.
fn days_before(year: i64, month: i64) -> i64 {
    let leap_years = |until: i64| until / 4 - until / 100 + until / 400;
    let of_years = 365 * (year - 1970) + leap_years(year - 1) - leap_years(1969);
    of_years + (1..month).map(|month| days_in(year, month)).sum::<i64>()
}
