//! Exact running sums of one 8-bit taxel: what a calibration session keeps while it gathers.
//!
//! All sums are integers, so that they do not depend on the order of the samples, and accumulators of shards merge bit
//! for bit. About 16 KB for a ramp to 70 kPa, whatever the number of scans.

use crate::dd::Dd;
use crate::fit::fit_reduced;
use crate::model::TaxelModel;
use crate::options::{DEFAULT_BINS, Estimator, FitOptions, MIN_BINNED_SAMPLES, Rails};
use crate::reduce::{CodeStat, MAX_RAIL_SHARE_OF_BIN, RampGroup, Reduced, Row, rails_to_drop};

/// Units of 2^-10 Pa in a kilopascal.
const UNITS_PER_KPA: f64 = 1_024_000.0;

/// A base bin is 2^18 units: 0.256 kPa.
const BIN_SHIFT: u32 = 18;

/// Base bin width, kPa.
const BASE_WIDTH_KPA: f64 = (1_u64 << BIN_SHIFT) as f64 / UNITS_PER_KPA;

/// Pressures beyond this are refused, kPa: it bounds the number of bins and keeps every sum far from overflow.
const MAX_KPA: f64 = 1000.0;

/// A pressure as an integer number of 2^-10 Pa, within +-1000 kPa.
///
/// The rounding, at most 0.0005 Pa, is far below any gauge; in return every sum is exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FixedPressure(i32);

impl FixedPressure {
    /// `None` if `kpa` is not finite or beyond +-1000 kPa.
    #[must_use]
    pub fn from_kpa(kpa: f64) -> Option<Self> {
        (kpa.abs() <= MAX_KPA).then(|| Self((kpa * UNITS_PER_KPA).round() as i32))
    }

    /// The pressure in kPa.
    #[must_use]
    pub fn to_kpa(self) -> f64 {
        f64::from(self.0) / UNITS_PER_KPA
    }
}

/// Samples of one base bin; the rails apart, because a clipped reading must not enter a mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Bin {
    /// Samples off the rails, with the sums of their counts and pressures.
    n: u32,
    c: u64,
    p: i64,
    /// Samples at count 0 and at 255, with the sum of their pressures.
    low: u32,
    high: u32,
    p_railed: i64,
}

impl Bin {
    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.c += other.c;
        self.p += other.p;
        self.low += other.low;
        self.high += other.high;
        self.p_railed += other.p_railed;
    }

    #[inline]
    fn add_sample(&mut self, count: u8, p: i64) {
        if count == 0 || count == u8::MAX {
            self.low += u32::from(count == 0);
            self.high += u32::from(count != 0);
            self.p_railed += p;
        } else {
            self.n += 1;
            self.c += u64::from(count);
            self.p += p;
        }
    }

    fn is_used(&self) -> bool {
        self.n + self.low + self.high > 0
    }
}

/// Samples of one count: number, sum of P, sum of P^2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Code {
    /// Narrower than the sums on purpose: as a pair of equal width the compiler updates `n` and `p` in one vector,
    /// whose store the next sample's load would wait for.
    n: u32,
    p: i64,
    p2: u128,
}

impl Code {
    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.p += other.p;
        self.p2 += other.p2;
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Ramp {
    number: u16,
    codes: Box<[Code; 256]>,
}

/// Sums over the samples of one taxel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Accumulator {
    /// Base bin of `bins[0]`.
    first_bin: i32,
    bins: Vec<Bin>,
    /// Ascending in number.
    ramps: Vec<Ramp>,
    rejected: u64,
}

impl Default for Accumulator {
    fn default() -> Self {
        Self::new()
    }
}

impl Accumulator {
    /// No samples.
    #[must_use]
    pub fn new() -> Self {
        Self { first_bin: 0, bins: Vec::new(), ramps: Vec::new(), rejected: 0 }
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
        // A ramp stays in one bin for many samples: its sums are kept at hand meanwhile.
        let (mut number, mut bin) = (0, Bin::default());
        for (count, pressure) in samples {
            let Some(FixedPressure(p)) = pressure else {
                self.rejected += 1;
                continue;
            };
            let p = i64::from(p);
            let code = &mut self.ramps[at].codes[usize::from(count)];
            code.n += 1;
            code.p += p;
            code.p2 += u128::from((p * p) as u64);
            if p >> BIN_SHIFT != number {
                self.add_bin(number, &bin);
                (number, bin) = (p >> BIN_SHIFT, Bin::default());
            }
            bin.add_sample(count, p);
        }
        self.add_bin(number, &bin);
    }

    fn add_bin(&mut self, number: i64, bin: &Bin) {
        if bin.is_used() {
            let at = self.bin_index(number as i32);
            self.bins[at].add(bin);
        }
    }

    /// Adds all samples of another accumulator.
    pub fn merge(&mut self, other: &Self) {
        for (k, from) in other.bins.iter().enumerate() {
            let at = self.bin_index(other.first_bin + k as i32);
            self.bins[at].add(from);
        }
        for ramp in &other.ramps {
            let at = self.ramp_index(ramp.number);
            for (into, from) in self.ramps[at].codes.iter_mut().zip(ramp.codes.iter()) {
                into.add(from);
            }
        }
        self.rejected += other.rejected;
    }

    /// Fits the samples so far.
    #[must_use]
    pub fn fit(&self, options: &FitOptions) -> TaxelModel {
        fit_reduced(&self.reduce(options), options)
    }

