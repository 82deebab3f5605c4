//! Evaluation and sum: the engine's own call against its aim, and what else safe code can do.

use std::hint::black_box;

use taxel_model::TaxelModel;

use crate::document::{Cell, Table};
use crate::live::measure::{Spread, in_turns};
use crate::live::methods::{Floor, Method};
use crate::live::skin::{Course, Taxel, models, stream, taxels};
use crate::live::sweep::{exact, rounded};
use crate::live::total::{HornerForces, PartialSums, Total, TrimmedForces, evaluator, exact_newton};

/// Numbers of taxels, ascending; the last is the aim's.
const SIZES: [usize; 4] = [230, 1_000, 2_500, 5_000];

/// The aim: so many taxels evaluated and summed in so long, and within so many times of the floor.
const AIM_US: f64 = 2.5;
const AIM_FLOORS: f64 = 2.0;

/// Scans of the synthetic stream are gone through so often in one timed run of the largest size.
const TAXELS_A_RUN: usize = 320_000;

const ENGINE: &str = "engine: Evaluator::total_n";
const HORNER: &str = "Horner f32, scaled, with range, threshold and area";
const FLOOR: &str = "floor: load, convert, store";

/// One way to the force, at order 5.
struct Row {
    name: &'static str,
    /// Largest error of the total of 5,000 taxels over all scans, N; `None` for what computes no force.
    error_n: Option<f64>,
    /// ns per taxel, by size; counts walk.
    ns: [Spread; SIZES.len()],
    /// The same for the largest size with independent counts, and at rest but for one taxel in twenty.
    other_ns: [Spread; 2],
}

/// All that was measured.
pub struct Forces {
    rows: Vec<Row>,
    repetitions: usize,
}

/// The floor, as something that could be a force.
struct FloorTotal(std::cell::RefCell<Vec<f32>>);

impl Total for FloorTotal {
    fn total_n(&self, counts: &[u8]) -> f64 {
        let mut stored = self.0.borrow_mut();
        Floor.evaluate(counts, &mut stored);
        black_box(&mut stored);
        0.0
    }
}

fn contenders(models: &[TaxelModel], taxels: &[Taxel], exact_n: &[[f64; 256]]) -> Vec<(&'static str, Box<dyn Total>)> {
    vec![
        (ENGINE, Box::new(evaluator(models))),
        ("table f32, partial sums in f32", Box::new(PartialSums::<false>::new(exact_n))),
        ("table f32, sixteen untouched passed over", Box::new(PartialSums::<true>::new(exact_n))),
        ("table f32, touched counts only", Box::new(TrimmedForces::new(taxels, exact_n))),
        (HORNER, Box::new(HornerForces::<6>::new(taxels))),
        (FLOOR, Box::new(FloorTotal(vec![0.0; taxels.len()].into()))),
    ]
}

/// Measures everything, `repetitions` runs each.
pub fn measure(seed: u64, repetitions: usize) -> Forces {
    let largest = SIZES[SIZES.len() - 1];
    // Models that may not be used would cost the engine nothing and the others their time.
    let mut models = models(largest + largest / 20, 5, seed);
    models.retain(TaxelModel::is_usable);
    models.truncate(largest);
    let taxels = taxels(&models);
    let exact_n = exact_newton(&rounded(&exact(&taxels)));
    let mut rows: Vec<Row> = Vec::new();
    for (at, &size) in SIZES.iter().enumerate() {
        let taxels = &taxels[..size.min(taxels.len())];
        let all = contenders(&models[..taxels.len()], taxels, &exact_n[..taxels.len()]);
        let scans = stream(taxels, Course::Walk, seed);
        let walk = time(&all, &scans, repetitions);
        let last = size == largest;
        let others = [Course::Independent, Course::Touch]
            .map(|course| if last { time(&all, &stream(taxels, course, seed), repetitions) } else { Vec::new() });
        for (k, (name, total)) in all.iter().enumerate() {
            if rows.len() == k {
                let (ns, other_ns) = Default::default();
                rows.push(Row { name, error_n: None, ns, other_ns });
            }
            rows[k].ns[at] = walk[k];
            if last {
                rows[k].other_ns = [others[0][k], others[1][k]];
                rows[k].error_n = (*name != FLOOR).then(|| max_error_n(total.as_ref(), &scans, &exact_n));
            }
        }
    }
    Forces { rows, repetitions }
}

