//! Exact running sums of one 8-bit taxel: what a calibration session keeps while it gathers.
//!
//! All sums are integers, so that they do not depend on the order of the samples, and accumulators of shards merge bit
//! for bit. About 13 KB for a ramp to 70 kPa, whatever the number of scans.

use crate::bins::{Bins, Sums, bin_of};
use crate::dd::Dd;
use crate::fit::fit_reduced;
use crate::model::TaxelModel;
use crate::options::{Estimator, FitOptions, MIN_BINNED_SAMPLES};
use crate::pressure::{FixedPressure, UNITS_PER_KPA};
use crate::reduce::{CodeStat, RampGroup, Reduced, Row, rails_to_drop};

/// Samples of one count: number, sum of P, sum of P^2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Code {
    /// Narrower than the sums on purpose: as a pair of equal width the compiler updates `n` and `p` in one vector,
    /// whose store the next sample's load would wait for.
    n: u32,
    /// The sum of P^2 is `p2_carries` 2^64 + `p2`. A carry is rare, so that it costs a sample nothing.
    p2_carries: u32,
    p: i64,
    p2: u64,
}

impl Code {
    #[inline]
    fn add_sample(&mut self, p: i64) {
        self.n += 1;
        self.p += p;
        self.add_squares((p * p) as u64);
    }

    #[inline]
    fn add_squares(&mut self, p2: u64) {
        let (sum, carry) = self.p2.overflowing_add(p2);
        self.p2 = sum;
        if carry {
            self.p2_carries += 1;
        }
    }

    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.p += other.p;
        self.p2_carries += other.p2_carries;
        self.add_squares(other.p2);
    }

    fn squares(&self) -> i128 {
        (i128::from(self.p2_carries) << 64) | i128::from(self.p2)
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Ramp {
    number: u16,
    codes: Box<[Code; 256]>,
}

/// Sums over the samples of one taxel. All ramps together may hold 2^32 - 1 samples: more than a year at 100 a second.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Accumulator {
    bins: Bins,
    /// Ascending in number.
    ramps: Vec<Ramp>,
    rejected: u64,
}

impl Accumulator {
    /// No samples.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Valid samples so far.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.ramps.iter().flat_map(|ramp| ramp.codes.iter()).map(|code| u64::from(code.n)).sum()
    }

    /// Least and greatest count so far.
    #[must_use]
    pub fn count_range(&self) -> Option<(u8, u8)> {
        let seen = |c: &u8| self.ramps.iter().any(|ramp| ramp.codes[usize::from(*c)].n > 0);
        Some(((0..=255).find(seen)?, (0..=255).rfind(seen)?))
    }

    /// Adds one sample; a pressure of `None` (see [`FixedPressure::from_kpa`]) is counted as rejected.
    pub fn add(&mut self, count: u8, pressure: Option<FixedPressure>, ramp: u16) {
        self.extend(std::iter::once((count, pressure)), ramp);
    }

    /// Adds samples of one ramp.
    pub fn extend(&mut self, samples: impl IntoIterator<Item = (u8, Option<FixedPressure>)>, ramp: u16) {
        let at = self.ramp_index(ramp);
        let codes: &mut [Code; 256] = &mut self.ramps[at].codes;
        // A ramp stays in one bin for many samples: its sums are kept at hand meanwhile.
        let (mut number, mut bin) = (0, Sums::default());
        for (count, pressure) in samples {
            let Some(p) = pressure.map(FixedPressure::units) else {
                self.rejected += 1;
                continue;
            };
            if bin_of(p) != number {
                self.bins.add(number, &bin);
                (number, bin) = (bin_of(p), Sums::default());
            }
            let p = i64::from(p);
            if count == 0 || count == u8::MAX {
                self.bins.add_railed(number, count, p);
            } else {
                bin.add_sample(count, p);
            }
            codes[usize::from(count)].add_sample(p);
        }
        self.bins.add(number, &bin);
    }

    /// Adds all samples of another accumulator.
    pub fn merge(&mut self, other: &Self) {
        self.bins.merge(&other.bins);
        for ramp in &other.ramps {
            let at = self.ramp_index(ramp.number);
            let into = self.ramps[at].codes.iter_mut();
            into.zip(ramp.codes.iter()).for_each(|(into, from)| into.add(from));
        }
        self.rejected += other.rejected;
    }

    /// Fits the samples so far.
    #[must_use]
    pub fn fit(&self, options: &FitOptions) -> TaxelModel {
        fit_reduced(&self.reduce(options), options)
    }

    fn ramp_index(&mut self, number: u16) -> usize {
        match self.ramps.binary_search_by_key(&number, |ramp| ramp.number) {
            Ok(at) => at,
            Err(at) => {
                self.ramps.insert(at, Ramp { number, codes: Box::new([Code::default(); 256]) });
                at
            }
        }
    }

    pub(crate) fn reduce(&self, options: &FitOptions) -> Reduced {
        let recording = self.samples() >= MIN_BINNED_SAMPLES;
        let rails = options.rails(recording.then_some((0.0, 255.0)));
        let mut codes: Vec<CodeStat> = Vec::with_capacity(256);
        codes.extend((0..256).filter_map(|c| self.code_stat(c)));
        let dropped = rails_to_drop(&codes, rails);
        let is_dropped = |x: f64| dropped.iter().any(|rail| rail.0 == x);
        codes.retain(|c| !is_dropped(c.x.hi));
        let binned = options.estimator == Estimator::PressureBinned && recording;
        let rows = if binned {
            self.bins.rows(options.bin_width_kpa, rails.is_some())
        } else {
            codes.iter().map(|c| Row { x: c.x, y: c.mean, n: c.n }).collect()
        };
        let ramps = match &self.ramps[..] {
            [_] => Vec::new(),
            ramps => ramps.iter().map(|ramp| ramp_group(ramp, &is_dropped)).collect(),
        };
        let samples = codes.iter().map(|c| c.n).sum();
        Reduced { samples, codes, rows, rejected: self.rejected, integer: true, binned, dropped, ramps }
    }

    fn code_stat(&self, code: usize) -> Option<CodeStat> {
        let mut sums = Code::default();
        self.ramps.iter().for_each(|ramp| sums.add(&ramp.codes[code]));
        if sums.n == 0 {
            return None;
        }
        // n sum P^2 - (sum P)^2, exact: below 2^124 for 2^32 samples.
        let scatter = i128::from(sums.n) * sums.squares() - i128::from(sums.p).pow(2);
        let n = f64::from(sums.n);
        let ss = scatter as f64 / (n * UNITS_PER_KPA * UNITS_PER_KPA);
        Some(CodeStat { x: Dd::from(code as f64), n, mean: Dd::from_i64(sums.p).div_f64(n * UNITS_PER_KPA), ss })
    }
}

fn ramp_group(ramp: &Ramp, is_dropped: &dyn Fn(f64) -> bool) -> RampGroup {
    let groups = ramp.codes.iter().enumerate().filter(|(c, sums)| sums.n > 0 && !is_dropped(*c as f64));
    let sums = groups.map(|(c, sums)| (c as f64, f64::from(sums.n), sums.p as f64 / UNITS_PER_KPA));
    RampGroup { groups: sums.collect() }
}
