//! Time of a whole skin's fit: 230 taxels, 6,000 scans each, one thread, from raw samples to tables.
//!
//! `cargo run --release -p taxel-model --example fit_time`

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::time::Instant;
use taxel_model::{Accumulator, Estimator, FitOptions, FixedPressure, Order, TaxelModel};

const TAXELS: usize = 230;
const SCANS: usize = 6_000;

fn median_ms(mut run: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..15)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let pressure: Vec<Option<FixedPressure>> =
        (0..SCANS).map(|k| FixedPressure::from_kpa(70.0 * k as f64 / SCANS as f64)).collect();
    let counts: Vec<Vec<u8>> = (0..TAXELS)
        .map(|_| {
            let (gain, half) = (random.random_range(40.0..180.0), random.random_range(15.0..65.0));
            pressure
                .iter()
                .map(|p| {
                    let kpa = p.map_or(0.0, FixedPressure::to_kpa);
                    let noise: f64 = (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0;
                    (240.0 - gain * kpa / (kpa + half) + 0.7 * noise).round().clamp(0.0, 255.0) as u8
                })
                .collect()
        })
        .collect();
    let gather = || -> Vec<Accumulator> {
        counts
            .iter()
            .map(|counts| {
                let mut sums = Accumulator::new();
                sums.extend(counts.iter().copied().zip(pressure.iter().copied()), 0);
                sums
            })
            .collect()
    };
    println!("{TAXELS} taxels x {SCANS} scans, one thread, medians of 15");
    println!("accumulate                          {:7.2} ms", median_ms(|| drop(black_box(gather()))));
    let sums = gather();
    for (name, estimator, order, exact) in [
        ("per-sample, order 5", Estimator::PerSample, Order::Fixed(5), false),
        ("pressure-binned, order 5", Estimator::PressureBinned, Order::Fixed(5), false),
        ("pressure-binned, order 9", Estimator::PressureBinned, Order::Fixed(9), false),
        ("pressure-binned, auto", Estimator::PressureBinned, Order::Auto, false),
        ("pressure-binned, order 5, exact", Estimator::PressureBinned, Order::Fixed(5), true),
    ] {
        let options = FitOptions { estimator, order, exact, ..FitOptions::default() };
        let fit = || -> Vec<TaxelModel> { sums.iter().map(|sums| sums.fit(&options)).collect() };
        let ms = median_ms(|| drop(black_box(fit())));
        println!("fit {name:31} {ms:7.2} ms, {:5.1} us a taxel", 1e3 * ms / TAXELS as f64);
    }
    let models: Vec<TaxelModel> = sums.iter().map(|sums| sums.fit(&FitOptions::default())).collect();
    let repaired = models.iter().filter(|model| model.repaired).count();
    println!(
        "tables                              {:7.2} ms",
        median_ms(|| models.iter().for_each(|m| {
            black_box(m.tabulate(0.0));
        }))
    );
    println!("{repaired} of {TAXELS} repaired, {} usable", models.iter().filter(|m| m.is_usable()).count());
}
