//! Group 6: a ramp that dips, jumps or repeats itself, through the gates of a calibration session.

use crate::Now;
use crate::baseline::TaxelBaseline;
use crate::calibration::fit::{Branch, FitRecipe};
use crate::calibration::samples::Pending;
use crate::calibration::session::SessionRun;
use crate::calibration::{FitJob, SampleRefusal, SessionState, SessionView};
use crate::intake::gauge::GaugeHistory;
use crate::plan::{PatchPlan, SessionLimits};
use std::sync::Arc;
use taxel_model::TaxelModel;
use taxel_model::stability::case::{Case, Contest, Outcome, greatest};
use taxel_model::stability::taxels::{NOMINAL, Recording, normal, random};
use taxel_model::stability::trial::{evaluate, flag_words};
use taxel_skin::{Board, BoardAddress, BusIndex, Kilopascal, Module, ModuleKind, Patch, Time};

const TO_STEADY: &str = "max |dP| to a steady ramp, kPa";

/// From reading to reading of the gauge, and from scan to scan.
const GAUGE_MS: i64 = 10;
const SCAN_MS: i64 = 50;

/// Half of the skin's hysteresis, kPa: what a falling pressure reads too high and a rising one too low.
const LAG_KPA: f64 = 2.0;

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case {
            figure: TO_STEADY,
            limit: 0.5,
            also: "scans of the falling pressure are refused as not rising",
            ..Case::exact("6.1", "the pressure dips by 4 kPa every 12 s, skin with hysteresis of 4 kPa", dips)
        },
        Case {
            figure: TO_STEADY,
            limit: 0.5,
            also: "the spikes are refused as such",
            ..Case::exact("6.2", "1 % of the gauge's readings are 10 kPa off", spikes)
        },
        Case {
            figure: "max |dP| to each frame once, kPa",
            limit: 1e-9,
            also: "repeated readings of the gauge are counted and left out",
            ..Case::exact("6.3", "duplicated frames: each reading and each scan comes twice", duplicates)
        },
        Case::of("6.4", "the pressure rises by 9 kPa/s, too fast", "samples accepted", 0.0, too_fast),
        Case::of("6.5", "the pressure falls from 60 kPa", "samples accepted", 0.0, falling),
        Case::of("6.6", "a session that is full", "samples beyond the limit", 0.0, full),
        Case::of("6.7", "no gauge at all", "samples accepted", 0.0, no_gauge),
        Case {
            figure: TO_STEADY,
            limit: 0.1,
            flags: &["dropouts"],
            ..Case::exact("6.8", "1 % of the readings drop to 100, which is no rail", dropouts)
        },
    ]
}

/// What happens to a ramp.
#[derive(Clone, Copy)]
struct Scene {
    /// Pressure in kPa at a time in s.
    kpa: fn(f64) -> f64,
    seconds: i64,
    /// How far off every hundredth reading of the gauge is, kPa.
    spike_kpa: f64,
    /// How often each frame comes.
    times: usize,
    scans_max: usize,
    /// What every hundredth scan reads instead of its count.
    dropout: Option<f64>,
}

const STEADY: Scene =
    Scene { kpa: |t| 1.5 * t, seconds: 60, spike_kpa: 0.0, times: 1, scans_max: 36_000, dropout: None };

/// What a session made of a scene.
struct Run {
    session: SessionRun,
    gauge: GaugeHistory,
    /// Every scan with the gauge's pressure, as one would fit who knows no gates.
    all: Recording,
    readings: u64,
    left_out: u64,
}

fn run(scene: &Scene) -> Run {
    let limits = SessionLimits { scans_max: scene.scans_max, ..SessionLimits::default() };
    let view = SessionView { target_kpa: limits.target.0, ..SessionView::default() };
    let plan = Arc::new(PatchPlan { session: limits, ..PatchPlan::new(one_taxel()) });
    let mut session = SessionRun::start(Now::default(), &plan, view);
    let mut rest = GaugeHistory::default();
    (-100..=0).for_each(|n| rest.push(Time::from_nanos(n * GAUGE_MS * 1_000_000), Kilopascal(0.0)));
    let zero = vec![TaxelBaseline { mean: NOMINAL.rest, noise: NOMINAL.noise }];
    session.on_zero_taken(Now::default(), zero, &rest);
    let mut run = Run { session, gauge: GaugeHistory::default(), all: Recording::default(), readings: 0, left_out: 0 };
    let (mut lagging, mut random) = (0.0_f64, random(6));
    for t in (0..scene.seconds * 1000).step_by(GAUGE_MS as usize) {
        let (now, kpa) = (Time::from_nanos(t * 1_000_000), (scene.kpa)(t as f64 / 1000.0));
        let spike = if t / GAUGE_MS % 100 == 55 { scene.spike_kpa } else { 0.0 };
        for _ in 0..scene.times {
            let before = run.gauge.newest();
            run.gauge.push(now, Kilopascal(kpa + spike));
            run.left_out += u64::from(run.gauge.newest() == before);
            run.readings += 1;
        }
        lagging = lagging.max(kpa - LAG_KPA).min(kpa + LAG_KPA).max(0.0);
        if t % SCAN_MS != 0 {
            continue;
        }
        let count = (NOMINAL.rest - NOMINAL.gain * lagging / (lagging + NOMINAL.half)
            + NOMINAL.noise * normal(&mut random))
        .round();
        let count = scene.dropout.filter(|_| t / SCAN_MS % 100 == 55).unwrap_or(count);
        run.all.counts.push(count);
        run.all.kpa.push(kpa + spike);
        for _ in 0..scene.times {
            run.session
                .on_scan(Some(Pending { time: now, counts: [count.clamp(0.0, 255.0) as u16].as_slice().into() }));
        }
        run.session.advance(Now { time: now, wall_ns: 0 }, &run.gauge, String::new);
        if !run.session.is_ramping() {
            break;
        }
    }
    run
}

