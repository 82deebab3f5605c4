//! The sweep: method x order x number of taxels x course of the counts.

use std::hint::black_box;

use anyhow::Context;
use taxel_model::Dd;

use crate::document::{Axis, Band, Cell, Figure, Line, Point, Table};
use crate::live::measure::{Spread, in_turns};
use crate::live::methods::{FixedTable, Floor, Form, FullTable, Method, Naive, TrimmedTable, polynomial};
use crate::live::skin::{Course, Taxel, models, stream, taxels};

/// The knob.
const ORDERS: [u8; 3] = [3, 5, 9];
/// A forearm, and a whole robot.
pub const SIZES: [usize; 2] = [230, 5_000];
const COURSES: [Course; 2] = [Course::Walk, Course::Independent];

/// Taxels evaluated in one timed run: long against the clock's own cost.
const TAXELS_A_RUN: usize = 80_000;

/// A common pressure transmitter: 0.25 % of 70 kPa.
const GAUGE_KPA: f64 = 0.175;

/// One method at one order.
struct Row {
    method: &'static str,
    ours: bool,
    order: u8,
    /// Largest over all taxels of the larger skin and all counts, kPa; `None` for what computes no pressure.
    error_kpa: Option<f64>,
    /// ns per taxel by size and course.
    ns: [[Spread; COURSES.len()]; SIZES.len()],
}

/// All that was measured.
pub struct Sweep {
    rows: Vec<Row>,
    repetitions: usize,
    /// Half a count of the median taxel in the middle of its range, kPa.
    half_count_kpa: f64,
    /// Half an ulp of f32 at the highest pressure, kPa.
    half_ulp_kpa: f64,
}

