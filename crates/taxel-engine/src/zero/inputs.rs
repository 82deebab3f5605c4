//! The last sixteen scans of some inputs, and their sums over four and sixteen of them, all in whole raw counts.
//!
//! Everything is in columns of one kind, so that the compiler makes vector instructions of each loop.

use std::ops::Range;

use taxel_skin::CountRange;

use crate::counts::Counts;

/// Scans that are kept.
pub const KEPT: usize = 16;
/// Scans of the shorter mean.
const QUARTER: usize = 4;
/// Weight of a scan in the recent mean: 40 scans.
const RECENT_SHARE: f32 = 1.0 / 40.0;
/// Scans that the recent mean begins with: a single noisy one would make a step of every later scan.
const RECENT_FIRST: u8 = 10;

/// Inputs that are looked at side by side.
pub const LANES: usize = 16;

/// What is known of up to [`LANES`] inputs, in units; zeros where there are fewer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    /// Counts of the newest scan.
    pub newest: [f32; LANES],
    /// Sums over four scans: those before the newest but one.
    pub before: [f32; LANES],
    /// Sums over the last 4 scans.
    pub quarter: [f32; LANES],
    /// Sums over the last 16 scans.
    pub whole: [f32; LANES],
    /// Mean over the scans before the last 16; NaN before there are ten.
    pub recent: [f32; LANES],
    /// Scans until all of the last 16 were sound.
    pub unsound: [u8; LANES],
}

/// A raw count of some width.
pub trait Raw: Copy + Default {
    /// Holds the sum of [`KEPT`] of them.
    type Sum: Copy + Default;

    /// `sum` with this one more and `leaves` less; what overflows on the way comes back.
    fn into_sum(self, sum: Self::Sum, leaves: Self) -> Self::Sum;

    /// As a real number, exactly.
    fn real(self) -> f32;

    /// A sum as a real number, exactly.
    fn real_sum(sum: Self::Sum) -> f32;
}

impl Raw for u8 {
    type Sum = u16;

    fn into_sum(self, sum: u16, leaves: Self) -> u16 {
        sum.wrapping_add(u16::from(self)).wrapping_sub(u16::from(leaves))
    }

    fn real(self) -> f32 {
        f32::from(self)
    }

    fn real_sum(sum: u16) -> f32 {
        f32::from(sum)
    }
}

impl Raw for u16 {
    type Sum = u32;

    fn into_sum(self, sum: u32, leaves: Self) -> u32 {
        sum.wrapping_add(u32::from(self)).wrapping_sub(u32::from(leaves))
    }

    fn real(self) -> f32 {
        f32::from(self)
    }

    fn real_sum(sum: u32) -> f32 {
        sum as f32 // 20 bits at most
    }
}

/// Taxels or pads of a patch, scan by scan.
#[derive(Clone, Debug)]
pub struct Inputs<C: Raw> {
    inputs: usize,
    /// Counts of the last scans, one row each; the newest is row `at`. Rows before the first scan are zero.
    rows: Vec<C>,
    at: usize,
    scans: usize,
    /// Sums over the last 4 and 16 scans.
    quarter: Vec<C::Sum>,
    whole: Vec<C::Sum>,
    /// What `quarter` was one scan and two scans ago.
    earlier: [Vec<C::Sum>; 2],
    /// Mean over the scans before the last 16; NaN before there are [`RECENT_FIRST`].
    recent: Vec<f32>,
    /// Sum of the first of these scans, and how many are still to come.
    first: Vec<f32>,
    to_come: Vec<u8>,
    /// Scans until all of the last 16 were sound.
    unsound: Vec<u8>,
}

impl<C: Raw> Inputs<C> {
    /// So many inputs, without a scan.
    #[must_use]
    pub fn new(inputs: usize) -> Self {
        Self {
            inputs,
            rows: vec![C::default(); KEPT * inputs],
            at: 0,
            scans: 0,
            quarter: vec![C::Sum::default(); inputs],
            earlier: [vec![C::Sum::default(); inputs], vec![C::Sum::default(); inputs]],
            whole: vec![C::Sum::default(); inputs],
            recent: vec![f32::NAN; inputs],
            first: vec![0.0; inputs],
            to_come: vec![RECENT_FIRST; inputs],
            unsound: vec![0; inputs],
        }
    }