#[expect(clippy::expect_used, reason = "one module of one board is a patch")]
fn one_taxel() -> Patch {
    let modules = Module::new(0).map(|module| (module, ModuleKind::Cells(1))).into_iter().collect();
    let board = BoardAddress::new(1).map(|address| Board { bus: BusIndex(0), address, modules });
    Patch::new("one", board.into_iter().collect()).expect("a patch")
}

impl Run {
    fn refused(&self, reason: SampleRefusal) -> u64 {
        self.session.view.refused.get(reason)
    }

    /// The model of the one taxel, by the session's own fit.
    fn model(&self) -> Option<TaxelModel> {
        let job = FitJob {
            samples: Arc::clone(&self.session.samples),
            modules: std::iter::once(0..1).collect(),
            recipe: FitRecipe { branch: Branch::Rising, ..FitRecipe::default() },
            ..FitJob::default()
        };
        job.run(|_| String::new()).result.ok()?.taxels.first().cloned()
    }
}

/// The largest difference to the model of another run, over the counts that both are calibrated for. The peers know
/// no gates: theirs is between all scans of the one run and all of the other.
fn compare(run: &Run, other: &Run) -> Outcome {
    let Some((model, wanted)) = run.model().zip(other.model()) else {
        return Outcome { figure: f64::NAN, ..Outcome::default() };
    };
    let mut outcome = Outcome { status: model.status.code(), flags: flag_words(&model), ..Outcome::default() };
    let in_range =
        |model: &TaxelModel, count: f64| model.range.is_some_and(|[low, high]| (low..=high).contains(&count));
    let counts: Vec<f64> = (0..=255).map(f64::from).filter(|c| in_range(&model, *c) && in_range(&wanted, *c)).collect();
    outcome.require(counts.len() > 50, || format!("{} counts are calibrated in both", counts.len()));
    outcome.figure = greatest(counts.iter().map(|count| (evaluate(&model, *count) - evaluate(&wanted, *count)).abs()));
    outcome.contest = Some(Contest::between(&run.all, &other.all, counts));
    outcome
}

fn dips() -> Outcome {
    let run = run(&Scene { kpa: dipping, seconds: 90, ..STEADY });
    let mut outcome = compare(&run, &self::run(&STEADY));
    let refused = run.refused(SampleRefusal::NotRising);
    let state = run.session.view.state;
    outcome.require(state == SessionState::Fitting, || format!("the ramp ended with {state:?}"));
    outcome.require(refused > 300, || format!("{refused} scans were refused as not rising"));
    outcome
}

/// Every 12 s: 8 s up by 12 kPa, 2 s down by 4 kPa, 2 s up again.
fn dipping(t: f64) -> f64 {
    let within = t % 12.0;
    let step = if within < 8.0 {
        1.5 * within
    } else if within < 10.0 {
        12.0 - 2.0 * (within - 8.0)
    } else {
        8.0 + 2.0 * (within - 10.0)
    };
    12.0 * (t / 12.0).floor() + step
}

fn spikes() -> Outcome {
    let run = run(&Scene { spike_kpa: 10.0, ..STEADY });
    let mut outcome = compare(&run, &self::run(&STEADY));
    let refused = run.refused(SampleRefusal::GaugeSpike);
    outcome.require(refused > 40, || format!("{refused} scans were refused for a spike"));
    outcome
}

fn duplicates() -> Outcome {
    // Ends short of the target: a ramp that reaches it takes the last scan once.
    let once = Scene { seconds: 45, ..STEADY };
    let run = run(&Scene { times: 2, ..once });
    let mut outcome = Outcome { contest: None, ..compare(&run, &self::run(&once)) };
    let left_out = run.left_out;
    outcome.require(2 * left_out == run.readings, || format!("{left_out} of {} readings left out", run.readings));
    outcome
}

fn too_fast() -> Outcome {
    let run = run(&Scene { kpa: |t| 9.0 * t, seconds: 7, ..STEADY });
    let mut outcome = Outcome::of_figure(run.session.view.accepted as f64);
    let refused = run.refused(SampleRefusal::TooFast);
    outcome.require(refused > 100, || format!("{refused} scans were refused as too fast"));
    outcome
}

fn falling() -> Outcome {
    let run = run(&Scene { kpa: |t| 60.0 - t, seconds: 50, ..STEADY });
    let mut outcome = Outcome::of_figure(run.session.view.accepted as f64);
    let refused = run.refused(SampleRefusal::NotRising);
    outcome.require(refused > 900, || format!("{refused} scans were refused as not rising"));
    outcome
}

fn full() -> Outcome {
    let run = run(&Scene { scans_max: 500, ..STEADY });
    let mut outcome = Outcome::of_figure(run.session.samples.samples.len().abs_diff(500) as f64);
    let state = run.session.view.state;
    outcome.require(state == SessionState::Fitting, || format!("the ramp ended with {state:?}"));
    outcome.require(run.refused(SampleRefusal::Full) == 1, || "the refusal is not counted".to_owned());
    outcome
}

fn dropouts() -> Outcome {
    compare(&run(&Scene { dropout: Some(100.0), ..STEADY }), &run(&STEADY))
}

fn no_gauge() -> Outcome {
    let run = run(&Scene { times: 0, seconds: 70, ..STEADY });
    Outcome::of_figure(run.session.view.accepted as f64)
}
