//! `taxeld judge --load-points`: what a recalibration wins on the rest of a recording, and on another one.

use std::path::Path;

use anyhow::{Context, bail};
use taxel_engine::calibration::fit::{Applied, ApplyRecipe, Score, apply, judge};
use taxel_engine::model_set::ModelSet;
use taxel_engine::recalibration::recording::points_of;
use taxel_engine::recalibration::{Assumptions, Recalibration, corrected};

use super::judged::Judged;
use crate::fit::scans_of;

/// Corrects `set` by so many load points of a recording and scores the rest of it; then scores `others` with the same set.
///
/// # Errors
/// A recording that holds still too seldom, or whose points contradict each other.
pub fn judge_recalibrated(
    set: &ModelSet,
    data: &Judged,
    recipe: &ApplyRecipe,
    load_points: usize,
    others: &[Judged],
) -> anyhow::Result<()> {
    let before = data.apply(set, recipe)?;
    let found = points_of(&data.recording.time_s, &area_kpa(&before), &data.gauge_kpa, load_points);
    let found = found.map_err(|why| anyhow::anyhow!("{}: {why}", data.path.display()))?;
    let recalibration = Recalibration::of(&found.points, Assumptions::PRESSURES).map_err(anyhow::Error::msg)?;
    for judged in &recalibration.points {
        let point = judged.point;
        let (read, then) = (100.0 * (point.read / point.known - 1.0), 100.0 * (judged.corrected / point.known - 1.0));
        let deviation = judged.deviation;
        say!(
            "  load point {:.1} kPa: {read:+.2} % before, {then:+.2} % corrected, deviation {deviation:+.1}",
            point.known
        );
    }
    if let Some(why) = recalibration.refused_because.first() {
        bail!("{why}");
    }
    let (gain, sigma, new) =
        (recalibration.line.gain, recalibration.gain_sigma(), 100.0 * recalibration.relative_sigma());
    say!("  gain {gain:.4} +- {sigma:.4}; another load is then known to {new:.1} % (k = 1)");
    let corrected = corrected(set, &recalibration, None, 0).map_err(anyhow::Error::msg)?;
    let held: Vec<f64> =
        data.gauge_kpa.iter().zip(&found.taken).map(|(kpa, taken)| if *taken { f64::NAN } else { *kpa }).collect();
    tell(data.path, "the rest", &judge(&before, &held), &judge(&data.apply(&corrected, recipe)?, &held));
    for other in others {
        let (was, is) = (other.apply(set, recipe)?, other.apply(&corrected, recipe)?);
        tell(other.path, "all of it", &judge(&was, &other.gauge_kpa), &judge(&is, &other.gauge_kpa));
    }
    Ok(())
}

impl Judged<'_> {
    fn apply(&self, set: &ModelSet, recipe: &ApplyRecipe) -> anyhow::Result<Applied> {
        apply(&scans_of(&self.recording), set, recipe).with_context(|| self.path.display().to_string())
    }
}

fn tell(path: &Path, what: &str, before: &Score, after: &Score) {
    let area = |score: &Score| score.area_coverage_percent.map_or("-".to_owned(), |percent| format!("{percent:.1} %"));
    say!(
        "{}, {what}: area-mean error {:.2} % before, {:.2} % after; taxel RMSE {:.2} kPa before, {:.2} kPa after; \
         area-means within 95 %: {} before, {} after",
        path.display(),
        before.area_percent,
        after.area_percent,
        before.taxel_rmse_kpa,
        after.taxel_rmse_kpa,
        area(before),
        area(after),
    );
}

/// Mean over the taxels, scan by scan, kPa; NaN where none is read, or where it is a lower bound.
fn area_kpa(applied: &Applied) -> Vec<f64> {
    let columns: Vec<&Vec<f64>> = applied.pressure_kpa.iter().filter(|column| !column.is_empty()).collect();
    let scans = columns.first().map_or(0, |column| column.len());
    let is_open = |scan: usize| applied.area_sigma_kpa.get(scan).is_some_and(|sigma| sigma.is_infinite());
    let of = |scan: usize| {
        if is_open(scan) {
            return f64::NAN;
        }
        let read = columns.iter().map(|column| column[scan]).filter(|kpa| kpa.is_finite());
        let (sum, count) = read.fold((0.0, 0.0), |(sum, count), kpa| (sum + kpa, count + 1.0));
        sum / count
    };
    (0..scans).map(of).collect()
}
