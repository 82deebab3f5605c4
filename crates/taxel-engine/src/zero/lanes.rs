//! The evidence of continuity of sixteen taxels at a time, as columns that the compiler makes vector instructions of.

use crate::zero::inputs::{Block, LANES};

/// One input counts for at most so much.
pub const EVIDENCE_MAX: f32 = 16.0;

type Column = [f32; LANES];

/// What the test compares taxels with, worked out once for each zero. A taxel that takes no part has zeros.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reference {
    /// +1 where the count rises with pressure, -1 where it falls.
    sign: Column,
    /// The zero times the sign, counts.
    zero: Column,
    /// One over the variances of the means over 1, 4 and 16 scans, per counts squared.
    per_variance: [Column; 3],
    /// Counts from the zero from which on it is touched.
    touched: Column,
}

impl Reference {
    /// Says what the taxel in lane `i` is compared with.
    pub fn set(&mut self, i: usize, sign: f64, zero: f64, per_variance: [f64; 3], touched: f64) {
        self.sign[i] = sign as f32;
        self.zero[i] = (sign * zero) as f32;
        self.touched[i] = touched as f32;
        for (column, value) in self.per_variance.iter_mut().zip(per_variance) {
            column[i] = value as f32;
        }
    }

    /// The load on the taxel in lane `i`, if it was touched: its counts in units then and now, and 1. Zeros if it was not.
    #[must_use]
    pub fn load(&self, i: usize, then: f32, now: f32) -> [f32; 3] {
        let [then, now] = [then, now].map(|count| self.sign[i] * count - self.zero[i]);
        if self.sign[i] != 0.0 && then > self.touched[i] { [then, now.max(0.0), 1.0] } else { [0.0; 3] }
    }
}

/// Sums over the taxels of a board, lane by lane.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    evidence: [Column; 3],
    taxels: Column,
    was: Column,
    is: Column,
    touched: Column,
}

impl Sums {
    /// Adds the taxels of a block. One that is not sound, or takes no part, adds nothing.
    pub fn add(&mut self, reference: &Reference, block: &Block) {
        let Reference { sign, zero, per_variance, touched } = reference;
        let Block { newest, before, quarter, whole, .. } = block;
        let takes_part: Column =
            std::array::from_fn(|i| if (block.unsound[i] == 0) & (sign[i] != 0.0) { 1.0 } else { 0.0 });
        // The zero where there is no recent mean yet: a comparison with NaN is false.
        let least: Column = std::array::from_fn(|i| {
            let recent = sign[i] * block.recent[i];
            if recent < zero[i] { recent } else { zero[i] }
        });
        for (sums, (mean, per_variance)) in
            self.evidence.iter_mut().zip([(newest, 1.0), (quarter, 0.25), (whole, 0.0625)].iter().zip(per_variance))
        {
            for i in 0..LANES {
                let away = least[i] - sign[i] * (mean.0[i] * mean.1);
                let away = if away > 0.0 { away } else { 0.0 };
                let square = away * away * per_variance[i];
                let square = if square < EVIDENCE_MAX { square } else { EVIDENCE_MAX };
                sums[i] += square * takes_part[i];
            }
        }
        for i in 0..LANES {
            self.taxels[i] += takes_part[i];
            let then = sign[i] * (0.25 * before[i]) - zero[i];
            let now = sign[i] * newest[i] - zero[i];
            let share = if then > touched[i] { takes_part[i] } else { 0.0 };
            self.was[i] += then * share;
            self.is[i] += if now > 0.0 { now } else { 0.0 } * share;
            self.touched[i] += share;
        }
    }

    /// The evidence of the means over 1, 4 and 16 scans.
    #[must_use]
    pub fn evidence(&self) -> [f32; 3] {
        self.evidence.map(|column| column.iter().sum())
    }

    /// How many taxels took part.
    #[must_use]
    pub fn taxels(&self) -> f32 {
        self.taxels.iter().sum()
    }

    /// The load on taxels that were touched in the scans before, counts: then and now; and how many taxels these are.
    #[must_use]
    pub fn load(&self) -> [f32; 3] {
        [self.was, self.is, self.touched].map(|column| column.iter().sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_load_of_a_taxel_is_what_presses_on_a_touched_one() {
        let mut reference = Reference::default();
        reference.set(0, -1.0, 240.0, [1.0; 3], 4.0);
        assert_eq!(reference.load(0, 230.0, 238.0), [10.0, 2.0, 1.0]);
        assert_eq!(reference.load(0, 230.0, 242.0), [10.0, 0.0, 1.0], "less than nothing presses on none");
        assert_eq!(reference.load(0, 237.0, 230.0), [0.0; 3], "it was not touched");
        reference.set(1, 0.0, f64::NAN, [0.0; 3], -1.0);
        assert_eq!(reference.load(1, 230.0, 200.0), [0.0; 3], "nobody knows which way pressure moves it");
    }

    proptest! {
        #[test]
        fn lanes_give_what_one_taxel_after_the_other_gives(
            taxels in proptest::collection::vec((any::<u8>(), 0..1_021_u16, 0..1_021_u16, 0..4_081_u16, 0..2_u8,
                prop_oneof![Just(f32::NAN), 0.0..255.0_f32], -1..2_i8, 0.0..255.0_f64), LANES)
        ) {
            let (mut reference, mut block) = (Reference::default(), Block::default());
            let (mut evidence, mut count, mut load) = ([0.0_f64; 3], 0.0, [0.0_f64; 3]);
            for (i, &(newest, before, quarter, whole, unsound, recent, sign, zero)) in taxels.iter().enumerate() {
                if sign != 0 {
                    reference.set(i, f64::from(sign), zero, [1.0, 2.0, 3.0], 4.0);
                }
                (block.newest[i], block.before[i], block.unsound[i]) = (newest.into(), before.into(), unsound);
                (block.quarter[i], block.whole[i], block.recent[i]) = (quarter.into(), whole.into(), recent);
                if sign == 0 || unsound > 0 {
                    continue;
                }
                let (sign, recent) = (f64::from(sign), f64::from(recent));
                let means = [f64::from(newest), f64::from(quarter) / 4.0, f64::from(whole) / 16.0];
                for (k, mean) in means.into_iter().enumerate() {
                    let away = ((sign * zero).min(sign * recent) - sign * mean).max(0.0);
                    evidence[k] += (away * away * (k + 1) as f64).min(16.0);
                }
                count += 1.0;
                let then = sign * (f64::from(before) / 4.0 - zero);
                if then > 4.0 {
                    load[0] += then;
                    load[1] += (sign * (f64::from(newest) - zero)).max(0.0);
                    load[2] += 1.0;
                }
            }
            let mut sums = Sums::default();
            sums.add(&reference, &block);
            let near = |a: f32, b: f64| (f64::from(a) - b).abs() <= 1e-2 * b.max(1.0);
            prop_assert!(sums.evidence().into_iter().zip(evidence).all(|(a, b)| near(a, b)), "{sums:?} {evidence:?}");
            prop_assert_eq!(sums.taxels(), count);
            prop_assert!(sums.load().into_iter().zip(load).all(|(a, b)| near(a, b)), "{sums:?} {load:?}");
        }
    }
}