/// Name, whether it is ours, and how it is built for some taxels.
type Contender = (&'static str, bool, Box<dyn Method>);

fn contenders(taxels: &[Taxel], exact_kpa: &[[f64; 256]], order: u8) -> anyhow::Result<Vec<Contender>> {
    let single = |form| polynomial::<f32>(taxels, order, form).context("order without a polynomial");
    let double = |form| polynomial::<f64>(taxels, order, form).context("order without a polynomial");
    Ok(vec![
        ("table f32", true, Box::new(FullTable::new(exact_kpa))),
        ("table f32, range only", false, Box::new(TrimmedTable::new(taxels, exact_kpa))),
        ("table u16, 1/512 kPa", false, Box::new(FixedTable::new(exact_kpa))),
        ("Horner f32, raw count", false, single(Form::RawHorner)?),
        ("Horner f64, raw count", false, double(Form::RawHorner)?),
        ("Horner f32, scaled", false, single(Form::ScaledHorner)?),
        ("Horner f64, scaled", false, double(Form::ScaledHorner)?),
        ("Clenshaw f32", false, single(Form::Clenshaw)?),
        ("Clenshaw f64", false, double(Form::Clenshaw)?),
        ("naive: powi f64, taxel by taxel", false, Box::new(Naive::new(taxels))),
    ])
}

/// Measures everything, `repetitions` runs each.
///
/// # Errors
/// An order that [`polynomial`] does not know.
pub fn measure(seed: u64, repetitions: usize) -> anyhow::Result<Sweep> {
    let largest = SIZES[SIZES.len() - 1];
    let mut sweep = Sweep { rows: Vec::new(), repetitions, half_count_kpa: f64::NAN, half_ulp_kpa: f64::NAN };
    for order in ORDERS {
        let taxels = taxels(&models(largest, order, seed));
        let exact = exact(&taxels);
        let rounded = rounded(&exact);
        if order == 5 {
            sweep.note_levels(&taxels, &rounded);
        }
        let mut all = contenders(&taxels, &rounded, order)?;
        let errors: Vec<f64> = all.iter().map(|(_, _, method)| max_error_kpa(method.as_ref(), &exact)).collect();
        all.push(("floor: load, convert, store", false, Box::new(Floor)));
        let mut ns = vec![[[Spread::default(); COURSES.len()]; SIZES.len()]; all.len()];
        for (at, &size) in SIZES.iter().enumerate() {
            let taxels = &taxels[..size.min(taxels.len())];
            let mut some = contenders(taxels, &rounded[..taxels.len()], order)?;
            some.push(("floor", false, Box::new(Floor)));
            for (course_at, &course) in COURSES.iter().enumerate() {
                let scans = stream(taxels, course, seed);
                let times = time(&some, &scans, repetitions);
                times.into_iter().zip(&mut ns).for_each(|(time, ns)| ns[at][course_at] = time);
            }
        }
        for (k, ((method, ours, _), ns)) in all.into_iter().zip(ns).enumerate() {
            sweep.rows.push(Row { method, ours, order, error_kpa: errors.get(k).copied(), ns });
        }
    }
    Ok(sweep)
}

/// The exact pressure of every count.
pub fn exact(taxels: &[Taxel]) -> Vec<[Dd; 256]> {
    taxels.iter().map(|taxel| std::array::from_fn(|count| taxel.exact(count as u8))).collect()
}

/// The same, correctly rounded.
pub fn rounded(exact: &[[Dd; 256]]) -> Vec<[f64; 256]> {
    exact.iter().map(|pressures| pressures.map(Dd::to_f64)).collect()
}

/// The largest error of a method over all counts of all taxels, kPa; infinite if it gives something that is no number.
pub fn max_error_kpa(method: &dyn Method, exact: &[[Dd; 256]]) -> f64 {
    let mut kpa = vec![0.0_f32; exact.len()];
    let mut worst = 0.0_f64;
    for count in 0..=u8::MAX {
        method.evaluate(&vec![count; exact.len()], &mut kpa);
        for (kpa, exact) in kpa.iter().zip(exact) {
            let error = (Dd::from(f64::from(*kpa)) - exact[usize::from(count)]).to_f64().abs();
            worst = worst.max(if error.is_finite() { error } else { f64::INFINITY });
        }
    }
    worst
}

/// ns per taxel of every contender on the same scans.
fn time(contenders: &[Contender], scans: &[Vec<u8>], repetitions: usize) -> Vec<Spread> {
    let taxels = scans[0].len();
    let rounds = TAXELS_A_RUN.div_ceil(taxels * scans.len());
    let mut kpa: Vec<Vec<f32>> = vec![vec![0.0; taxels]; contenders.len()];
    let mut runs: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for ((_, _, method), kpa) in contenders.iter().zip(&mut kpa) {
        runs.push(Box::new(move || {
            for scan in std::iter::repeat_n(scans, rounds).flatten() {
                method.evaluate(black_box(scan), kpa);
                black_box(&kpa);
            }
        }));
    }
    let mut turns: Vec<&mut dyn FnMut()> = runs.iter_mut().map(|run| &mut **run as &mut dyn FnMut()).collect();
    let per_taxel = 1.0 / (rounds * scans.len() * taxels) as f64;
    in_turns(&mut turns, repetitions).into_iter().map(|ns| ns.scaled(per_taxel)).collect()
}

impl Sweep {
    fn note_levels(&mut self, taxels: &[Taxel], exact_kpa: &[[f64; 256]]) {
        let half_count = |(taxel, kpa): (&Taxel, &[f64; 256])| {
            let middle = (0.5 * (taxel.range[0] + taxel.range[1])) as usize;
            0.25 * (kpa[middle + 1] - kpa[middle - 1]).abs()
        };
        self.half_count_kpa = Spread::of(taxels.iter().zip(exact_kpa).map(half_count).collect()).median;
        let highest = exact_kpa.iter().flatten().fold(0.0_f64, |most, kpa| most.max(*kpa));
        self.half_ulp_kpa = f64::from((highest as f32).next_up() - highest as f32) / 2.0;
    }

    fn of(&self, method: &str, order: u8) -> Option<&Row> {
        self.rows.iter().find(|row| row.method == method && row.order == order)
    }

    /// What came out, in words.
    pub fn sentences(&self) -> Vec<String> {
        let ns = |method: &str, size: usize| self.of(method, 5).map_or(f64::NAN, |row| row.ns[size][0].median);
        let error = |method: &str, order: u8| self.of(method, order).and_then(|row| row.error_kpa).unwrap_or(f64::NAN);
        let (table, horner) = ("table f32", "Horner f32, scaled");
        let (small, large) = (ns(table, 0) / ns(horner, 0), ns(table, 1) / ns(horner, 1));
        let naive = "naive: powi f64, taxel by taxel";
        vec![
            format!(
                "At order 5 and counts that walk, the table of f32 takes {:.2} ns a taxel for {} taxels and {:.2} ns for \
                 {}: {small:.2} and {large:.2} times as long as Horner's rule in scaled f32, and {:.0} times less than the \
                 naive way.",
                ns(table, 0),
                SIZES[0],
                ns(table, 1),
                SIZES[1],
                ns(naive, 1) / ns(table, 1)
            ),
            format!(
                "The table's largest error is {:.1e} kPa at every order, scaled Horner's {:.1e} kPa at order 5 and {:.1e} \
                 kPa at order 9. In powers of the raw count f32 is off by up to {:.1e} kPa at order 5, and f64 by up to \
                 {:.1e} kPa at order 9.",
                ORDERS.iter().map(|&order| error(table, order)).fold(0.0, f64::max),
                error(horner, 5),
                error(horner, 9),
                error("Horner f32, raw count", 5),
                error("Horner f64, raw count", 9)
            ),
        ]
    }

    /// One diagram per size.
    pub fn figures(&self) -> Vec<Figure> {
        SIZES.iter().enumerate().map(|(at, size)| self.figure(at, *size)).collect()
    }

    fn figure(&self, at: usize, size: usize) -> Figure {
        let mut lines: Vec<Line> = Vec::new();
        for row in &self.rows {
            let Some(error_kpa) = row.error_kpa else { continue };
            let ns = row.ns[at][0];
            let point =
                Point { x: ns.median, x_spread: Some((ns.p5, ns.p95)), y: error_kpa, mark: row.order.to_string() };
            match lines.iter_mut().find(|line| line.name == row.method) {
                Some(line) => line.points.push(point),
                None => lines.push(Line { name: row.method.to_owned(), ours: row.ours, points: vec![point] }),
            }
        }
        let floors = self.rows.iter().filter(|row| row.error_kpa.is_none()).map(|row| row.ns[at][0].median);
        let floor = Spread::of(floors.collect()).median;
        let band = |y, label: &str| Band { y, label: label.to_owned() };
        Figure {
            id: format!("c-live-{size}"),
            caption: format!(
                "{size} taxels, counts that walk. Left is faster, down is more exact; the marks are orders. To load, \
                 convert and store a count without any pressure takes {floor:.3} ns. Bars: 5 to 95 % of {} runs.",
                self.repetitions
            ),
            x: Axis { label: "ns per taxel".to_owned(), log: true },
            y: Axis { label: "largest error over all counts, kPa".to_owned(), log: true },
            lines,
            bands: vec![
                band(self.half_ulp_kpa, "half an ulp of f32"),
                band(GAUGE_KPA, "gauge: 0.25 % of 70 kPa"),
                band(self.half_count_kpa, "half a count"),
            ],
        }
    }

    /// All figures.
    pub fn table(&self) -> Table {
        let headings = ["ns/taxel, 230, walk", "230, independent", "5,000, walk", "5,000, independent"];
        let columns = ["method", "order", "largest error, kPa"].into_iter().chain(headings).map(str::to_owned);
        let row = |row: &Row| {
            let error = row.error_kpa.map_or_else(|| Cell::Text("none computed".to_owned()), Cell::Number);
            let times = row.ns.iter().flatten().map(|ns| Cell::Number(ns.median));
            let head = [Cell::Text(row.method.to_owned()), Cell::Number(f64::from(row.order)), error];
            head.into_iter().chain(times).collect()
        };
        Table {
            id: "c-live-methods".to_owned(),
            caption:
                "Medians. Counts walk by -1, 0 or 1 from scan to scan, or are independent from scan to scan, which \
                      meets more of a table's cache lines."
                    .to_owned(),
            columns: columns.collect(),
            rows: self.rows.iter().map(row).collect(),
        }
    }
}
