//! The speeds and precisions that were promised for a whole skin: 230 taxels, 6,000 scans of 8 bit.

use std::hint::black_box;

use anyhow::Context as _;
use taxel_model::{Accumulator, FitOptions};

use super::contenders::{Contender, DEFAULT, contenders};
use super::panel::{Judge, MAX_ORDER};
use super::taxels::{Bits, Recording};
use crate::document::Aim;
use crate::numbers::{median, timed_us};
use crate::options::Options;
use crate::peers::{POLYFIT, Peers, RAW_SVD, Samples};

const TAXELS: usize = 230;
const SCANS: usize = 6000;

/// How many times faster than a loop of numpy.polyfit at least.
const WANTED_SPEED: f64 = 20.0;

/// How many times smaller an error than nalgebra's SVD on raw powers at order 9 at least.
const WANTED_PRECISION: f64 = 1e6;

/// Measures the aims and says whether they are met.
pub(super) fn aims(options: &Options, peers: &mut Peers) -> anyhow::Result<Vec<Aim>> {
    let recording = Recording::simulate(Bits::Eight, SCANS, TAXELS, options.seed);
    let [sums_ms, fit_ms] = ours(options, &recording);
    let both_ms = sums_ms + fit_ms;
    let mut aims = vec![
        Aim::beside("ours: sums of all samples, ms", sums_ms),
        Aim::beside("ours: fit of all taxels, order 5, defaults, ms", fit_ms),
        Aim::beside("ours: sums and fit, ms", both_ms),
    ];
    let faster = "fit of 230 taxels, 6,000 scans each: times faster than a loop of numpy.polyfit";
    if peers.names().contains(&POLYFIT) {
        let loop_ms = peer_ms(&recording, peers)?;
        aims.push(Aim::beside("loop of numpy.polyfit, order 5, ms", loop_ms));
        aims.push(Aim::at_least(faster, loop_ms / both_ms, WANTED_SPEED));
    } else {
        aims.push(Aim { what: faster.to_owned(), aim: format!("at least {WANTED_SPEED}"), ..Aim::default() });
    }
    let [mut our_pa, mut svd_pa] = [0.0_f64; 2];
    let (ours, svd) = (contender(DEFAULT, peers)?, contender(RAW_SVD, peers)?);
    for taxel in 0..TAXELS {
        let judge = Judge::new(&recording, taxel);
        for (contender, worst) in [(&ours, &mut our_pa), (&svd, &mut svd_pa)] {
            let fitted = contender.fit(&recording, taxel, MAX_ORDER, peers)?;
            *worst = worst.max(judge.error_pa(&fitted, contender.estimator, MAX_ORDER).unwrap_or(f64::INFINITY));
        }
    }
    aims.push(Aim::beside("ours: max |dP| at order 9, Pa", our_pa));
    aims.push(Aim::beside("nalgebra SVD on raw powers: max |dP| at order 9, Pa", svd_pa));
    let what = "fit at order 9: times nearer to the exact solution than an SVD on powers of the raw count";
    aims.push(Aim::at_least(what, svd_pa / our_pa.max(f64::MIN_POSITIVE), WANTED_PRECISION));
    Ok(aims)
}

fn contender(name: &str, peers: &Peers) -> anyhow::Result<Contender> {
    contenders(peers).into_iter().find(|contender| contender.name == name).with_context(|| format!("no {name}"))
}

/// Medians of the times of sums and fit, ms. Ours judges, repairs and tells uncertainties.
fn ours(options: &Options, recording: &Recording) -> [f64; 2] {
    let defaults = FitOptions::default();
    let mut times = [Vec::new(), Vec::new()];
    for round in 0..=if options.quick { 15 } else { 30 } {
        let (sums_us, gathered) =
            timed_us(|| (0..TAXELS).map(|taxel| recording.sums(taxel)).collect::<Vec<Accumulator>>());
        let (fit_us, ()) = timed_us(|| gathered.iter().for_each(|sums| drop(black_box(sums.fit(&defaults)))));
        // The first round warms up.
        if round > 0 {
            times[0].push(sums_us);
            times[1].push(fit_us);
        }
    }
    times.map(|us| 1e-3 * median(&us))
}

/// What numpy.polyfit takes for one taxel after the other, ms; it only solves.
fn peer_ms(recording: &Recording, peers: &mut Peers) -> anyhow::Result<f64> {
    let mut us = 0.0;
    for taxel in &recording.taxels {
        us += peers.fit(POLYFIT, &Samples { x: &taxel.counts, y: &recording.kpa, w: None }, 5)?.us;
    }
    Ok(us / 1e3)
}
