//! Rest after the first few scans: enough for a force that is marked, until the full test has been passed.

use super::{RestLimits, RestStatistics, RestVerdict, TaxelBaseline, judge, median};

/// Half of the scans repeat a conversion of the boards, so half of them count.
const INDEPENDENT_SHARE: f64 = 0.5;
/// Taxels that speak for a module, as a rule.
const MODULE_TAXELS: f64 = 10.0;
/// Limits for loads are narrower by so many standard errors: a load that the full test refuses seldom passes before.
const STANDARD_ERRORS: f64 = 2.0;

/// As [`judge`], for a window that is shorter than that of the full test, which has `full_scans` scans.
///
/// A mean over few scans has an error, `noise / sqrt(scans)`, and so has the median of such means, 1.25 times over the
/// root of their number. The limits of how far skin and modules may have moved into the direction of load are narrower
/// by two of these errors, and the drift that is allowed within the window is in proportion to its length.
///
/// Error rates of four scans at 20 Hz, beside those of a full second: 150 simulated taxels at zeros of another day, 500
/// starts each (`cargo test -p taxel-engine --lib error_rates -- --nocapture`).
///
/// | called rest | 4 scans | 20 scans |
/// |---|---|---|
/// | at rest | 100 % | 100 % |
/// | a load of 4 counts everywhere | 22 % | 24 % |
/// | of 5 counts everywhere | 0 % | 0.2 % |
/// | of 5 counts on one module | 43 % | 67 % |
/// | of 7 counts on one module | 0.4 % | 3.2 % |
/// | rising by 1 count per second | 100 % | 15 % |
/// | rising by 3 counts per second | 99 % | 0 % |
/// | rising by 8 counts per second | 5 % | 0 % |
///
/// What four scans cannot tell is a slow ramp: for that the watch goes on.
#[must_use]
pub fn judge_first(
    now: &RestStatistics,
    reference: &[TaxelBaseline],
    sign: &[i8],
    limits: &RestLimits,
    full_scans: f64,
) -> RestVerdict {
    let scans = now.count();
    let noise = median(reference.iter().map(|taxel| taxel.noise));
    let error = |taxels: f64| 1.25 * noise / (INDEPENDENT_SHARE * scans as f64 * taxels).sqrt();
    let narrower = |limit: f64, taxels: f64| limit - STANDARD_ERRORS * error(taxels);
    let limits = RestLimits {
        scans_min: scans.max(1),
        moved_median_max: narrower(limits.moved_median_max, reference.len() as f64),
        moved_module_max: narrower(limits.moved_module_max, MODULE_TAXELS),
        drift_max: limits.drift_max * (scans as f64 / full_scans.max(1.0)).min(1.0),
        ..*limits
    };
    judge(now, Some(reference), sign, &limits)
}

/// The zero after a few scans: their mean, and the noise that the taxel is known to have, grown by the error of that
/// mean. So a threshold in multiples of the noise has the same rate of false touches as with a full zero.
#[must_use]
pub fn first_baseline(now: &RestStatistics, reference: &[TaxelBaseline]) -> Vec<TaxelBaseline> {
    let independent = (INDEPENDENT_SHARE * now.count() as f64).max(1.0);
    let grown = (1.0 + 1.0 / independent).sqrt();
    let of = |(now, reference): (TaxelBaseline, &TaxelBaseline)| {
        let noise = if reference.noise.is_finite() { reference.noise } else { now.noise };
        TaxelBaseline { mean: now.mean, noise: grown * noise }
    };
    now.baseline().into_iter().zip(reference).map(of).collect()
}
