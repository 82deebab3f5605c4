//! The error table, and what the calibration came to.

use std::fmt::Write;

use serde::Serialize;
use taxel_model::{Flag, Status, TaxelModel};

use crate::document::{Cell, row};
use crate::numbers::mean;
use crate::paper::data::{Data, Weighing};
use crate::paper::figures::{LeftOut, swing};
use crate::paper::statistics::{loop_counts, quantile, repeatability_counts};

/// All figures of the tables.
#[derive(Clone, Debug, Serialize)]
pub struct Tables {
    /// Where the data are from.
    pub source: String,
    /// What was calibrated.
    pub calibration: Calibration,
    /// Known loads, each way of reading for itself; empty without any.
    pub errors: Vec<Errors>,
    /// Figures that the data cannot draw.
    pub left_out: Vec<LeftOut>,
}

/// What the calibration came to.
#[derive(Clone, Debug, Serialize)]
pub struct Calibration {
    /// Taxels in the data.
    pub taxels: usize,
    /// Taxels with a model that may be used.
    pub usable: usize,
    /// Taxels whose swing is below the threshold.
    pub excluded_by_swing: usize,
    /// Taxels without a model for another reason: they never changed, or have no reading.
    pub without_curve: usize,
    /// Usable models whose curve turns within its range.
    pub not_monotone: usize,
    /// The threshold of the exclusion.
    pub min_swing_counts: f64,
    /// Scans in the data, and those of rising pressure.
    pub scans: usize,
    /// Scans of rising pressure: the rows of the paper's equation.
    pub rising_scans: usize,
    /// Rises of the pressure.
    pub runs: usize,
    /// Least and greatest pressure.
    pub pressure_kpa: [f64; 2],
    /// Median swing of the usable taxels.
    pub swing_counts: Option<f64>,
    /// Median root mean square of their residuals.
    pub rmse_kpa: Option<f64>,
    /// Root mean square of the standard deviation between runs at equal pressure.
    pub repeatability_counts: Option<f64>,
    /// Median distance of the two branches at equal pressure.
    pub hysteresis_counts: Option<f64>,
}

/// Known loads that were read in one way.
#[derive(Clone, Debug, Serialize)]
pub struct Errors {
    /// Which models, and how their pressures are summed.
    pub by: String,
    /// Each load, ascending.
    pub rows: Vec<ErrorRow>,
    /// All of them together.
    pub mean_absolute_percent: f64,
}

/// One load.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorRow {
    /// The mass, if one was laid on.
    pub kilogram: Option<f64>,
    /// Its force.
    pub true_n: f64,
    /// How often it was laid on.
    pub loads: usize,
    /// Mean of the force read.
    pub measured_n: f64,
    /// Standard deviation of that over the loads; none of a single one.
    pub scatter_n: Option<f64>,
    /// Mean error.
    pub mean_percent: f64,
    /// Mean absolute error.
    pub mean_absolute_percent: f64,
}

impl Tables {
    /// For the models of `data`.
    pub(super) fn new(data: &Data, models: &[TaxelModel], min_swing_counts: f64, left_out: Vec<LeftOut>) -> Self {
        let usable: Vec<usize> = (0..models.len()).filter(|&taxel| models[taxel].is_usable()).collect();
        let median = |of: &dyn Fn(&TaxelModel) -> f64| quantile(usable.iter().map(|&t| of(&models[t])).collect(), 0.5);
        let weak = |model: &&TaxelModel| {
            matches!(model.status, Status::InsufficientSwing { .. }) || swing(model) < min_swing_counts
        };
        let excluded_by_swing = models.iter().filter(weak).count();
        let turns = |model: &TaxelModel| model.flags.iter().any(|flag| matches!(flag, Flag::NotMonotone { .. }));
        let (low, high) = data.range_kpa();
        let calibration = Calibration {
            taxels: models.len(),
            usable: usable.len(),
            excluded_by_swing,
            without_curve: models.len() - usable.len() - excluded_by_swing,
            not_monotone: usable.iter().filter(|&&taxel| turns(&models[taxel])).count(),
            min_swing_counts,
            scans: data.scans(),
            rising_scans: data.rising_scans(),
            runs: data.branches(true).count(),
            pressure_kpa: [low, high],
            swing_counts: median(&swing),
            rmse_kpa: median(&|model| model.quality.rmse_kpa),
            repeatability_counts: repeatability_counts(data, &usable),
            hysteresis_counts: loop_counts(data, &usable),
        };
        let errors = data.loads().map(|loads| Errors::new(&loads.by, &loads.all)).collect();
        Self { source: data.source().to_owned(), calibration, errors, left_out }
    }

