//! What following the drift costs: a scan, and new tables, which are made at most every five seconds.
//!
//! `cargo run --release -p taxel-engine --example drift_time`

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use taxel_engine::Now;
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::force::{Activation, Evaluator};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::DriftPlan;
use taxel_engine::zero::drift::{Drift, DriftSite};
use taxel_model::{Accumulator, FitOptions, FixedPressure, TaxelModel};
use taxel_skin::{ModuleKind, SquareMillimetre, Time};

const SCANS: i64 = 20_000;
const TABLES: usize = 10;
const ACTIVATION: Activation = Activation { sigmas: 4.0, floor_counts: 2.0 };
const ZERO: TaxelBaseline = TaxelBaseline { mean: 240.5, noise: 0.9 };

fn scan_us(modules: usize) -> f64 {
    let site = |m: usize| DriftSite {
        taxels: 10 * m..10 * m + 10,
        kind: ModuleKind::Triangle,
        beside: (m.saturating_sub(3)..modules.min(m + 4)).filter(|&other| other != m).collect(),
    };
    let plan = DriftPlan { follow: true, ..DriftPlan::default() };
    let mut drift = Drift::new(plan, ACTIVATION, (0..modules).map(site).collect());
    drift.begin(Now::default(), &vec![ZERO; 10 * modules], &[]);
    let scans = [vec![240; 10 * modules], vec![241; 10 * modules]];
    let begun = Instant::now();
    for scan in 0..SCANS {
        let now = Now { time: Time::from_nanos(scan * 50_000_000), wall_ns: 0 };
        black_box(drift.on_scan(now, &scans[(scan % 2) as usize], |_| Some([230, 230]), |_| true));
    }
    begun.elapsed().as_secs_f64() * 1e6 / SCANS as f64
}

fn model() -> TaxelModel {
    let mut sums = Accumulator::new();
    for step in 0..700_u32 {
        let kpa = f64::from(step) / 10.0;
        sums.add((240.0 - 150.0 * kpa / (kpa + 40.0)).round() as u8, FixedPressure::from_kpa(kpa), 0);
    }
    sums.fit(&FitOptions::default())
}

fn tables_us(taxels: usize) -> f64 {
    let set = Arc::new(ModelSet {
        id: String::new(),
        patch: String::new(),
        created_wall_ns: 0,
        session: None,
        method: String::new(),
        board_settings: Vec::new(),
        baseline: vec![ZERO; taxels],
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.0,
        gauge_offset_kpa: 0.0,
        taxels: vec![model(); taxels],
        recorded: None,
        recalibrated: None,
        maker: taxel_engine::model_set::Maker::default(),
    });
    let (zero, areas) = (vec![ZERO; taxels], vec![SquareMillimetre(32.4); taxels]);
    let begun = Instant::now();
    for _ in 0..TABLES {
        black_box(Evaluator::new(Arc::clone(&set), &zero, &areas, ACTIVATION));
    }
    begun.elapsed().as_secs_f64() * 1e6 / TABLES as f64
}

fn main() {
    for modules in [23, 500] {
        let taxels = 10 * modules;
        println!("{taxels} taxels: {:.1} us a scan, new tables {:.0} us", scan_us(modules), tables_us(taxels));
    }
}
