//! The speeds and precisions that were promised for a whole skin: 230 taxels, 6,000 scans of 8 bit.

use super::contenders::{BINNED, SVD, contenders, sums};
use super::panel::{MAX_ORDER, quantiles, worst_error_pa};
use super::taxels::{Bits, Recording};
use crate::document::{Cell, Table};
use crate::numpy::Numpy;
use crate::options::Options;
use std::hint::black_box;
use std::time::Instant;
use taxel_model::{Accumulator, FitOptions};

const TAXELS: usize = 230;
const SCANS: usize = 6000;

/// How many times faster than a loop of numpy.polyfit at least.
const WANTED_SPEED: f64 = 20.0;

/// How many times smaller an error than nalgebra's SVD on raw powers at order 9 at least.
const WANTED_PRECISION: f64 = 1e6;

fn milliseconds(run: impl FnOnce()) -> f64 {
    let start = Instant::now();
    run();
    start.elapsed().as_secs_f64() * 1e3
}

/// Times in ms of all repetitions.
#[derive(Default)]
struct Times {
    sums: Vec<f64>,
    fit: Vec<f64>,
    both: Vec<f64>,
    numpy: Vec<f64>,
}

/// Measures the aims and says whether they are met.
pub(super) fn table(options: &Options, numpy: &mut Option<Numpy>) -> anyhow::Result<Table> {
    let recording = Recording::simulate(Bits::Eight, SCANS, TAXELS, options.seed);
    let times = times(options, &recording, numpy)?;
    let median = |times: &[f64]| quantiles(times).1;
    let row = |what: &str, value: f64, wanted: &str, verdict: Cell| {
        vec![Cell::Text(what.to_owned()), Cell::Number(value), Cell::Text(wanted.to_owned()), verdict]
    };
    let none = || Cell::Text(String::new());
    let mut rows = vec![
        row("ours: sums of all samples, ms", median(&times.sums), "", none()),
        row("ours: fit of all taxels, order 5, defaults, ms", median(&times.fit), "", none()),
        row("ours: sums and fit, ms", median(&times.both), "", none()),
    ];
    let faster = "numpy.polyfit loop, order 5, over ours (sums and fit)";
    let wanted = format!(">= {WANTED_SPEED}");
    if times.numpy.is_empty() {
        rows.push(vec![
            Cell::Text(faster.to_owned()),
            Cell::Text("not measured".to_owned()),
            Cell::Text(wanted),
            Cell::Text("no numpy".to_owned()),
        ]);
    } else {
        let ratio = median(&times.numpy) / median(&times.both);
        rows.push(row("loop of numpy.polyfit, order 5, ms", median(&times.numpy), "", none()));
        rows.push(row(faster, ratio, &wanted, Cell::Verdict(ratio >= WANTED_SPEED)));
    }
    let mut worst = [f64::NAN; 2];
    for contender in contenders(false) {
        if let Some(at) = [BINNED, SVD].iter().position(|name| *name == contender.name) {
            worst[at] = worst_error_pa(&contender, &recording, MAX_ORDER)?;
        }
    }
    let [our_pa, svd_pa] = worst;
    let ratio = svd_pa / our_pa.max(f64::MIN_POSITIVE);
    rows.push(row("ours: max |dP| at order 9, Pa", our_pa, "", none()));
    rows.push(row("nalgebra SVD on raw powers: max |dP| at order 9, Pa", svd_pa, "", none()));
    let wanted = format!(">= {WANTED_PRECISION:e}");
    rows.push(row("SVD over ours", ratio, &wanted, Cell::Verdict(ratio >= WANTED_PRECISION)));
    Ok(Table {
        id: "a-fit-aims".to_owned(),
        caption: format!(
            "A whole skin: {TAXELS} taxels, {SCANS} scans of 8 bit, one thread. Medians of {} runs.",
            times.both.len()
        ),
        columns: ["what", "measured", "aim", "met"].map(str::to_owned).to_vec(),
        rows,
    })
}

/// Ours and numpy's loop in turns. Ours judges, repairs and tells uncertainties, numpy only solves.
fn times(options: &Options, recording: &Recording, numpy: &mut Option<Numpy>) -> anyhow::Result<Times> {
    if let Some(numpy) = numpy {
        let counts: Vec<&[f64]> = recording.taxels.iter().map(|taxel| taxel.counts.as_slice()).collect();
        numpy.load(&recording.kpa, &counts)?;
    }
    let defaults = FitOptions::default();
    let mut times = Times::default();
    for round in 0..=if options.quick { 15 } else { 30 } {
        let mut gathered: Vec<Accumulator> = Vec::new();
        let sums_ms = milliseconds(|| gathered = (0..TAXELS).map(|taxel| sums(recording, taxel)).collect());
        let fit_ms = milliseconds(|| gathered.iter().for_each(|sums| drop(black_box(sums.fit(&defaults)))));
        let numpy_ms = numpy.as_mut().map(|numpy| numpy.fit_all(5)).transpose()?.map(|fitted| fitted.us / 1e3);
        // The first round warms up.
        if round > 0 {
            times.sums.push(sums_ms);
            times.fit.push(fit_ms);
            times.both.push(sums_ms + fit_ms);
            times.numpy.extend(numpy_ms);
        }
    }
    Ok(times)
}
