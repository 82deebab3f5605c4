//! The last sixteen scans of some inputs, and their means over four and sixteen of them, all in whole counts.
//!
//! Everything is in columns of one kind, so that the compiler makes vector instructions of each loop.

use std::ops::Range;

/// Scans that are kept.
pub const KEPT: usize = 16;
/// Scans of the shorter mean.
const QUARTER: usize = 4;
/// Weight of a scan in the recent mean: 40 scans.
const RECENT_SHARE: f32 = 1.0 / 40.0;

/// Inputs that are looked at side by side.
pub const LANES: usize = 16;

/// What is known of up to [`LANES`] inputs; zeros where there are fewer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    /// Counts of the newest scan.
    pub newest: [u8; LANES],
    /// Sums over four scans: those before the newest but one.
    pub before: [u16; LANES],
    /// Sums over the last 4 scans.
    pub quarter: [u16; LANES],
    /// Sums over the last 16 scans.
    pub whole: [u16; LANES],
    /// Mean over the scans before the last 16; NaN before there is one.
    pub recent: [f32; LANES],
    /// Scans until all of the last 16 were sound.
    pub unsound: [u8; LANES],
}

/// Taxels or pads of a patch, scan by scan.
#[derive(Clone, Debug)]
pub struct Inputs {
    inputs: usize,
    /// Counts of the last scans, one row each; the newest is row `at`. Rows before the first scan are zero.
    rows: Vec<u8>,
    at: usize,
    scans: usize,
    /// Sums over the last 4 and 16 scans.
    quarter: Vec<u16>,
    whole: Vec<u16>,
    /// What `quarter` was one scan and two scans ago.
    earlier: [Vec<u16>; 2],
    /// Mean over the scans before the last 16; NaN before there is one.
    recent: Vec<f32>,
    /// Scans until all of the last 16 were sound.
    unsound: Vec<u8>,
}

impl Inputs {
    /// So many inputs, without a scan.
    #[must_use]
    pub fn new(inputs: usize) -> Self {
        Self {
            inputs,
            rows: vec![0; KEPT * inputs],
            at: 0,
            scans: 0,
            quarter: vec![0; inputs],
            earlier: [vec![0; inputs], vec![0; inputs]],
            whole: vec![0; inputs],
            recent: vec![f32::NAN; inputs],
            unsound: vec![0; inputs],
        }
    }

    /// Forgets everything.
    pub fn begin(&mut self) {
        self.rows.fill(0);
        self.quarter.fill(0);
        self.earlier.iter_mut().for_each(|sums| sums.fill(0));
        self.whole.fill(0);
        self.recent.fill(f32::NAN);
        self.unsound.fill(0);
        self.scans = 0;
    }

    /// Takes a scan: one count per input, and whether it may be believed.
    pub fn push(&mut self, counts: &[u8], sound: &[bool]) {
        let fourth = self.row_number(QUARTER - 1);
        self.earlier.swap(0, 1);
        self.earlier[0].copy_from_slice(&self.quarter);
        self.at = (self.at + 1) % KEPT;
        let full = self.scans >= KEPT;
        self.scans = self.scans.saturating_add(1);
        let (inputs, newest) = (self.inputs, self.at * self.inputs);
        let columns = self.quarter.iter_mut().zip(&mut self.whole).zip(counts);
        let leave = self.rows[fourth * inputs..][..inputs].iter().zip(&self.rows[newest..][..inputs]);
        for (((quarter, whole), &count), (&leaves_quarter, &leaves)) in columns.zip(leave) {
            *quarter = quarter.wrapping_add(u16::from(count)).wrapping_sub(u16::from(leaves_quarter));
            *whole = whole.wrapping_add(u16::from(count)).wrapping_sub(u16::from(leaves));
        }
        if full {
            let leaves = &self.rows[newest..][..inputs];
            for ((recent, &leaves), &unsound) in self.recent.iter_mut().zip(leaves).zip(&self.unsound) {
                let leaves = f32::from(leaves);
                let next = if recent.is_nan() { leaves } else { *recent + RECENT_SHARE * (leaves - *recent) };
                *recent = if unsound == 0 { next } else { *recent };
            }
        }
        for (unsound, &sound) in self.unsound.iter_mut().zip(sound) {
            *unsound = if sound { unsound.saturating_sub(1) } else { KEPT as u8 };
        }
        let length = inputs.min(counts.len());
        self.rows[newest..][..length].copy_from_slice(&counts[..length]);
    }

