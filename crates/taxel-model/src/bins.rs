//! Sums of one taxel's counts in narrow bins of pressure.

use crate::dd::Dd;
use crate::options::DEFAULT_BINS;
use crate::pressure::UNITS_PER_KPA;
use crate::reduce::{MAX_RAIL_SHARE_OF_BIN, Row};
use std::collections::BTreeMap;

/// A base bin is 2^18 units of 2^-10 Pa: 0.256 kPa.
const SHIFT: u32 = 18;

/// Base bin width, kPa.
const BASE_WIDTH_KPA: f64 = (1_u64 << SHIFT) as f64 / UNITS_PER_KPA;

/// The base bin of a pressure in units.
#[inline]
pub(crate) const fn bin_of(units: i32) -> i32 {
    units >> SHIFT
}

/// Samples off the rails: their number, and the sums of their counts and pressures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sums {
    n: u32,
    c: u64,
    p: i64,
}

impl Sums {
    #[inline]
    pub fn add_sample(&mut self, count: u8, p: i64) {
        self.n += 1;
        self.c += u64::from(count);
        self.p += p;
    }

    #[inline]
    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.c += other.c;
        self.p += other.p;
    }
}

/// Samples at count 0 and at 255, with the sum of their pressures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Railed {
    low: u32,
    high: u32,
    p: i64,
}

impl Railed {
    fn add(&mut self, other: &Self) {
        self.low += other.low;
        self.high += other.high;
        self.p += other.p;
    }
}

/// All samples of a bin; the rails apart, because a clipped reading must not enter a mean.
#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    inner: Sums,
    railed: Railed,
}

impl Bin {
    /// Mean count and mean pressure; `None` without a sample, or where too many are clipped for an honest mean.
    fn row(&self, without_rails: bool) -> Option<Row> {
        let (mut n, mut c, mut p) = (u64::from(self.inner.n), self.inner.c, self.inner.p);
        let railed = u64::from(self.railed.low) + u64::from(self.railed.high);
        if !without_rails {
            n += railed;
            c += u64::from(self.railed.high) * u64::from(u8::MAX);
            p += self.railed.p;
        } else if railed as f64 > MAX_RAIL_SHARE_OF_BIN * (n + railed) as f64 {
            return None;
        }
        if n == 0 {
            return None;
        }
        let weight = n as f64;
        // The sum of the counts, at most 255 2^32, is an exact f64.
        let x = Dd::from(c as f64).div_f64(weight);
        Some(Row { x, y: Dd::from_i64(p).div_f64(weight * UNITS_PER_KPA), n: weight })
    }
}

/// Base bins from the least pressure seen to the greatest: at most 7814 of 24 bytes, 275 for a ramp to 70 kPa.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Bins {
    /// Number of `bins[0]`.
    first: i32,
    bins: Vec<Sums>,
    /// By number of the bin, and only where there are any: most taxels never reach a rail.
    railed: BTreeMap<i32, Railed>,
}

impl Bins {
    /// Adds what was gathered off the rails for base bin `number`.
    #[inline]
    pub fn add(&mut self, number: i32, sums: &Sums) {
        if sums.n > 0 {
            self.at(number).add(sums);
        }
    }

    /// Adds one sample at count 0 or 255.
    #[cold]
    pub fn add_railed(&mut self, number: i32, count: u8, p: i64) {
        let low = u32::from(count == 0);
        self.merge_railed(number, &Railed { low, high: 1 - low, p });
    }

    fn merge_railed(&mut self, number: i32, railed: &Railed) {
        self.at(number);
        self.railed.entry(number).or_default().add(railed);
    }

    /// The base bin `number`, which is made if it is not there.
    #[inline(never)]
    fn at(&mut self, number: i32) -> &mut Sums {
        if self.bins.is_empty() {
            self.first = number;
        }
        if number < self.first {
            let missing = (self.first - number) as usize;
            self.bins.splice(0..0, std::iter::repeat_n(Sums::default(), missing));
            self.first = number;
        }
        let at = (number - self.first) as usize;
        if at >= self.bins.len() {
            self.bins.resize(at + 1, Sums::default());
        }
        &mut self.bins[at]
    }

    pub fn merge(&mut self, other: &Self) {
        other.bins.iter().zip(other.first..).for_each(|(sums, number)| self.add(number, sums));
        other.railed.iter().for_each(|(number, railed)| self.merge_railed(*number, railed));
    }

    /// Base bins merged to the width asked for, at absolute multiples of it, so that the rows do not depend on where
    /// the range begins. Ascending in pressure.
    pub fn rows(&self, width_kpa: Option<f64>, without_rails: bool) -> Vec<Row> {
        let width = width_kpa.filter(|w| w.is_finite() && *w > 0.0).map(|w| w / BASE_WIDTH_KPA);
        let width = width.unwrap_or(self.bins.len() as f64 / DEFAULT_BINS).round().clamp(1.0, 1e4) as i32;
        let mut rows = Vec::with_capacity(self.bins.len() / width as usize + 2);
        let mut at = 0;
        while at < self.bins.len() {
            let group = (self.first + at as i32).div_euclid(width);
            let end = (((group + 1) * width - self.first) as usize).min(self.bins.len());
            let mut sum = Bin::default();
            self.bins[at..end].iter().for_each(|bin| sum.inner.add(bin));
            if !self.railed.is_empty() {
                let numbers = self.first + at as i32..self.first + end as i32;
                self.railed.range(numbers).for_each(|(_, railed)| sum.railed.add(railed));
            }
            rows.extend(sum.row(without_rails));
            at = end;
        }
        rows
    }
}
