//! Every figure of the paper that the data can draw, and why the others cannot be drawn.

use std::ops::Range;

use taxel_model::TaxelModel;

use crate::document::{Axis, Figure, Level, Line, Look};
use crate::numbers::mean;
use crate::paper::data::Data;
use crate::paper::statistics::{Binned, branch, differences, quantile};

/// Samples that a figure shows at most of one kind: more hide each other.
const DOTS_MAX: usize = 6000;

/// Points of a curve.
const CURVE_POINTS: usize = 300;

/// Bars of a histogram, about.
const BARS: f64 = 30.0;

/// The paper's own mean error.
const PAPER_ERROR: f64 = 0.12;

/// A figure that is not there.
#[derive(Clone, Debug, serde::Serialize)]
pub struct LeftOut {
    /// Its name.
    pub figure: &'static str,
    /// What the data lack.
    pub why: String,
}

/// What all figures are drawn from.
pub(super) struct Figures<'a> {
    data: &'a Data,
    models: &'a [TaxelModel],
    min_swing_counts: f64,
    /// Taxels with a model that may be used, by swing.
    usable: Vec<usize>,
}

/// A figure, or why there is none.
type Drawn = Result<Figure, LeftOut>;

impl<'a> Figures<'a> {
    /// For the models of `data`.
    pub fn new(data: &'a Data, models: &'a [TaxelModel], min_swing_counts: f64) -> Self {
        let mut usable: Vec<usize> = (0..models.len()).filter(|&taxel| models[taxel].is_usable()).collect();
        usable.sort_by(|&a, &b| swing(&models[a]).total_cmp(&swing(&models[b])));
        Self { data, models, min_swing_counts, usable }
    }

    /// All figures, in the order of the paper.
    pub fn all(&self) -> (Vec<Figure>, Vec<LeftOut>) {
        let drawn = [
            self.raw(),
            self.mean_curve(),
            Ok(self.swings()),
            self.baselines(),
            self.repeatability(),
            self.apart(),
            self.both_branches(),
            self.fitted("fit-typical", "of median swing", 0.5),
            self.fitted("fit-weak", "of little swing", 0.1),
            self.forces(),
        ];
        let (mut charts, mut left_out) = (Vec::new(), Vec::new());
        for figure in drawn {
            match figure {
                Ok(chart) => charts.push(chart),
                Err(why) => left_out.push(why),
            }
        }
        (charts, left_out)
    }

    /// The usable taxel below which this share of the others' swings lies.
    fn taxel(&self, share: f64, figure: &'static str) -> Result<usize, LeftOut> {
        let at = (share * self.usable.len().saturating_sub(1) as f64).round() as usize;
        let why = || LeftOut { figure, why: "no taxel has a model that may be used".to_owned() };
        self.usable.get(at).copied().ok_or_else(why)
    }

    fn raw(&self) -> Drawn {
        let (data, taxel) = (self.data, self.taxel(0.5, "raw counts against pressure")?);
        let of = |up: bool| {
            let scans = data.branches(up).cloned();
            thinned(scans.flat_map(|scans| data.samples(taxel, scans, |_| true)).collect())
        };
        let mut series = vec![Line::new("pressure rises", Look::Dots, of(true))];
        let fallen = of(false);
        if !fallen.is_empty() {
            series.push(Line::new("pressure falls", Look::Dots, fallen));
        }
        Ok(Figure {
            id: "raw".to_owned(),
            title: format!("Raw counts of taxel {taxel} against pressure"),
            caption: "Each dot is a scan, all runs together. The taxel is the one of median swing.".to_owned(),
            x: Axis::linear("pressure, kPa"),
            y: Axis::linear("raw count"),
            lines: series,
            ..Figure::default()
        })
    }

    fn mean_curve(&self) -> Drawn {
        self.taxel(0.5, "mean curve over the taxels")?;
        let curve = |&taxel: &usize| {
            let rest = self.data.baseline(taxel);
            Binned::new(self.data, self.data.risen(taxel)).points().map(|(p, c)| (p, c - rest)).collect::<Vec<_>>()
        };
        let curves: Vec<Vec<(f64, f64)>> = self.usable.iter().map(curve).collect();
        let bins = curves.iter().map(Vec::len).min().unwrap_or(0);
        let over = |of: &dyn Fn(Vec<f64>) -> f64| -> Vec<(f64, f64)> {
            let column = |bin: usize| curves.iter().map(move |curve| curve[bin]);
            (0..bins).map(|bin| (mean(column(bin).map(|p| p.0)), of(column(bin).map(|p| p.1).collect()))).collect()
        };
        let share = |share: f64| over(&move |counts| quantile(counts, share).unwrap_or(f64::NAN));
        let series = vec![
            Line::new("mean", Look::Plain, over(&|counts| mean(counts.into_iter()))),
            Line::new("10 % of the taxels below", Look::Dashed, share(0.1)),
            Line::new("90 % below", Look::Dashed, share(0.9)),
        ];
        Ok(Figure {
            id: "mean-curve".to_owned(),
            title: format!("Mean response of {} taxels", self.usable.len()),
            caption: "Counts less those at rest while the pressure rises, averaged in bins of equal pressure and then \
                      over all taxels that are not excluded."
                .to_owned(),
            x: Axis::linear("pressure, kPa"),
            y: Axis::linear("change of the count since rest, counts"),
            lines: series,
            ..Figure::default()
        })
    }

