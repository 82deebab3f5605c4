//! The true force over the last seconds.

use std::collections::VecDeque;
use std::time::Duration;

use taxel_skin::Time;

/// What may lie between the skin and the newest frame of a sample: one conversion (36.9 ms), one period (50 ms), and the
/// way over the bus of a scan, with what a slot of the simulation cuts off.
pub const AGE_MAX: Duration = Duration::from_millis(110);
/// Longer than any stall of a story, with the longest watch of a zero before it.
const KEPT: Duration = Duration::from_secs(10);

/// True forces in newton, oldest first; between two of them it changes linearly or not at all.
#[derive(Debug, Default)]
pub struct Truth {
    seen: VecDeque<(Time, f64)>,
}

impl Truth {
    pub fn note(&mut self, now: Time, newton: f64) {
        self.seen.push_back((now, newton));
        while self.seen.front().is_some_and(|(time, _)| *time < now - KEPT) {
            self.seen.pop_front();
        }
    }

    /// Least and greatest force from one time to another, both ends included.
    pub fn range(&self, from: Time, to: Time) -> (f64, f64) {
        let mut range = (f64::INFINITY, f64::NEG_INFINITY);
        for (place, &(time, newton)) in self.seen.iter().enumerate().rev() {
            if place > 0 && self.seen[place - 1].0 >= to && time > to {
                continue;
            }
            range = (range.0.min(newton), range.1.max(newton));
            if time <= from {
                break;
            }
        }
        range
    }

    pub fn newest(&self) -> f64 {
        self.seen.back().map_or(0.0, |(_, newton)| *newton)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_brackets_its_ends_and_no_more() {
        let mut truth = Truth::default();
        let at = |n: i64| Time::from_nanos(n * 10);
        (0..20).for_each(|n| truth.note(at(n), n as f64));
        assert_eq!(truth.range(at(5), at(9)), (5.0, 9.0));
        assert_eq!(truth.range(Time::from_nanos(53), Time::from_nanos(88)), (5.0, 9.0));
        assert_eq!(truth.range(at(17), at(40)), (17.0, 19.0));
    }

    #[test]
    fn a_sudden_change_is_in_the_range_from_both_sides() {
        let mut truth = Truth::default();
        for newton in [0.0, 0.0, 5.0, 5.0] {
            let now = Time::from_nanos(if newton > 0.0 { 10 } else { 0 });
            truth.note(now, newton);
        }
        assert_eq!(truth.range(Time::from_nanos(0), Time::from_nanos(10)), (0.0, 5.0));
    }
}
