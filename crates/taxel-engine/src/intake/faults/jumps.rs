//! How far the taxels of a module jump together, there and back, faster than anything that is pressed and let go.
//!
//! A converter that flickers moves all taxels of its module at once, by less than any of them alone would be reported for. What
//! comes and goes within one conversion is no known load: half of the way is what each reading may be off by, for nothing
//! that stays within a range has a standard deviation of more than half of that (Popoviciu's inequality). One such jump is a
//! blow; two of them within seconds count, by the lesser. What stays for two conversions looks like a touch, and is none of these.

use std::time::Duration;
use taxel_skin::Time;

/// So long a jump counts.
const KEPT: Duration = Duration::from_secs(20);

/// So many of the newest are kept.
const NEWEST: usize = 8;

/// Least jump, in counts, and in standard deviations of the mean of the module's taxels. Normal noise makes two so great ones of
/// a module within twenty seconds once in 120 hours, at 27 conversions a second.
const LEAST_COUNTS: f32 = 1.5;
const LEAST_DEVIATIONS: f32 = 5.0;

/// The jumps of one module.
#[derive(Clone, Debug, Default)]
pub(super) struct ModuleJumps {
    /// Standard deviation of one taxel at rest, counts.
    noise: f32,
    /// Of the last scan: the sum of the counts, over how many taxels, and how far their mean has moved last.
    sum: f32,
    taxels: u32,
    last_change: f32,
    /// When, and by how much, at first by nothing; the oldest is at `oldest`.
    kept: [(Time, f32); NEWEST],
    oldest: usize,
}

impl ModuleJumps {
    /// So much noise has each of the module's taxels at rest, counts; what is no number is not known.
    pub(super) fn expect_noise(&mut self, noise: f32) {
        self.noise = if noise.is_finite() { noise } else { 0.0 };
    }

    /// What was before says nothing of what comes.
    pub(super) fn forget(&mut self) {
        (self.taxels, self.last_change) = (0, 0.0);
    }

    /// The sum of the counts of the taxels that are sound, and how many these are. Others than before say nothing of a change.
    pub(super) fn on_scan(&mut self, now: Time, sum: f32, taxels: u32) {
        if taxels == 0 {
            return;
        }
        if taxels != self.taxels {
            self.forget();
        } else if sum != self.sum {
            self.on_change(now, (sum - self.sum) / taxels as f32);
        }
        (self.sum, self.taxels) = (sum, taxels);
    }

    /// The mean of the taxels has changed by so many counts since the last conversion.
    fn on_change(&mut self, now: Time, change: f32) {
        let before = std::mem::replace(&mut self.last_change, change);
        let jump = (-before * change.signum()).min(change.abs()); // below 0 where it goes on the same way
        if jump >= LEAST_COUNTS.max(LEAST_DEVIATIONS * self.noise / (self.taxels.max(1) as f32).sqrt()) {
            self.kept[self.oldest] = (now, jump);
            self.oldest = (self.oldest + 1) % NEWEST;
        }
    }

    /// By how much it jumps now, counts; 0 nearly always.
    pub(super) fn counts(&self, now: Time) -> f32 {
        let newest = self.kept[(self.oldest + NEWEST - 1) % NEWEST];
        if now >= newest.0 + KEPT {
            return 0.0;
        }
        let lasting = self.kept.iter().filter(|kept| now < kept.0 + KEPT).map(|kept| kept.1);
        let two = |[first, second]: [f32; 2], jump: f32| [first.max(jump), second.max(first.min(jump))];
        lasting.fold([0.0; 2], two)[1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(conversion: u32) -> Time {
        Time::from_nanos(37_000_000 * i64::from(conversion))
    }

    /// Feeds changes, one in each conversion, and says by how much it jumps after the last of them.
    fn after(jumps: &mut ModuleJumps, changes: &[f32]) -> f32 {
        for (conversion, change) in (0..).zip(changes) {
            jumps.on_change(at(conversion), *change);
        }
        jumps.counts(at(changes.len() as u32))
    }

    #[test]
    fn there_and_back_twice_is_a_jump_by_the_lesser_of_them() {
        for (changes, counts) in [
            (&[6.0, -6.0][..], 0.0),
            (&[6.0, -6.0, 0.2, 4.0, -5.0], 4.0),
            (&[6.0, -6.0, 6.0], 6.0),
            (&[-3.0, 3.0, -8.0, 8.0, -2.0], 3.0),
            (&[1.4, -1.4, 1.4, -1.4, 1.4], 0.0),
            (&[20.0, -0.3, 0.2, 0.3, -20.0, 0.3, 20.0, -0.4, -20.0], 0.0),
            (&[5.0, 5.0, 5.0, -5.0, -5.0, 5.0], 5.0),
        ] {
            assert_eq!(after(&mut ModuleJumps::default(), changes), counts, "{changes:?}");
        }
    }

    #[test]
    fn a_jump_counts_for_twenty_seconds() {
        let mut jumps = ModuleJumps::default();
        let at = |ms: i64| Time::from_nanos(ms * 1_000_000);
        for (ms, change) in [(0, 9.0), (40, -9.0), (1_000, 4.0), (1_040, -4.0), (2_000, 6.0), (2_040, -6.0)] {
            jumps.on_change(at(ms), change);
        }
        // From -9 to 4 and from -4 to 6 are jumps, too, by 4 counts both.
        assert_eq!(jumps.counts(at(2_100)), 6.0);
        assert_eq!(jumps.counts(at(20_039)), 6.0);
        assert_eq!(jumps.counts(at(20_040)), 4.0);
        assert_eq!(jumps.counts(at(22_039)), 0.0, "one is left");
        assert_eq!(jumps.counts(at(22_040)), 0.0);
    }

    #[test]
    fn other_taxels_than_before_show_no_jump_and_none_at_all_change_nothing() {
        let after = |scans: &[(f32, u32)]| {
            let mut jumps = ModuleJumps::default();
            (0..).zip(scans).for_each(|(conversion, &(sum, taxels))| jumps.on_scan(at(conversion), sum, taxels));
            jumps.counts(at(scans.len() as u32))
        };
        assert_eq!(after(&[(2400.0, 10), (2340.0, 10), (2400.0, 10), (2400.0, 10), (2340.0, 10)]), 6.0);
        assert_eq!(after(&[(2400.0, 10), (2340.0, 10), (0.0, 0), (2400.0, 10), (2340.0, 10)]), 6.0);
        assert_eq!(after(&[(2400.0, 10), (2100.0, 9), (2400.0, 10), (2100.0, 9), (2400.0, 10)]), 0.0);
    }
}
