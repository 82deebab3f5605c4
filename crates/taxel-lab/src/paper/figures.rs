//! Every figure of the paper that the data can draw, and why the others cannot be drawn.

use std::ops::Range;

use taxel_engine::statistics::quantile;
use taxel_model::TaxelModel;

use super::data::Data;
use crate::document::{Axis, Figure, Line, Look};
use crate::numbers::mean;

/// Samples that a figure shows at most of one kind: more hide each other.
const DOTS_MAX: usize = 6000;

/// As many runs as the paper shows the repeatability of.
pub(super) const RUNS: usize = 3;

/// Points of a curve.
const CURVE_POINTS: usize = 300;

/// Bars of a histogram, about.
const BARS: f64 = 30.0;

/// The paper's own mean error.
const PAPER_ERROR: f64 = 0.12;

/// What all figures are drawn from.
pub(super) struct Figures<'a> {
    data: &'a Data,
    models: &'a [TaxelModel],
    min_swing_counts: f64,
    /// Taxels with a model that may be used, by swing.
    usable: Vec<usize>,
}

/// A figure, or what the data lack for it.
pub(super) type Drawn = Result<Figure, String>;

impl<'a> Figures<'a> {
    /// For the models of `data`.
    pub fn new(data: &'a Data, models: &'a [TaxelModel], min_swing_counts: f64) -> Self {
        let mut usable: Vec<usize> = (0..models.len()).filter(|&taxel| models[taxel].is_usable()).collect();
        usable.sort_by(|&a, &b| swing(&models[a]).total_cmp(&swing(&models[b])));
        Self { data, models, min_swing_counts, usable }
    }

