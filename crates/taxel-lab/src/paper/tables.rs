//! The error table, and what the calibration came to.

use serde_json::Value;
use taxel_engine::statistics::median;
use taxel_model::{Flag, Status, TaxelModel};

use super::data::{Data, Weighing, Weighings};
use super::figures::swing;
use crate::document::{Table, row};
use crate::numbers::mean;

/// What the calibration came to.
pub(super) fn calibration(data: &Data, models: &[TaxelModel], min_swing: f64) -> Table {
    let usable: Vec<usize> = (0..models.len()).filter(|&taxel| models[taxel].is_usable()).collect();
    let median_of = |of: &dyn Fn(&TaxelModel) -> f64| median(usable.iter().map(|&taxel| of(&models[taxel])));
    let weak =
        |model: &&TaxelModel| matches!(model.status, Status::InsufficientSwing { .. }) || swing(model) < min_swing;
    let excluded = models.iter().filter(weak).count();
    let turns = |model: &TaxelModel| model.flags.iter().any(|flag| matches!(flag, Flag::NotMonotone { .. }));
    let turning = usable.iter().filter(|&&taxel| turns(&models[taxel])).count();
    let (low, high) = data.range_kpa();
    let known = |value: Option<f64>, unit: &str| {
        value.map_or_else(|| "the data cannot say".to_owned(), |value| format!("{value:.2} {unit}"))
    };
    let rows = vec![
        row!["taxels", format!("{}, {} with a model", models.len(), usable.len())],
        row!["excluded", format!("{excluded} with a swing below {min_swing} counts")],
        row!["curves that turn within their range", format!("{turning} of {}", usable.len())],
        row!["pressure", format!("{low:.1} to {high:.1} kPa")],
        row!["runs", data.branches(true).count().to_string()],
        row!["scans", data.scans()],
        row!["swing, median", known(median_of(&swing), "counts")],
        row!["residual of the fit, root mean square, median", known(median_of(&|model| model.quality.rmse_kpa), "kPa")],
    ];
    Table::new("calibration", "The calibration.", ["what", "how much"], rows)
}

/// Known loads that were read in one way: a row a mass.
pub(super) fn errors(at: usize, loads: &Weighings) -> Table {
    let mut sorted = loads.all.clone();
    sorted.sort_by(|a, b| a.true_n.total_cmp(&b.true_n));
    // The same mass is the same load, whatever rounding says.
    let same = |a: &Weighing, b: &Weighing| (b.true_n - a.true_n).abs() <= 1e-6 * a.true_n.abs();
    let rows = sorted.chunk_by(same).map(error_row).collect();
    let all = mean(loads.all.iter().map(|load| percent(load).abs()));
    let caption = format!("Force error of known loads, {}: mean absolute error {all:.1} %.", loads.by);
    let columns = ["mass, kg", "true, N", "loads", "measured, N", "mean error, %", "mean absolute error, %"];
    Table::new(&format!("force-errors-{at}"), caption, columns, rows)
}

fn error_row(loads: &[Weighing]) -> Vec<Value> {
    let over = |of: &dyn Fn(&Weighing) -> f64| mean(loads.iter().map(of));
    let kilogram = loads.first().and_then(|load| load.kilogram);
    row![
        kilogram.map_or_else(|| "".into(), Value::from),
        over(&|load| load.true_n),
        loads.len() as f64,
        over(&|load| load.measured_n),
        over(&percent),
        over(&|load| percent(load).abs()),
    ]
}

fn percent(load: &Weighing) -> f64 {
    100.0 * (load.measured_n / load.true_n - 1.0)
}