    /// Rows of words: what, and how much.
    pub(super) fn calibration_rows(&self) -> Vec<(&'static str, String)> {
        let c = &self.calibration;
        let or_none = |value: Option<f64>, unit: &str| {
            value.map_or_else(|| "the data cannot say".to_owned(), |value| format!("{value:.2} {unit}"))
        };
        vec![
            ("data", self.source.clone()),
            ("taxels", format!("{}, {} with a model", c.taxels, c.usable)),
            ("excluded", format!("{} with a swing below {} counts", c.excluded_by_swing, c.min_swing_counts)),
            ("without a curve", format!("{} that never changed or have no reading", c.without_curve)),
            ("curves that turn within their range", format!("{} of {}", c.not_monotone, c.usable)),
            ("pressure", format!("{:.1} to {:.1} kPa", c.pressure_kpa[0], c.pressure_kpa[1])),
            ("runs", c.runs.to_string()),
            ("scans", format!("{}, {} of them of rising pressure", c.scans, c.rising_scans)),
            ("swing, median", or_none(c.swing_counts, "counts")),
            ("residual of the fit, root mean square, median", or_none(c.rmse_kpa, "kPa")),
            ("repeatability of the runs, standard deviation", or_none(c.repeatability_counts, "counts")),
            ("distance of the branches, median", or_none(c.hysteresis_counts, "counts")),
        ]
    }

    /// As Markdown, which is readable as text, too.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut out = "# The paper's figures and table\n\n| calibration | |\n|---|---|\n".to_owned();
        // Writing to a string cannot fail.
        for (what, value) in self.calibration_rows() {
            let _ = writeln!(out, "| {what} | {} |", value.replace('|', "\\|"));
        }
        for errors in &self.errors {
            let _ = writeln!(out, "\nForce error: {}\n\n| {} |", errors.by, Errors::COLUMNS.join(" | "));
            let _ = writeln!(out, "|{}", "---|".repeat(Errors::COLUMNS.len()));
            for row in errors.cells() {
                let _ = writeln!(out, "| {} |", row.iter().map(Cell::words).collect::<Vec<_>>().join(" | "));
            }
        }
        if !self.left_out.is_empty() {
            out.push_str("\nLeft out, because the data cannot draw it:\n\n");
            for left_out in &self.left_out {
                let _ = writeln!(out, "- {}: {}", left_out.figure, left_out.why);
            }
        }
        out
    }
}

impl Errors {
    /// Headings of the table.
    pub(super) const COLUMNS: [&str; 7] =
        ["mass, kg", "true, N", "loads", "measured, N", "scatter, N", "mean error, %", "mean absolute error, %"];

    fn new(by: &str, all: &[Weighing]) -> Self {
        let mut sorted = all.to_vec();
        sorted.sort_by(|a, b| a.true_n.total_cmp(&b.true_n));
        // The same mass is the same load, whatever rounding says.
        let same = |a: &Weighing, b: &Weighing| (b.true_n - a.true_n).abs() <= 1e-6 * a.true_n.abs();
        let rows = sorted.chunk_by(same).map(ErrorRow::new).collect();
        let mean_absolute_percent = mean(all.iter().map(|load| percent(load).abs()));
        Self { by: by.to_owned(), rows, mean_absolute_percent }
    }

    /// The table's cells, the last row over all loads.
    pub(super) fn cells(&self) -> Vec<Vec<Cell>> {
        let loads = self.rows.iter().map(|row| row.loads).sum::<usize>();
        let all = row!["all", "", loads.to_string(), "", "", "", format!("{:.1}", self.mean_absolute_percent)];
        self.rows.iter().map(ErrorRow::cells).chain([all]).collect()
    }
}

impl ErrorRow {
    fn new(loads: &[Weighing]) -> Self {
        let measured_n = mean(loads.iter().map(|load| load.measured_n));
        let squares = loads.iter().map(|load| (load.measured_n - measured_n).powi(2)).sum::<f64>();
        Self {
            kilogram: loads.first().and_then(|load| load.kilogram),
            true_n: mean(loads.iter().map(|load| load.true_n)),
            loads: loads.len(),
            measured_n,
            scatter_n: (loads.len() > 1).then(|| (squares / (loads.len() - 1) as f64).sqrt()),
            mean_percent: mean(loads.iter().map(percent)),
            mean_absolute_percent: mean(loads.iter().map(|load| percent(load).abs())),
        }
    }

    fn cells(&self) -> Vec<Cell> {
        let or_blank = |value: Option<f64>, places: usize| value.map_or_else(String::new, |v| format!("{v:.places$}"));
        row![
            or_blank(self.kilogram, 3),
            format!("{:.2}", self.true_n),
            self.loads.to_string(),
            format!("{:.2}", self.measured_n),
            or_blank(self.scatter_n, 2),
            format!("{:+.1}", self.mean_percent),
            format!("{:.1}", self.mean_absolute_percent),
        ]
    }
}

fn percent(load: &Weighing) -> f64 {
    100.0 * (load.measured_n / load.true_n - 1.0)
}