    fn swings(&self) -> Figure {
        let all: Vec<f64> = self.models.iter().map(swing).collect();
        let excluded = all.iter().filter(|swing| **swing < self.min_swing_counts).count();
        let below = |kept: bool| {
            all.iter().copied().filter(|swing| (*swing >= self.min_swing_counts) == kept).collect::<Vec<f64>>()
        };
        Figure {
            id: "swing".to_owned(),
            title: format!("Swing of {} taxels, {excluded} of them excluded", all.len()),
            caption:
                "Swing is the greatest less the least count while the pressure rises. A taxel below the threshold \
                      is excluded, and nothing else excludes one."
                    .to_owned(),
            x: Axis::linear("swing, counts"),
            y: Axis::linear("taxels"),
            lines: histograms(&[("kept", below(true)), ("excluded", below(false))]),
            levels: vec![Level::new(self.min_swing_counts, format!("threshold: {} counts", self.min_swing_counts))],
            ..Figure::default()
        }
    }

    fn baselines(&self) -> Drawn {
        let of = |excluded: bool| {
            let taxels =
                (0..self.data.taxels()).filter(|&t| (swing(&self.models[t]) < self.min_swing_counts) == excluded);
            taxels.map(|taxel| self.data.baseline(taxel)).filter(|count| count.is_finite()).collect::<Vec<f64>>()
        };
        let (kept, excluded) = (of(false), of(true));
        if kept.is_empty() && excluded.is_empty() {
            let why = "no scan is at rest before the pressure rises".to_owned();
            return Err(LeftOut { figure: "histogram of the baseline", why });
        }
        let threshold = self.min_swing_counts;
        Ok(Figure {
            id: "baseline".to_owned(),
            title: format!("Baseline of {} taxels", kept.len() + excluded.len()),
            caption: format!(
                "Mean count at rest before the first rise. Excluded are taxels with a swing below {threshold} counts."
            ),
            x: Axis::linear("baseline, counts"),
            y: Axis::linear("taxels"),
            lines: histograms(&[("kept", kept), ("excluded by their swing", excluded)]),
            ..Figure::default()
        })
    }

    fn repeatability(&self) -> Drawn {
        let figure = "repeatability of three runs";
        let (taxel, runs) = (self.taxel(0.5, figure)?, self.runs(figure)?);
        let series = runs
            .iter()
            .enumerate()
            .map(|(k, run)| Line::new(format!("run {}", k + 1), Look::Plain, branch(self.data, taxel, run).points()));
        Ok(Figure {
            id: "repeatability".to_owned(),
            title: format!("Repeatability: taxel {taxel} in {} runs", runs.len()),
            caption: "Mean counts in bins of equal pressure while it rises, one line a run.".to_owned(),
            x: Axis::linear("pressure, kPa"),
            y: Axis::linear("count, mean of each bin"),
            lines: series.collect(),
            ..Figure::default()
        })
    }

