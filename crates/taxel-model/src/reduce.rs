//! The least that a fit needs to know of the samples.
//!
//! Weighted least squares on the mean pressure of each distinct count has the same solution as least squares on all
//! samples, so that a few hundred rows stand for any number of scans without loss.

use crate::dd::Dd;

/// A bin with a larger share of clipped readings than this has no honest mean count.
pub(crate) const MAX_RAIL_SHARE_OF_BIN: f64 = 0.05;

/// A rail with a larger share of all samples than this is clipping; a smaller one may be a true reading.
const MAX_RAIL_SHARE: f64 = 0.01;

/// A rail this share of the converter's range, 8 counts of 255, away from every other reading is a dropout, however rare.
const DROPOUT_GAP_SHARE: f64 = 8.0 / 255.0;

/// Bits of the finest converter whose ends are known without being told.
const WIDEST_BITS: i32 = 24;

/// A row of the least-squares problem: `n` samples of mean count `x` and mean pressure `y`, kPa.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub x: Dd,
    pub y: Dd,
    pub n: f64,
}

/// All samples of one count: how many, their mean pressure in kPa, and the sum of squares about it, kPa^2.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CodeStat {
    pub x: Dd,
    pub n: f64,
    pub mean: Dd,
    pub ss: f64,
}

/// One ramp as groups of (count, samples, sum of their pressures in kPa).
#[derive(Clone, Debug)]
pub(crate) struct RampGroup {
    pub groups: Vec<(f64, f64, f64)>,
}

/// Samples reduced.
#[derive(Clone, Debug)]
pub(crate) struct Reduced {
    /// Number of samples behind the codes.
    pub samples: f64,
    /// Ascending in count, clipped counts left out.
    pub codes: Vec<CodeStat>,
    /// Rows of the problem: ascending in count, bins of pressure in pressure.
    pub rows: Vec<Row>,
    /// Samples that were not finite or out of range.
    pub rejected: u64,
    /// Every count is an integer.
    pub integer: bool,
    /// The rows are bins of pressure and not counts.
    pub binned: bool,
    /// Clipped counts and their share of the samples.
    pub dropped: Vec<(f64, f64)>,
    /// For the repeatability; empty for a single ramp.
    pub ramps: Vec<RampGroup>,
}

impl Reduced {
    /// Standard deviation of the pressure and the range of its means, kPa.
    pub fn pressure_spread(&self) -> Spread {
        let n = self.samples.max(1.0);
        let mean = self.codes.iter().map(|c| c.n * c.mean.hi).sum::<f64>() / n;
        let ss: f64 = self.codes.iter().map(|c| c.ss + c.n * (c.mean.hi - mean).powi(2)).sum();
        let means = self.codes.iter().map(|c| c.mean.hi);
        let rows = self.rows.iter().map(|r| r.y.hi);
        let (low, high) =
            means.chain(rows).fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), y| (lo.min(y), hi.max(y)));
        Spread { sd_kpa: (ss / n).sqrt(), range_kpa: (high - low).max(0.0) }
    }
}

/// How the pressures are spread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub sd_kpa: f64,
    pub range_kpa: f64,
}

/// The ends of the converter that gave these counts: 0 and the greatest count of the fewest bits, 8 to 24, that hold them
/// all. `None` where they are no integers of such a converter.
pub(crate) fn converter_rails(counts: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut greatest = 0.0_f64;
    for count in counts {
        if count < 0.0 || count.fract() != 0.0 {
            return None;
        }
        greatest = greatest.max(count);
    }
    (8..=WIDEST_BITS).map(|bits| 2.0_f64.powi(bits) - 1.0).find(|top| greatest <= *top).map(|top| (0.0, top))
}

/// Which of the two rail counts must stay out of the fit, with their share of the samples.
pub(crate) fn rails_to_drop(codes: &[CodeStat], rails: Option<(f64, f64)>) -> Vec<(f64, f64)> {
    let Some((low, high)) = rails else { return Vec::new() };
    let total: f64 = codes.iter().map(|c| c.n).sum();
    let is_inner = |c: &&CodeStat| c.x.hi > low && c.x.hi < high;
    let (first, last) = (codes.iter().find(is_inner), codes.iter().rfind(is_inner));
    // A taxel that only ever reads rails is dead, and is told so from its counts.
    let (Some(first), Some(last)) = (first, last) else { return Vec::new() };
    codes
        .iter()
        .filter(|c| !is_inner(c))
        .filter(|c| {
            let gap = if c.x.hi <= low { first.x.hi - c.x.hi } else { c.x.hi - last.x.hi };
            c.n > MAX_RAIL_SHARE * total || gap >= DROPOUT_GAP_SHARE * (high - low)
        })
        .map(|c| (c.x.hi, c.n / total))
        .collect()
}
