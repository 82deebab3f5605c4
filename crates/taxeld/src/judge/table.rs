//! The table of taxel-model's README: every recipe, with and without tare, on recordings that no fit saw.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use taxel_engine::calibration::fit::{
    Applied, ApplyRecipe, Branch, FitRecipe, PlaysChoice, Tare, Unread, apply, fit, judge,
};
use taxel_model::{Estimator, FitOptions, Order};

use crate::fit::scans_of;
use crate::recording::Recording;
use crate::soundness::{Wanted, check};
use crate::threads::Threads;

/// Name and recipe; the last is what `taxeld fit` does by default.
fn recipes() -> [(&'static str, FitRecipe); 6] {
    let paper = |order| FitRecipe {
        options: FitOptions { order: Order::Fixed(order), estimator: Estimator::PerSample, ..FitOptions::default() },
        branch: Branch::Rising,
        plays: PlaysChoice::Off,
        smooth_s: 0.0,
        ..FitRecipe::default()
    };
    let fixed = |order, smooth_s| FitRecipe {
        options: FitOptions { order, ..FitOptions::default() },
        plays: PlaysChoice::Off,
        smooth_s,
        ..FitRecipe::default()
    };
    [
        ("paper: order 5, per-sample, rising, not smoothed", paper(5)),
        ("cubic: the same, order 3", paper(3)),
        ("binned: order 5, both branches, not smoothed", fixed(Order::Fixed(5), 0.0)),
        ("binned, 0.5 s", fixed(Order::Fixed(5), 0.5)),
        ("auto: order by PRESS, binned, 0.5 s", fixed(Order::Auto, 0.5)),
        ("plays, 0.5 s (default)", FitRecipe::default()),
    ]
}

/// Prints the table as Markdown.
///
/// # Errors
/// A recording of the three that cannot be read.
pub fn print(directory: &Path) -> anyhow::Result<()> {
    let read = |name: &str| -> anyhow::Result<Recording> {
        let path = directory.join(format!("{name}.csv.gz"));
        let mut recording = Recording::read(&path)?;
        let named = || path.display().to_string();
        let notes = check(&mut recording, Wanted::FIT).with_context(named)?;
        notes.iter().for_each(|note| eprintln!("{}: {note}", path.display()));
        Ok(recording)
    };
    let calibration = read("left_calibration")?;
    let judged = [("validation", read("left_validation")?), ("steps", read("left_steps")?)];
    say!("| recipe | fit | judged on | tare | area-mean | taxel RMSE (median) | within 95 % | taxels | left out |");
    say!("|---|---|---|---|---|---|---|---|---|");
    for (name, recipe) in recipes() {
        let began = Instant::now();
        let set = fit(&scans_of(&calibration), &recipe, &Threads)?;
        let took = began.elapsed().as_secs_f64();
        for (file, recording) in &judged {
            let scans = scans_of(recording);
            let gauge = scans.pressure_kpa.with_context(|| format!("{file}: there is no column `pressure_kpa`"))?;
            for (tare, word) in [(Tare::None, "none"), (Tare::Auto, "auto")] {
                let applied = apply(&scans, &set, &ApplyRecipe { tare, sigma: true, ..ApplyRecipe::default() })?;
                let score = judge(&applied, gauge);
                let coverage = score.coverage_percent.map_or("-".to_owned(), |c| format!("{c:.1} %"));
                let tare = if applied.zero.is_tared() || tare == Tare::None { word } else { "refused" };
                say!(
                    "| {name} | {took:.2} s | {file} | {tare} | {:.2} % | {:.1} ({:.1}) kPa | {coverage} | {} | {} |",
                    score.area_percent,
                    score.taxel_rmse_kpa,
                    score.taxel_rmse_median_kpa,
                    score.taxels,
                    left_out(&applied)
                );
            }
        }
    }
    Ok(())
}

/// How many taxels are left out for which reason.
fn left_out(applied: &Applied) -> String {
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    for why in applied.unread.iter().flatten() {
        let reason = match why {
            Unread::Model(status) => status.code(),
            Unread::NoZero | Unread::NoBaseline => "no zero",
            Unread::Faulty => "faulty throughout",
        };
        *reasons.entry(reason).or_default() += 1;
    }
    reasons.iter().map(|(reason, taxels)| format!("{taxels} {reason}")).collect::<Vec<_>>().join(", ")
}
