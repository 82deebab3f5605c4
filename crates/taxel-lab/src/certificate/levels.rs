//! Ramps and levels: what all usable taxels have in common.

use super::course::{Course, LEVELS};
use super::document::{LevelPart, RampPart};
use super::figures::Figures;
use super::taxel::Examined;
use taxel_engine::calibration::SessionSamples;

/// Every level of both branches that has scans enough.
pub(super) fn levels(course: &Course, taxels: &[Examined], mean: &Figures) -> Vec<LevelPart> {
    let reference = course.sums(&course.kpa);
    let level = |(falling, level): (bool, usize)| {
        let error_kpa = course.mean(&mean.sums, falling, level)?;
        let reference_kpa = course.mean(&reference, falling, level)?;
        let own = |taxel: &Examined| course.mean(&taxel.figures.sums, falling, level);
        Some(LevelPart {
            branch: if falling { "falling" } else { "rising" },
            from_kpa: level as f64 * course.level_kpa,
            to_kpa: (level + 1) as f64 * course.level_kpa,
            scans: course.scans(falling, level),
            reference_kpa,
            reading_kpa: reference_kpa + error_kpa,
            error_kpa,
            spread_kpa: spread(&taxels.iter().filter_map(own).collect::<Vec<f64>>()),
        })
    };
    let rising = (0..LEVELS).map(|level| (false, level));
    rising.chain((0..LEVELS).map(|level| (true, level))).filter_map(level).collect()
}

/// Standard deviation; `None` of fewer than two.
fn spread(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.len() >= 2).then(|| (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}

/// Every ramp: its branches, its rates, and the zero at its beginning.
pub(super) fn ramps(course: &Course, taxels: &[Examined], samples: &SessionSamples) -> Vec<RampPart> {
    samples.ramps.iter().enumerate().map(|(at, ramp)| self::ramp(at, course, taxels, ramp.gauge_kpa)).collect()
}

fn ramp(ramp: usize, course: &Course, taxels: &[Examined], gauge_zero_kpa: Option<f64>) -> RampPart {
    let scans: Vec<usize> = (0..course.kpa.len()).filter(|&scan| course.ramp[scan] == ramp).collect();
    let first_of_greatest = |best: usize, scan: &usize| if course.kpa[*scan] > course.kpa[best] { *scan } else { best };
    let (first, last) = (scans.first().copied(), scans.last().copied());
    let top = first.map(|first| scans.iter().fold(first, first_of_greatest));
    let rate = |from: Option<usize>, to: Option<usize>| {
        let (from, to) = (from?, to?);
        let seconds = course.time_s[to] - course.time_s[from];
        (seconds > 0.0).then(|| (course.kpa[to] - course.kpa[from]) / seconds)
    };
    let falls = scans.iter().any(|&scan| course.falling[scan]);
    let shifts: Vec<f64> = taxels.iter().filter_map(|taxel| *taxel.zero_shifts.get(ramp)?).collect();
    let n = shifts.len() as f64;
    let over = |sum: f64| (!shifts.is_empty()).then_some(sum / n);
    RampPart {
        ramp: ramp + 1,
        scans_rising: scans.iter().filter(|&&scan| !course.falling[scan]).count(),
        scans_falling: scans.iter().filter(|&&scan| course.falling[scan]).count(),
        from_kpa: first.map(|scan| course.kpa[scan]),
        top_kpa: top.map(|scan| course.kpa[scan]),
        to_kpa: last.map(|scan| course.kpa[scan]),
        rise_kpa_per_s: rate(first, top),
        fall_kpa_per_s: rate(top, last).filter(|_| falls),
        zero_mean_counts: over(shifts.iter().sum()),
        zero_rms_counts: over(shifts.iter().map(|shift| shift * shift).sum()).map(f64::sqrt),
        gauge_zero_kpa,
    }
}
