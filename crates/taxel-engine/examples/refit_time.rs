//! How long it takes to fit the largest session once more, 36,000 scans of 230 taxels, and how much memory that takes.
//!
//! `cargo run --release -p taxel-engine --example refit_time`
#![allow(clippy::print_stdout)]

use std::sync::Arc;
use std::time::Instant;

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{
    RampBaseline, Refit, RefitOptions, Sample, SessionSamples, SessionState, SessionView, StoredSession,
};
use taxel_engine::plan::PatchPlan;
use taxel_model::Order;
use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};

const SCANS: usize = 36_000;
const MODULES: usize = 23;
const TAXELS: usize = 10 * MODULES;
const RAMPS: usize = 4;
const TOP_KPA: f64 = 70.0;

fn main() {
    println!("{SCANS} scans of {TAXELS} taxels, {RAMPS} ramps");
    let both = RefitOptions::default();
    let rising = RefitOptions { branch: Some(Branch::Rising), ..both };
    let order = RefitOptions { order: Some(Order::Auto), ..both };
    for (what, options) in [("rising", rising), ("both branches", both), ("both, order auto", order)] {
        let samples = samples();
        let began = Instant::now();
        match fit(samples, &options) {
            Ok(usable) => println!("{what}: {:.2} s, {usable} usable", began.elapsed().as_secs_f64()),
            Err(why) => println!("{what}: {why}"),
        }
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("VmHWM: not known here");
    println!("{peak}, with the samples");
}

fn fit(samples: SessionSamples, options: &RefitOptions) -> Result<usize, String> {
    let plan = plan().ok_or("no such patch")?;
    let (number, branches, accepted) = (1, Branch::Both, SCANS as u64);
    let patch = plan.patch.name().to_owned();
    let state = SessionState::Review;
    let view = Arc::new(SessionView { number, patch, state, branches, accepted, ..SessionView::default() });
    let sessions = vec![StoredSession { view, board_settings: None }];
    let refit = Refit::plan(plan.calibration(), plan.patch.counts(), sessions, options);
    let job = refit.and_then(|refit| refit.job(vec![samples], 0)).map_err(|why| why.to_string())?;
    let set = job.run(|_| String::new()).result?;
    Ok(set.taxels.iter().filter(|model| model.is_usable()).count())
}

fn plan() -> Option<PatchPlan> {
    let board = |(address, modules): (u8, u8)| {
        let modules = (0..modules).filter_map(|m| Some((Module::new(m).ok()?, ModuleKind::Triangle))).collect();
        Some(Board { bus: BusIndex(0), address: BoardAddress::new(address).ok()?, modules })
    };
    let boards = [(13, 16), (12, MODULES as u8 - 16)].into_iter().filter_map(board).collect();
    Patch::new("forearm", boards).ok().map(PatchPlan::new)
}

/// Ramps up and down, with a loop of hysteresis and a converter's noise, the same at each run.
fn samples() -> SessionSamples {
    let rest = |taxel: usize| 200.0 + (taxel * 7 % 40) as f64;
    let baseline = |ramp| RampBaseline {
        ramp,
        taxels: (0..TAXELS).map(|taxel| TaxelBaseline { mean: rest(taxel), noise: 0.6 }).collect(),
        gauge_kpa: Some(0.0),
    };
    let half = SCANS / RAMPS / 2;
    let mut noise = 1_u32;
    let mut sample = |k: usize| {
        let (ramp, step) = (k / (2 * half), k % (2 * half));
        let falls = step >= half;
        let share = if falls { (2 * half - step) as f64 } else { step as f64 } / half as f64;
        let kpa = TOP_KPA * share;
        // As if less had been let go than was: 4 kPa of hysteresis in the middle.
        let felt = if falls { kpa + 4.0 * 4.0 * share * (1.0 - share) } else { kpa };
        let counts: Vec<u8> = (0..TAXELS)
            .map(|taxel| {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let jitter = f64::from(noise >> 16) / 65_536.0 - 0.5;
                (rest(taxel) - 120.0 * felt / (felt + 40.0 + (taxel % 13) as f64) + 1.5 * jitter).round() as u8
            })
            .collect();
        Sample {
            ramp: ramp as u16,
            time_ns: 50_000_000 * k as i64,
            pressure_kpa: kpa,
            counts: counts.as_slice().into(),
        }
    };
    SessionSamples { ramps: (0..RAMPS as u16).map(baseline).collect(), samples: (0..SCANS).map(&mut sample).collect() }
}