    /// Forgets everything.
    pub fn begin(&mut self) {
        self.rows.fill(C::default());
        self.quarter.fill(C::Sum::default());
        self.earlier.iter_mut().for_each(|sums| sums.fill(C::Sum::default()));
        self.whole.fill(C::Sum::default());
        self.recent.fill(f32::NAN);
        self.first.fill(0.0);
        self.to_come.fill(RECENT_FIRST);
        self.unsound.fill(0);
        self.scans = 0;
    }

    /// Takes a scan: one count per input, and whether it may be believed.
    pub fn push(&mut self, counts: &[C], sound: &[bool]) {
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
            *quarter = count.into_sum(*quarter, leaves_quarter);
            *whole = count.into_sum(*whole, leaves);
        }
        if full {
            let known = self.recent.iter_mut().zip(&mut self.first).zip(&mut self.to_come);
            let leaves = self.rows[newest..][..inputs].iter().zip(&self.unsound);
            for (((recent, first), to_come), (leaves, &unsound)) in known.zip(leaves) {
                let leaves = leaves.real();
                *first += if unsound == 0 { leaves } else { 0.0 };
                let now = if *to_come == 1 { *first / f32::from(RECENT_FIRST) } else { *recent };
                // Before there is a mean this stays NaN.
                let next = if *to_come == 0 { *recent + RECENT_SHARE * (leaves - *recent) } else { now };
                *recent = if unsound == 0 { next } else { *recent };
                *to_come = to_come.saturating_sub(u8::from(unsound == 0));
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
    pub fn newest(&self) -> &[C] {
        &self.rows[self.at * self.inputs..][..self.inputs]
    }

    /// Sums over the last 4 and the last 16 scans.
    #[must_use]
    pub fn sums(&self) -> [&[C::Sum]; 2] {
        [&self.quarter, &self.whole]
    }

    /// The mean over the scans before the last 16.
    #[must_use]
    pub fn recent(&self) -> &[f32] {
        &self.recent
    }

    /// The inputs of a range of at most [`LANES`], in raw counts.
    #[must_use]
    pub fn block(&self, range: Range<usize>) -> Block {
        Block {
            newest: lanes(self.newest(), &range).map(C::real),
            // The boards' scans are cut anew now and then, so that the newest but one may be of two.
            before: lanes(&self.earlier[1], &range).map(C::real_sum),
            quarter: lanes(&self.quarter, &range).map(C::real_sum),
            whole: lanes(&self.whole, &range).map(C::real_sum),
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

/// The taxels of a patch, of whatever width their counts are.
#[derive(Clone, Debug)]
pub enum TaxelInputs {
    /// Of up to eight bits.
    Bytes(Inputs<u8>),
    /// Of another range.
    Words(Inputs<u16>, CountRange),
}

impl TaxelInputs {
    /// So many taxels, without a scan.
    #[must_use]
    pub fn new(taxels: usize, range: CountRange) -> Self {
        if range.is_byte() { Self::Bytes(Inputs::new(taxels)) } else { Self::Words(Inputs::new(taxels), range) }
    }

    /// Forgets everything.
    pub fn begin(&mut self) {
        match self {
            Self::Bytes(inputs) => inputs.begin(),
            Self::Words(inputs, _) => inputs.begin(),
        }
    }

    /// Takes a scan: one count per taxel, and whether it may be believed. Counts of another width are none of these.
    pub fn push(&mut self, counts: Counts<'_>, sound: &[bool]) {
        match (self, counts) {
            (Self::Bytes(inputs), Counts::Bytes(bytes)) => inputs.push(bytes, sound),
            (Self::Words(inputs, _), Counts::Words(words, _)) => inputs.push(words, sound),
            _ => {}
        }
    }

    /// Scans taken.
    #[must_use]
    pub const fn scans(&self) -> usize {
        match self {
            Self::Bytes(inputs) => inputs.scans(),
            Self::Words(inputs, _) => inputs.scans(),
        }
    }

    /// Counts of the newest scan.
    #[must_use]
    pub fn newest(&self) -> Counts<'_> {
        match self {
            Self::Bytes(inputs) => Counts::Bytes(inputs.newest()),
            Self::Words(inputs, range) => Counts::Words(inputs.newest(), *range),
        }
    }

    /// The taxels of a range of at most [`LANES`], in units.
    #[must_use]
    pub fn block(&self, taxels: Range<usize>) -> Block {
        match self {
            Self::Bytes(inputs) => inputs.block(taxels),
            Self::Words(inputs, range) => {
                let (mut block, unit) = (inputs.block(taxels), (1.0 / range.per_unit()) as f32);
                for column in [&mut block.newest, &mut block.before, &mut block.quarter, &mut block.whole] {
                    column.iter_mut().for_each(|count| *count *= unit);
                }
                block.recent.iter_mut().for_each(|count| *count *= unit);
                block
            }
        }
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
            inputs.push(&[77_u8], &[true]);
            inputs.begin();
            for (k, &count) in counts.iter().enumerate() {
                inputs.push(&[count], &[true]);
                let last = |scans: usize| {
                    counts[(k + 1).saturating_sub(scans)..=k].iter().map(|c| u16::from(*c)).sum::<u16>()
                };
                prop_assert_eq!(inputs.sums().map(|sum| sum[0]), [last(4), last(16)]);
                let left: Vec<f32> = counts[..(k + 1).saturating_sub(KEPT)].iter().map(|&c| f32::from(c)).collect();
                let recent = left.split_at_checked(10).map_or(f32::NAN, |(first, then)| {
                    then.iter().fold(first.iter().sum::<f32>() / 10.0, |mean, count| mean + (count - mean) / 40.0)
                });
                prop_assert!((inputs.recent()[0] - recent).abs() < 1e-3 || recent.is_nan());
                prop_assert_eq!(inputs.recent()[0].is_nan(), recent.is_nan());
            }
        }
    }

    proptest! {
        #[test]
        fn wide_counts_give_in_units_what_bytes_give(
            scans in proptest::collection::vec(prop::array::uniform3(any::<u8>()), 1..60), fine in 0..256_u16
        ) {
            let range = CountRange::to(u16::MAX).unwrap();
            let (mut bytes, mut words) = (TaxelInputs::new(3, CountRange::BYTE), TaxelInputs::new(3, range));
            for scan in &scans {
                bytes.push(Counts::Bytes(scan), &[true; 3]);
                let wide = scan.map(|count| 256 * u16::from(count) + fine);
                words.push(Counts::Words(&wide, range), &[true; 3]);
            }
            let (bytes, words, fine) = (bytes.block(0..3), words.block(0..3), f32::from(fine) / 256.0);
            let near = |a: f32, b: f32| (a.is_nan() && b.is_nan()) || (a - b).abs() < 1e-3;
            for i in 0..3 {
                prop_assert!(near(words.newest[i], bytes.newest[i] + fine));
                prop_assert!(near(words.quarter[i], bytes.quarter[i] + fine * scans.len().min(4) as f32));
                prop_assert!(near(words.whole[i], bytes.whole[i] + fine * scans.len().min(16) as f32));
                prop_assert!(near(words.recent[i], bytes.recent[i] + fine), "{words:?} {bytes:?}");
            }
        }
    }

    #[test]
    fn an_unsound_input_is_out_for_sixteen_scans_and_leaves_the_recent_mean_alone() {
        let mut inputs = Inputs::new(2);
        (0..26).for_each(|_| inputs.push(&[200_u8, 200], &[true, true]));
        inputs.push(&[0, 200], &[false, true]);
        assert_eq!(inputs.unsound(), [16, 0]);
        (0..15).for_each(|_| inputs.push(&[200, 200], &[true, true]));
        assert_eq!((inputs.unsound(), inputs.recent()), ([1, 0].as_slice(), [200.0, 200.0].as_slice()));
    }
}