    /// The position of a base bin; at most 7814 bins of 40 bytes, 275 for a ramp to 70 kPa.
    #[inline]
    fn bin_index(&mut self, bin: i32) -> usize {
        let at = bin.wrapping_sub(self.first_bin);
        if at >= 0 && (at as usize) < self.bins.len() {
            return at as usize;
        }
        self.grow_to(bin)
    }

    #[cold]
    fn grow_to(&mut self, bin: i32) -> usize {
        if self.bins.is_empty() {
            self.first_bin = bin;
        }
        if bin < self.first_bin {
            let missing = (self.first_bin - bin) as usize;
            self.bins.splice(0..0, std::iter::repeat_n(Bin::default(), missing));
            self.first_bin = bin;
        }
        let at = (bin - self.first_bin) as usize;
        if at >= self.bins.len() {
            self.bins.resize(at + 1, Bin::default());
        }
        at
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
        let samples = self.samples();
        let recording = samples >= MIN_BINNED_SAMPLES;
        let rails = match options.rails {
            Rails::Auto if recording => Some((0.0, 255.0)),
            Rails::At { low, high } => Some((low, high)),
            Rails::Auto | Rails::None => None,
        };
        let mut codes: Vec<CodeStat> = (0..256).filter_map(|c| self.code_stat(c)).collect();
        let dropped = rails_to_drop(&codes, rails);
        let is_dropped = |x: f64| dropped.iter().any(|rail| rail.0 == x);
        codes.retain(|c| !is_dropped(c.x.hi));
        let binned = options.estimator == Estimator::PressureBinned && recording;
        let rows = if binned {
            self.bin_rows(options.bin_width_kpa, rails.is_some())
        } else {
            codes.iter().map(|c| Row { x: c.x, y: c.mean, n: c.n }).collect()
        };
        let ramps = self.ramps.iter().map(|ramp| ramp_group(ramp, &is_dropped)).collect();
        Reduced { codes, rows, rejected: self.rejected, integer: true, binned, dropped, ramps }
    }

    fn code_stat(&self, code: usize) -> Option<CodeStat> {
        let mut sums = Code::default();
        self.ramps.iter().for_each(|ramp| sums.add(&ramp.codes[code]));
        if sums.n == 0 {
            return None;
        }
        // n sum P^2 - (sum P)^2, exact: below 2^124 for 2^32 samples.
        let scatter = i128::from(sums.n) * sums.p2 as i128 - i128::from(sums.p).pow(2);
        let n = f64::from(sums.n);
        let ss = scatter as f64 / n / (UNITS_PER_KPA * UNITS_PER_KPA);
        Some(CodeStat { x: Dd::from(code as f64), n, mean: Dd::from_i64(sums.p).div_f64(n * UNITS_PER_KPA), ss })
    }

    /// Base bins merged to the width asked for, at absolute multiples of it, so that the rows do not depend on where
    /// the range begins.
    fn bin_rows(&self, width_kpa: Option<f64>, without_rails: bool) -> Vec<Row> {
        let first = self.bins.iter().position(Bin::is_used);
        let (Some(first), Some(last)) = (first, self.bins.iter().rposition(Bin::is_used)) else {
            return Vec::new();
        };
        let span = (last + 1 - first) as f64;
        let width = width_kpa.filter(|w| w.is_finite() && *w > 0.0).map(|w| w / BASE_WIDTH_KPA);
        let width = width.unwrap_or(span / DEFAULT_BINS).round().clamp(1.0, 1e4) as i32;
        let mut rows = Vec::new();
        let mut at = first;
        while at <= last {
            let group = (self.first_bin + at as i32).div_euclid(width);
            let end = (((group + 1) * width - self.first_bin) as usize).min(last + 1);
            rows.extend(bin_row(&self.bins[at..end], without_rails));
            at = end;
        }
        rows.sort_by(|a, b| a.x.hi.total_cmp(&b.x.hi).then(a.y.hi.total_cmp(&b.y.hi)));
        rows
    }
}

fn bin_row(bins: &[Bin], without_rails: bool) -> Option<Row> {
    let mut sum = Bin::default();
    for bin in bins {
        sum.add(bin);
    }
    let (mut n, mut c, mut p) = (u64::from(sum.n), sum.c, sum.p);
    let railed = u64::from(sum.low) + u64::from(sum.high);
    if without_rails {
        if railed as f64 > MAX_RAIL_SHARE_OF_BIN * (n + railed) as f64 {
            return None;
        }
    } else {
        n += railed;
        c += u64::from(sum.high) * u64::from(u8::MAX);
        p += sum.p_railed;
    }
    if n == 0 {
        return None;
    }
    let weight = n as f64;
    let mean = |sum: i64, units: f64| Dd::from_i64(sum).div_f64(weight * units);
    Some(Row { x: mean(c as i64, 1.0), y: mean(p, UNITS_PER_KPA), n: weight })
}

fn ramp_group(ramp: &Ramp, is_dropped: &dyn Fn(f64) -> bool) -> RampGroup {
    let groups = ramp.codes.iter().enumerate().filter(|(c, sums)| sums.n > 0 && !is_dropped(*c as f64));
    RampGroup { groups: groups.map(|(c, sums)| (c as f64, f64::from(sums.n), sums.p as f64 / UNITS_PER_KPA)).collect() }
}