    /// All figures, in the order of the paper.
    pub fn all(&self) -> [(&'static str, Drawn); 9] {
        [
            ("raw counts against pressure", self.raw()),
            ("mean curve over the taxels", self.mean_curve()),
            ("histogram of the swing", self.swings()),
            ("histogram of the baseline", self.baselines()),
            ("repeatability of three runs", self.repeatability()),
            ("loop of both branches", self.both_branches()),
            ("fit over samples", self.fitted("fit-typical", "of median swing", 0.5)),
            ("fit over samples", self.fitted("fit-weak", "of little swing", 0.1)),
            ("measured against true force", self.forces()),
        ]
    }

    /// The usable taxel below which this share of the others' swings lies.
    fn taxel(&self, share: f64) -> Result<usize, String> {
        let at = (share * self.usable.len().saturating_sub(1) as f64).round() as usize;
        self.usable.get(at).copied().ok_or_else(|| "no taxel has a model that may be used".to_owned())
    }

    fn raw(&self) -> Drawn {
        let (data, taxel) = (self.data, self.taxel(0.5)?);
        let line = |name, up| {
            let scans = data.branches(up).cloned();
            Line::new(name, Look::Dots, thinned(scans.flat_map(|scans| data.samples(taxel, scans, |_| true)).collect()))
        };
        Ok(plot(
            "raw",
            format!("Raw counts of taxel {taxel} against pressure"),
            "Each dot is a scan, all runs together. The taxel is the one of median swing.",
            ["pressure, kPa", "raw count"],
            vec![line("pressure rises", true), line("pressure falls", false)],
        ))
    }

    fn mean_curve(&self) -> Drawn {
        self.taxel(0.5)?;
        let curve = |&taxel: &usize| {
            let rest = self.data.baseline(taxel);
            let bins = self.data.binned(self.data.risen(taxel));
            bins.into_iter().flatten().map(|(p, c)| (p, c - rest)).collect::<Vec<_>>()
        };
        let curves: Vec<Vec<(f64, f64)>> = self.usable.iter().map(curve).collect();
        let bins = curves.iter().map(Vec::len).min().unwrap_or(0);
        let over = |of: &dyn Fn(Vec<f64>) -> f64| -> Vec<(f64, f64)> {
            let column = |bin: usize| curves.iter().map(move |curve| curve[bin]);
            (0..bins).map(|bin| (mean(column(bin).map(|p| p.0)), of(column(bin).map(|p| p.1).collect()))).collect()
        };
        let share = |share: f64| over(&move |counts| quantile(counts, share).unwrap_or(f64::NAN));
        Ok(plot(
            "mean-curve",
            format!("Mean response of {} taxels", self.usable.len()),
            "Counts less the unloaded ones while the pressure rises, averaged in bins of equal pressure and then over all taxels \
             that are not excluded.",
            ["pressure, kPa", "change of the count, counts"],
            vec![
                Line::new("mean", Look::Plain, over(&|counts| mean(counts.into_iter()))),
                Line::new("10 % of the taxels below", Look::Dashed, share(0.1)),
                Line::new("90 % below", Look::Dashed, share(0.9)),
            ],
        ))
    }

    fn swings(&self) -> Drawn {
        let min_swing = self.min_swing_counts;
        let figure = self.histogram(
            "swing",
            "Swing",
            "Swing is the greatest less the least count while the pressure rises. A taxel below the threshold is excluded, and \
             nothing else excludes one.",
            "swing, counts",
            &|taxel| swing(&self.models[taxel]),
        )?;
        Ok(Figure { levels: vec![(min_swing, format!("threshold: {min_swing} counts"))], ..figure })
    }

    fn baselines(&self) -> Drawn {
        self.histogram(
            "baseline",
            "Baseline",
            "Mean count of the unloaded skin before the first rise.",
            "baseline, counts",
            &|taxel| self.data.baseline(taxel),
        )
    }

    /// How many taxels have which figure, those that are excluded by their swing apart.
    fn histogram(
        &self,
        id: &str,
        what: &str,
        caption: &str,
        label: &'static str,
        figure: &dyn Fn(usize) -> f64,
    ) -> Drawn {
        let of = |excluded: bool| -> Vec<f64> {
            let weak = |taxel: &usize| (swing(&self.models[*taxel]) < self.min_swing_counts) == excluded;
            (0..self.data.taxels()).filter(weak).map(figure).filter(|figure| figure.is_finite()).collect()
        };
        let (kept, excluded) = (of(false), of(true));
        if kept.is_empty() && excluded.is_empty() {
            return Err("no taxel has it: no scan is unloaded before the pressure rises".to_owned());
        }
        let title = format!("{what} of {} taxels, {} of them excluded", kept.len() + excluded.len(), excluded.len());
        let bars = histograms(&[("kept", kept), ("excluded by their swing", excluded)]);
        Ok(plot(id, title, caption, [label, "taxels"], bars))
    }

    fn repeatability(&self) -> Drawn {
        let taxel = self.taxel(0.5)?;
        let runs: Vec<_> = self.data.branches(true).take(RUNS).collect();
        if runs.len() < 2 {
            return Err(format!("{} run in the data, three are wanted", runs.len()));
        }
        Ok(plot(
            "repeatability",
            format!("Repeatability: taxel {taxel} in {} runs", runs.len()),
            "Mean counts in bins of equal pressure while it rises, one line a run.",
            ["pressure, kPa", "count, mean of each bin"],
            (1..).zip(runs).map(|(k, run)| self.branch_line(format!("run {k}"), taxel, run)).collect(),
        ))
    }

    /// A taxel's means over one branch.
    fn branch_line(&self, name: impl Into<String>, taxel: usize, scans: &Range<usize>) -> Line {
        Line::new(name, Look::Plain, self.data.branch(taxel, scans).into_iter().flatten())
    }

    fn both_branches(&self) -> Drawn {
        let taxel = self.taxel(0.5)?;
        let (rise, fall) = self.data.run_with_both().ok_or("no falling pressure follows a rise in the data")?;
        Ok(plot(
            "loop",
            format!("Hysteresis: taxel {taxel} on both branches"),
            "Mean counts of one run in bins of equal pressure.",
            ["pressure, kPa", "count, mean of each bin"],
            vec![self.branch_line("pressure rises", taxel, rise), self.branch_line("pressure falls", taxel, fall)],
        ))
    }

    /// A taxel's samples and its model, with the swing that is above this share of the others'.
    fn fitted(&self, id: &str, which: &str, share: f64) -> Drawn {
        let taxel = self.taxel(share)?;
        let model = &self.models[taxel];
        let curve = model.curve.as_ref().zip(model.range);
        let (curve, [low, high]) = curve.ok_or_else(|| format!("taxel {taxel} has no curve"))?;
        let at = |k: usize| low + (high - low) * k as f64 / (CURVE_POINTS - 1) as f64;
        let line = (0..CURVE_POINTS).map(|k| (at(k), curve.evaluate(at(k))));
        let samples = thinned(self.data.risen(taxel).map(|(p, c)| (c, p)).collect());
        Ok(plot(
            id,
            format!("Fit of taxel {taxel}, {which}"),
            format!(
                "Samples of rising pressure, and the polynomial of order {} that has the least squares over them: root mean \
                 square of the residuals {:.2} kPa, swing {} counts.",
                model.order, model.quality.rmse_kpa, model.quality.swing_counts
            ),
            ["raw count", "pressure, kPa"],
            vec![Line::new("samples", Look::Dots, samples), Line::new("fit", Look::Plain, line)],
        ))
    }

    fn forces(&self) -> Drawn {
        let mut lines: Vec<Line> = Vec::new();
        let mut most = 0.0_f64;
        for loads in &self.data.loads {
            most = loads.all.iter().fold(most, |most, load| most.max(load.true_n));
            let points = loads.all.iter().map(|load| (load.true_n, load.measured_n));
            lines.push(Line::new(loads.by.clone(), Look::Dots, points));
        }
        if lines.is_empty() {
            return Err("there is no known load".to_owned());
        }
        lines.push(Line::new("measured = true", Look::Plain, [(0.0, 0.0), (most, most)]));
        for (name, factor) in [("+12 %", 1.0 + PAPER_ERROR), ("-12 %", 1.0 - PAPER_ERROR)] {
            lines.push(Line::new(name, Look::Dashed, [(0.0, 0.0), (most, factor * most)]));
        }
        Ok(plot(
            "force",
            "Measured against true force of known loads",
            "One dot a load. The dashed lines are the mean error that the paper reports \
             of its real forearm.",
            ["true force, N", "measured force, N"],
            lines,
        ))
    }
}

/// A figure with evenly divided axes of these labels.
fn plot(
    id: &str,
    title: impl Into<String>,
    caption: impl Into<String>,
    labels: [&'static str; 2],
    lines: Vec<Line>,
) -> Figure {
    let (id, title, caption) = (id.to_owned(), title.into(), caption.into());
    let [x, y] = labels.map(|label| Axis { label, log: false });
    Figure { id, title, caption, x, y, lines, ..Figure::default() }
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
    let bin = |value: f64| (value / width).floor();
    let first = bin(low);
    let mut below = vec![0.0; (bin(high) - first) as usize + 1];
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
