//! A forearm's calibration: 230 taxels, 6,000 scans of a simulated ramp, one thread.
//!
//! `cargo bench -p taxel-report --bench fit`
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use taxel_model::{Estimator, FitOptions, Order};
use taxel_report::held_out::fits::Calibration;
use taxel_report::held_out::forearm::{Forearm, Scan};

const SCANS: usize = 6_000;

fn fit(c: &mut Criterion) {
    let mut forearm = Forearm::new(1).unwrap();
    let rest = forearm.rest();
    let scans = forearm.ramp(70.0, 70.0 * 20.0 / SCANS as f64);
    let scans: Vec<&Scan> = scans.iter().take(SCANS).collect();
    let taxels = forearm.taxels() as u64;
    let mut group = c.benchmark_group(format!("fit {taxels} x {}", scans.len()));
    group.sample_size(20).throughput(Throughput::Elements(taxels));
    group.bench_function("sums", |b| b.iter(|| Calibration::new(&forearm, rest.clone(), black_box(&scans))));
    let calibration = Calibration::new(&forearm, rest, &scans);
    for (name, estimator, order) in [
        ("binned, order 5", Estimator::PressureBinned, Order::Fixed(5)),
        ("binned, auto", Estimator::PressureBinned, Order::Auto),
        ("per sample, order 5", Estimator::PerSample, Order::Fixed(5)),
    ] {
        let options = FitOptions { estimator, order, ..FitOptions::default() };
        group.bench_function(name, |b| b.iter(|| calibration.fit(black_box(&options))));
    }
    let models = calibration.fit(&FitOptions::default());
    group.bench_function("tables", |b| {
        b.iter(|| {
            for model in &models {
                black_box(model.tabulate(black_box(0.1)));
            }
        });
    });
    group.finish();
}

criterion_group!(benches, fit);
criterion_main!(benches);
