//! Time of the live path: evaluation and sum of 5,000 taxels, one thread.
//!
//! `cargo run --release -p taxel-engine --example evaluate_time`
//!
//! Every taxel has a model of its own. A share of the taxels is touched, in one piece as a contact is, and their counts
//! go on a random walk, so that no scan is like the one before; the others rest. The time is that of
//! `Evaluator::find_active` and of the sum.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::counts::Counts;
use taxel_engine::force::{Activation, Evaluator};
use taxel_engine::model_set::ModelSet;
use taxel_model::{FitOptions, Samples, TaxelModel, fit};
use taxel_skin::SquareMillimetre;

const TAXELS: usize = 5_000;
const SCANS: usize = 2_000;
const REST: f64 = 240.0;

/// A small generator of random bits (xorshift): enough to walk with, and no further dependency.
struct Bits(u64);

impl Bits {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}

/// A model of a skin that gives `gain` counts at most and half of them at 40 kPa.
fn model(gain: f64) -> TaxelModel {
    let kpa: Vec<f64> = (0..700).map(|step| f64::from(step) / 10.0).collect();
    let counts: Vec<f64> = kpa.iter().map(|kpa| (REST - gain * kpa / (kpa + 40.0)).round()).collect();
    fit(&Samples::new(&counts, &kpa), &FitOptions::default())
}

fn model_set() -> ModelSet {
    // Fifty shapes among five thousand tables: no two neighbours share one.
    let shapes: Vec<TaxelModel> = (0..50).map(|k| model(80.0 + 2.0 * f64::from(k))).collect();
    ModelSet {
        id: "m-synthetic".to_owned(),
        patch: "synthetic".to_owned(),
        baseline: vec![TaxelBaseline { mean: REST, noise: 0.7 }; TAXELS],
        pressure_max_kpa: 70.0,
        taxels: (0..TAXELS).map(|taxel| shapes[taxel % shapes.len()].clone()).collect(),
        ..ModelSet::default()
    }
}

/// Every touched count moves by -1, 0 or +1 and stays where the models are.
fn walk(counts: &mut [u16], bits: &mut Bits) {
    for count in counts {
        *count = (*count + (bits.next() % 3) as u16 - 1).clamp(190, 240);
    }
}

fn main() {
    let set = Arc::new(model_set());
    let usable = set.taxels.iter().filter(|model| model.is_usable()).count();
    let areas = vec![SquareMillimetre(32.4); TAXELS];
    let activation = Activation::OF_SKIN;
    let evaluator = Evaluator::new(Arc::clone(&set), &set.baseline, &areas, activation);
    println!("{TAXELS} taxels, {usable} usable; medians of {SCANS} scans");
    for touched in [0, TAXELS / 20, TAXELS / 4, TAXELS] {
        measure(&evaluator, touched);
    }
}

fn measure(evaluator: &Evaluator, touched: usize) {
    let mut bits = Bits(0x9E37_79B9_7F4A_7C15);
    let mut counts = vec![REST as u16; TAXELS];
    counts[..touched].iter_mut().for_each(|count| *count = 190 + (bits.next() % 51) as u16);
    let mut times_us = Vec::with_capacity(SCANS);
    let (mut sum, mut active) = (0.0, Vec::with_capacity(TAXELS));
    for _ in 0..SCANS {
        walk(&mut counts[..touched], &mut bits);
        let begun = Instant::now();
        active.clear();
        evaluator.find_active(Counts::from(black_box(counts.as_slice())), &mut active);
        let total = black_box(active.iter().map(|(_, newton)| newton).sum::<f64>());
        times_us.push(begun.elapsed().as_secs_f64() * 1e6);
        sum += total;
    }
    times_us.sort_by(f64::total_cmp);
    println!(
        "{touched:5} touched, {:5} active in the last scan: {:.2} us (99 % within {:.2} us), mean total {:.1} N",
        active.len(),
        times_us[SCANS / 2],
        times_us[SCANS * 99 / 100],
        sum / SCANS as f64
    );
}