fn time(contenders: &[(&'static str, Box<dyn Total>)], scans: &[Vec<u8>], repetitions: usize) -> Vec<Spread> {
    let taxels = scans[0].len();
    let rounds = TAXELS_A_RUN.div_ceil(taxels * scans.len());
    let mut runs: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for (_, total) in contenders {
        runs.push(Box::new(move || {
            for scan in std::iter::repeat_n(scans, rounds).flatten() {
                black_box(total.total_n(black_box(scan)));
            }
        }));
    }
    let mut turns: Vec<&mut dyn FnMut()> = runs.iter_mut().map(|run| &mut **run as &mut dyn FnMut()).collect();
    let per_taxel = 1.0 / (rounds * scans.len() * taxels) as f64;
    in_turns(&mut turns, repetitions).into_iter().map(|ns| ns.scaled(per_taxel)).collect()
}

/// Against the sum in f64 of all correctly rounded forces.
pub fn max_error_n(total: &dyn Total, scans: &[Vec<u8>], exact_n: &[[f64; 256]]) -> f64 {
    let error = |scan: &Vec<u8>| {
        let truth: f64 = scan.iter().zip(exact_n).map(|(count, exact)| exact[usize::from(*count)]).sum();
        (total.total_n(scan) - truth).abs()
    };
    scans.iter().map(error).fold(0.0, f64::max)
}

impl Forces {
    fn ns(&self, name: &str, at: usize) -> f64 {
        self.rows.iter().find(|row| row.name == name).map_or(f64::NAN, |row| row.ns[at].median)
    }

    /// The fastest way to a force but the engine's, and its time over the engine's.
    fn fastest_other(&self, ns: impl Fn(&Row) -> f64) -> (&'static str, f64) {
        let engine = self.rows.iter().find(|row| row.name == ENGINE).map_or(f64::NAN, &ns);
        let others = self.rows.iter().filter(|row| row.error_n.is_some() && row.name != ENGINE);
        let fastest = others.min_by(|a, b| ns(a).total_cmp(&ns(b)));
        fastest.map_or(("none", f64::NAN), |row| (row.name, ns(row) / engine))
    }

    /// Microseconds for one scan of the largest size.
    fn scan_us(&self, name: &str) -> f64 {
        self.ns(name, SIZES.len() - 1) * SIZES[SIZES.len() - 1] as f64 * 1e-3
    }

    /// Microseconds of the engine for one scan of the largest size with one taxel in twenty touched.
    fn touched_us(&self) -> f64 {
        let engine = self.rows.iter().find(|row| row.name == ENGINE);
        engine.map_or(f64::NAN, |row| row.other_ns[1].median * SIZES[SIZES.len() - 1] as f64 * 1e-3)
    }

    /// What came out, in words.
    pub fn sentences(&self) -> Vec<String> {
        let last = SIZES.len() - 1;
        let (least, most) = (self.ns(ENGINE, 0), self.ns(ENGINE, last));
        let floors = most / self.ns(FLOOR, last);
        // Where the few lines of a small skin fit the first-level cache, only instructions are left.
        let memory_share = (1.0 - least / most).max(0.0);
        let horner = self.ns(HORNER, last) / most;
        let walk = self.fastest_other(|row| row.ns[last].median);
        let touch = self.fastest_other(|row| row.other_ns[1].median);
        vec![
            format!(
                "The engine evaluates and sums {} taxels in {:.2} us with one taxel in twenty touched and in {:.2} us \
                 when all are; the aim is {AIM_US} us: {} and {}. The latter is {floors:.1} times the floor of loading, \
                 converting and storing the counts ({:.2} us); the aim is {AIM_FLOORS}: {}.",
                SIZES[last],
                self.touched_us(),
                self.scan_us(ENGINE),
                verdict(self.touched_us() <= AIM_US),
                verdict(self.scan_us(ENGINE) <= AIM_US),
                self.scan_us(FLOOR),
                verdict(floors <= AIM_FLOORS),
            ),
            format!(
                "The distance, measured: with {} taxels, whose entries fit any first-level cache, the same call takes \
                 {least:.2} ns a taxel, {:.1} times the floor. That much is instructions: a table is looked up taxel by \
                 taxel, while the floor handles many counts in one. The other {:.0} % of the {most:.2} ns with {} taxels \
                 are waiting for memory: {} entries in a cache line each are {:.0} KB a scan.",
                SIZES[0],
                least / self.ns(FLOOR, 0),
                100.0 * memory_share,
                SIZES[last],
                SIZES[last],
                SIZES[last] as f64 * 64.0 / 1024.0,
            ),
            format!(
                "Horner's rule in scaled f32 with range, threshold and area takes {horner:.2} times as long as the engine \
                 at order 5, and would take longer at a higher order; the engine's tables do not depend on it. Of all \
                 other safe ways tried, the fastest with counts that walk is `{}` at {:.2} times the engine's time, and \
                 with one taxel in twenty touched `{}` at {:.2} times.",
                walk.0, walk.1, touch.0, touch.1
            ),
        ]
    }

    /// Verdicts and figures.
    pub fn tables(&self) -> Vec<Table> {
        let last = SIZES.len() - 1;
        let floors = self.ns(ENGINE, last) / self.ns(FLOOR, last);
        let aim = |what: &str, value: f64, limit: f64| {
            vec![Cell::Text(what.to_owned()), Cell::Number(limit), Cell::Number(value), Cell::Verdict(value <= limit)]
        };
        let aims = Table {
            id: "c-live-aims".to_owned(),
            caption: "Evaluation and sum of the engine against its aims, counts that walk.".to_owned(),
            columns: ["aim", "at most", "measured", "verdict"].map(str::to_owned).into(),
            rows: vec![
                aim("5,000 taxels evaluated and summed, all touched, us", self.scan_us(ENGINE), AIM_US),
                aim("the same with one taxel in twenty touched, us", self.touched_us(), AIM_US),
                aim("all touched, over the floor measured beside it", floors, AIM_FLOORS),
            ],
        };
        let sizes = SIZES.iter().map(|size| format!("ns/taxel, {size}"));
        let columns = ["way".to_owned(), "largest error of the sum, N".to_owned()].into_iter().chain(sizes);
        let row = |row: &Row| {
            let error = row.error_n.map_or_else(|| Cell::Text("none computed".to_owned()), Cell::Number);
            let times = row.ns.iter().chain(&row.other_ns).map(|ns| Cell::Number(ns.median));
            [Cell::Text(row.name.to_owned()), error].into_iter().chain(times).collect()
        };
        let figures = Table {
            id: "c-live-sums".to_owned(),
            caption: format!(
                "Counts to one force at order 5: medians of {} runs taken in turns, counts that walk, and in the last \
                 columns independent ones and those of one contact. The error is that of the sum of all 5,000 taxels.",
                self.repetitions
            ),
            columns: columns.chain(["5000, independent", "5000, 5 % touched"].map(str::to_owned)).collect(),
            rows: self.rows.iter().map(row).collect(),
        };
        vec![aims, figures]
    }
}

const fn verdict(met: bool) -> &'static str {
    if met { "met" } else { "not met" }
}
