//! The true force over the last seconds.

use std::collections::VecDeque;
use std::time::Duration;

use taxel_skin::Time;

/// What may lie between the skin and the newest frame of a sample: one conversion (36.9 ms), one period (50 ms), and the
/// way over the bus of a scan, with what a slot of the simulation cuts off.
pub const AGE_MAX: Duration = Duration::from_millis(110);
/// As [`AGE_MAX`] for a module that is not heard any more: it is silent after 150 ms.
pub const HEARD_MAX: Duration = Duration::from_millis(210);
/// A force that changes by less than this share and a trifle is steady.
const STEADY_SHARE: f64 = 0.02;
/// Less than this is nothing, in newton: a vented bag presses with ever less, but for ever.
pub const TRIFLE_N: f64 = 0.01;
/// Longer than any stall of a story, with the longest watch of a zero before it.
const KEPT: Duration = Duration::from_secs(10);

/// True forces in newton, oldest first; between two of them it changes linearly or not at all.
#[derive(Debug, Default)]
pub struct Truth {
    seen: VecDeque<(Time, f64)>,
    /// A force and since when it has been no other, within [`STEADY_SHARE`].
    steady: (f64, Time),
    /// The same of each module; while nothing changes there is one entry.
    by_module: VecDeque<(Time, Box<[f64]>)>,
}

impl Truth {
    pub fn note(&mut self, now: Time, newton: f64) {
        self.seen.push_back((now, newton));
        if (newton - self.steady.0).abs() > STEADY_SHARE * self.steady.0 + TRIFLE_N {
            self.steady = (newton, now);
        }
        while self.seen.front().is_some_and(|(time, _)| *time < now - KEPT) {
            self.seen.pop_front();
        }
    }

    /// What bears on each module, in newton.
    pub fn note_modules(&mut self, now: Time, newton: Box<[f64]>) {
        self.by_module.push_back((now, newton));
        // What was before the longest span that is asked for is that of its beginning.
        while self.by_module.get(1).is_some_and(|(time, _)| *time < now - 2 * HEARD_MAX) {
            self.by_module.pop_front();
        }
    }

    /// Least and greatest sum over the modules, each of them as it was at some time from one to the other.
    pub fn range_of_modules(&self, from: Time, to: Time) -> (f64, f64) {
        let first = self.by_module.partition_point(|(time, _)| *time <= from).saturating_sub(1);
        let within = || self.by_module.range(first..).take_while(|(time, _)| *time <= to).map(|(_, newton)| newton);
        let modules = within().next().map_or(0, |newton| newton.len());
        let of_one = |module: usize| {
            within()
                .map(|newton| newton[module])
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), newton| {
                    (newton.min(least), newton.max(greatest))
                })
        };
        (0..modules).map(of_one).fold((0.0, 0.0), |sum, of_one| (sum.0 + of_one.0, sum.1 + of_one.1))
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

    /// The newest force, if it has stood still for so long.
    pub fn steady(&self, now: Time, span: Duration) -> Option<f64> {
        (now.since(self.steady.1) >= span).then(|| self.newest())
    }

    pub fn newest(&self) -> f64 {
        self.seen.back().map_or(0.0, |(_, newton)| *newton)
    }
}