    /// The row that was filled `back` scans ago.
    fn row_number(&self, back: usize) -> usize {
        (self.at + KEPT - back) % KEPT
    }

    /// Scans taken.
    #[must_use]
    pub const fn scans(&self) -> usize {
        self.scans
    }

    /// Counts of the newest scan.
    #[must_use]
    pub fn newest(&self) -> &[u8] {
        &self.rows[self.at * self.inputs..][..self.inputs]
    }

    /// Sums over the last 4 and the last 16 scans.
    #[must_use]
    pub fn sums(&self) -> [&[u16]; 2] {
        [&self.quarter, &self.whole]
    }

    /// The mean over the scans before the last 16.
    #[must_use]
    pub fn recent(&self) -> &[f32] {
        &self.recent
    }

    /// The inputs of a range of at most [`LANES`].
    #[must_use]
    pub fn block(&self, range: Range<usize>) -> Block {
        Block {
            newest: lanes(self.newest(), &range),
            // The boards' scans are cut anew now and then, so that the newest but one may be of two.
            before: lanes(&self.earlier[1], &range),
            quarter: lanes(&self.quarter, &range),
            whole: lanes(&self.whole, &range),
            recent: lanes(&self.recent, &range),
            unsound: lanes(&self.unsound, &range),
        }
    }

    /// Scans until all of the last 16 were sound.
    #[must_use]
    pub fn unsound(&self) -> &[u8] {
        &self.unsound
    }
}

/// The values of a range of at most [`LANES`], filled up with zeros.
fn lanes<T: Copy + Default>(values: &[T], range: &Range<usize>) -> [T; LANES] {
    if let Some(whole) = values.get(range.clone()).and_then(|values| values.first_chunk::<LANES>()) {
        return *whole;
    }
    let mut lanes = [T::default(); LANES];
    lanes.iter_mut().zip(values.get(range.clone()).unwrap_or_default()).for_each(|(lane, value)| *lane = *value);
    lanes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_and_recent_means_are_those_of_the_plain_history(counts in proptest::collection::vec(any::<u8>(), 1..80)) {
            let mut inputs = Inputs::new(1);
            inputs.push(&[77], &[true]);
            inputs.begin();
            for (k, &count) in counts.iter().enumerate() {
                inputs.push(&[count], &[true]);
                let last = |scans: usize| {
                    counts[(k + 1).saturating_sub(scans)..=k].iter().map(|c| u16::from(*c)).sum::<u16>()
                };
                prop_assert_eq!(inputs.sums().map(|sum| sum[0]), [last(4), last(16)]);
                let mut recent = f32::NAN;
                for &count in &counts[..(k + 1).saturating_sub(KEPT)] {
                    let count = f32::from(count);
                    recent = if recent.is_nan() { count } else { recent + (count - recent) / 40.0 };
                }
                prop_assert!((inputs.recent()[0] - recent).abs() < 1e-3 || recent.is_nan());
                prop_assert_eq!(inputs.recent()[0].is_nan(), recent.is_nan());
            }
        }
    }

    #[test]
    fn an_unsound_input_is_out_for_sixteen_scans_and_leaves_the_recent_mean_alone() {
        let mut inputs = Inputs::new(2);
        (0..17).for_each(|_| inputs.push(&[200, 200], &[true, true]));
        inputs.push(&[0, 200], &[false, true]);
        assert_eq!(inputs.unsound(), [16, 0]);
        (0..15).for_each(|_| inputs.push(&[200, 200], &[true, true]));
        assert_eq!((inputs.unsound(), inputs.recent()), ([1, 0].as_slice(), [200.0, 200.0].as_slice()));
    }
}
