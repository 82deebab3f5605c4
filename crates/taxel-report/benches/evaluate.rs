//! Evaluation and sum of 5,000 taxels, one thread: the engine's own call.
//!
//! `cargo bench -p taxel-report --bench evaluate`
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use taxel_report::live::skin::{Course, models, stream, taxels};
use taxel_report::live::total::evaluator;

const TAXELS: usize = 5_000;

fn evaluate(c: &mut Criterion) {
    let models = models(TAXELS, 5, 1);
    let (evaluator, taxels) = (evaluator(&models), taxels(&models));
    let mut group = c.benchmark_group(format!("evaluate {TAXELS}"));
    group.throughput(Throughput::Elements(TAXELS as u64));
    for (name, course) in [("walk", Course::Walk), ("independent", Course::Independent), ("5 % touched", Course::Touch)]
    {
        let scans = stream(&taxels, course, 2);
        let mut next = 0;
        group.bench_function(name, |b| {
            b.iter(|| {
                next = (next + 1) % scans.len();
                evaluator.total_n(black_box(&scans[next]))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, evaluate);
criterion_main!(benches);
