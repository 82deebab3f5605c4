//! The paper's experiment on a simulated forearm: three runs in the bag, then masses on the skin.

use taxel_engine::plan::{Outputs, PatchPlan};

use crate::paper::data::{Data, Weighing, Weighings};
use crate::rig::fits::{Calibration, forces};
use crate::rig::{Forearm, Scan, Weighed};

/// As many runs as the paper shows the repeatability of.
const RUNS: usize = 3;

/// The highest pressure, and how fast it rises and falls.
const TARGET_KPA: f64 = 70.0;
const KPA_PER_S: f64 = 1.0;

/// The skin is seen at rest for so long before each run.
const REST_S: f64 = 2.0;

/// Calibrates the forearm of a seed and weighs masses on it, with models that exclude taxels of less swing than this.
///
/// # Errors
/// A simulation that cannot be set up, which it can.
pub fn simulate(seed: u64, min_swing_counts: f64) -> anyhow::Result<Data> {
    let mut forearm = Forearm::new(seed)?;
    let plan = forearm.plan()?;
    let rest = forearm.rest();
    let (mut scans, mut risen): (Vec<Scan>, Vec<Scan>) = (Vec::new(), Vec::new());
    for run in 0..RUNS {
        if run > 0 {
            forearm.vent();
        }
        let mut rise = forearm.watch(REST_S);
        rise.extend(forearm.ramp(TARGET_KPA, KPA_PER_S));
        risen.extend_from_slice(&rise);
        scans.extend(rise);
        // The pump went a little further while nothing was gathered.
        let fall = forearm.release(TARGET_KPA, KPA_PER_S).into_iter();
        scans.extend(fall.filter(|scan| scan.gauge_kpa.iter().all(|kpa| *kpa <= TARGET_KPA)));
    }
    let data = data(&forearm, &scans, seed);
    forearm.vent();
    let zero = forearm.rest();
    let weighings = forearm.weigh_all(0)?;
    let calibration = Calibration::new(&forearm, rest, risen.iter());
    let paper_plan = PatchPlan { geometry: None, outputs: Outputs::default(), ..plan.clone() };
    let read =
        |by: &str, models, plan: &PatchPlan| {
            let forces = forces(calibration.model_set(models, plan), plan, &zero, &weighings);
            let all = forces.into_iter().zip(&weighings).map(|(measured_n, &Weighed { kilogram, true_n, .. })| {
                Weighing { kilogram: Some(kilogram), true_n, measured_n }
            });
            Weighings { by: by.to_owned(), all: all.collect() }
        };
    let paper = data.models(min_swing_counts);
    let ours = calibration.fit(&plan.fit);
    Ok(data.with_loads(vec![
        read("the paper's recipe: its models, equal areas, active taxels only", paper, &paper_plan),
        read("the shipped default: binned models, excluded taxels filled", ours, &plan),
    ]))
}

fn data(forearm: &Forearm, scans: &[Scan], seed: u64) -> Data {
    let boards = scans.first().map_or(0, |scan| scan.gauge_kpa.len());
    let kpa = (0..boards).map(|board| scans.iter().map(|scan| scan.gauge_kpa[board]).collect()).collect();
    let count = |taxel: usize| scans.iter().map(|scan| f64::from(scan.counts[taxel])).collect();
    let counts = (0..forearm.taxels()).map(count).collect();
    let column_of = (0..forearm.taxels()).map(|taxel| forearm.board_of(taxel)).collect();
    Data::new(format!("simulated forearm, seed {seed}: {RUNS} runs to {TARGET_KPA} kPa"), kpa, column_of, counts)
}