    /// The first three runs, or the two there are.
    fn runs(&self, figure: &'static str) -> Result<Vec<&'a Range<usize>>, LeftOut> {
        let runs: Vec<_> = self.data.branches(true).take(3).collect();
        let why = || format!("{} run in the data, three are wanted", runs.len());
        if runs.len() < 2 { Err(LeftOut { figure, why: why() }) } else { Ok(runs) }
    }

    /// The lines of three runs lie on each other: what they differ by, for all taxels.
    fn apart(&self) -> Drawn {
        let figure = "differences between three runs";
        self.taxel(0.5, figure)?;
        let runs = self.runs(figure)?;
        let apart = differences(self.data, &self.usable, &runs);
        let series = apart.into_iter().enumerate();
        Ok(Figure {
            id: "repeatability-difference".to_owned(),
            title: format!("Repeatability: {} runs less their mean", runs.len()),
            caption: format!(
                "Mean over the {} taxels that are not excluded, in bins of equal pressure, of each run's count less \
                 the mean of the runs.",
                self.usable.len()
            ),
            x: Axis::linear("pressure, kPa"),
            y: Axis::linear("difference, counts"),
            lines: series.map(|(k, run)| Line::new(format!("run {}", k + 1), Look::Plain, run)).collect(),
            ..Figure::default()
        })
    }

    fn both_branches(&self) -> Drawn {
        let figure = "loop of both branches";
        let taxel = self.taxel(0.5, figure)?;
        let why = || LeftOut { figure, why: "no falling pressure follows a rise in the data".to_owned() };
        let (rise, fall) = self.data.run_with_both().ok_or_else(why)?;
        Ok(Figure {
            id: "loop".to_owned(),
            title: format!("Hysteresis: taxel {taxel} on both branches"),
            caption: "Mean counts of one run in bins of equal pressure.".to_owned(),
            x: Axis::linear("pressure, kPa"),
            y: Axis::linear("count, mean of each bin"),
            lines: vec![
                Line::new("pressure rises", Look::Plain, branch(self.data, taxel, rise).points()),
                Line::new("pressure falls", Look::Plain, branch(self.data, taxel, fall).points()),
            ],
            ..Figure::default()
        })
    }

    /// A taxel's samples and its model, with the swing that is above this share of the others'.
    fn fitted(&self, id: &'static str, which: &str, share: f64) -> Drawn {
        let figure = "fit over samples";
        let taxel = self.taxel(share, figure)?;
        let model = &self.models[taxel];
        let why = || LeftOut { figure, why: format!("taxel {taxel} has no curve") };
        let (curve, [low, high]) = model.curve.as_ref().zip(model.range).ok_or_else(why)?;
        let at = |k: usize| low + (high - low) * k as f64 / (CURVE_POINTS - 1) as f64;
        let line = (0..CURVE_POINTS).map(|k| (at(k), curve.evaluate(at(k))));
        let samples = thinned(self.data.risen(taxel).map(|(p, c)| (c, p)).collect());
        Ok(Figure {
            id: id.to_owned(),
            title: format!("Fit of taxel {taxel}, {which}"),
            caption: format!(
                "Samples of rising pressure, and the polynomial of order {} that has the least squares over them: \
                 root mean square of the residuals {:.2} kPa, swing {} counts.",
                model.order, model.quality.rmse_kpa, model.quality.swing_counts
            ),
            x: Axis::linear("raw count"),
            y: Axis::linear("pressure, kPa"),
            lines: vec![Line::new("samples", Look::Dots, samples), Line::new("fit", Look::Plain, line)],
            ..Figure::default()
        })
    }

    fn forces(&self) -> Drawn {
        let figure = "measured against true force";
        let mut series: Vec<Line> = Vec::new();
        let mut most = 0.0_f64;
        for loads in self.data.loads() {
            most = loads.all.iter().fold(most, |most, load| most.max(load.true_n));
            let points = loads.all.iter().map(|load| (load.true_n, load.measured_n));
            series.push(Line::new(loads.by.clone(), Look::Marks, points));
        }
        if series.is_empty() {
            return Err(LeftOut { figure, why: self.data.why_no_loads().to_owned() });
        }
        series.push(Line::new("measured = true", Look::Plain, [(0.0, 0.0), (most, most)]));
        for (name, factor) in [("+12 %", 1.0 + PAPER_ERROR), ("-12 %", 1.0 - PAPER_ERROR)] {
            series.push(Line::new(name, Look::Dashed, [(0.0, 0.0), (most, factor * most)]));
        }
        Ok(Figure {
            id: "force".to_owned(),
            title: "Measured against true force of known loads".to_owned(),
            caption: "One mark a load, side by side where several were read. The dashed lines are the mean error that the paper reports of its real forearm."
                .to_owned(),
            x: Axis::linear("true force, N"),
            y: Axis::linear("measured force, N"),
            lines: series,
            ..Figure::default()
        })
    }
}

/// Greatest less least count of the rising samples.
pub(super) fn swing(model: &TaxelModel) -> f64 {
    model.quality.swing_counts
}

/// Every so many points, where there are too many to be told apart.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let step = points.len().div_ceil(DOTS_MAX).max(1);
    points.into_iter().step_by(step).collect()
}

/// Bars over common bins, stacked: the last set stands on the axis, those before it above.
fn histograms(sets: &[(&str, Vec<f64>)]) -> Vec<Line> {
    let all = || sets.iter().flat_map(|(_, values)| values).copied();
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    let width = ((high - low) / BARS).ceil().max(1.0);
    let width = if width.is_finite() { width } else { 1.0 };
    let bin = |value: f64| (value / width).floor();
    let first = if low.is_finite() { bin(low) } else { 0.0 };
    let bars = if high.is_finite() { (bin(high) - first) as usize + 1 } else { 0 };
    let mut below = vec![0.0; bars];
    let mut series: Vec<Line> = Vec::new();
    for (name, values) in sets.iter().rev() {
        for value in values {
            below[(bin(*value) - first) as usize] += 1.0;
        }
        let tops = below.iter().enumerate().map(|(k, top)| (width * (first + k as f64 + 0.5), *top));
        series.push(Line::new(*name, Look::Bars(width), tops));
    }
    // Each is drawn over the taller ones before it.
    series.reverse();
    series
}
