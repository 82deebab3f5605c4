//! Invariant: time comes in as data, so a replay of one log gives bit-identical results every time, however the frames
//! were read within a slot.

use crate::prelude::*;

/// Everything that a run put out. Debug text tells two floats apart exactly if their bits differ (but for NaN, which
/// is nowhere).
fn history(host: &Host) -> Vec<String> {
    let mut lines: Vec<String> = host.snapshots.iter().map(|s| format!("{s:?}")).collect();
    lines.extend(host.sessions.iter().map(|s| format!("{s:?}")));
    lines.extend(host.records.iter().map(|r| format!("{r:?}")));
    lines.extend(host.healths.iter().map(|h| format!("{h:?}")));
    lines
}

fn same(what: &str, one: &[String], other: &[String]) {
    for (n, (a, b)) in one.iter().zip(other).enumerate() {
        if a != b {
            let at = a.bytes().zip(b.bytes()).position(|(a, b)| a != b).unwrap_or(a.len().min(b.len()));
            let near = |s: &str| s.chars().skip(at.saturating_sub(80)).take(160).collect::<String>();
            panic!("{what}: output {n} of {} differs:\n{}\n{}", one.len(), near(a), near(b));
        }
    }
    assert_eq!(one.len(), other.len(), "{what}: number of outputs");
}

/// Batches of 1 to 7 frames, never the same twice in a row.
fn ragged(seed: u64) -> impl FnMut(usize) -> usize {
    let mut state = seed;
    move |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        1 + (state >> 33) as usize % 7
    }
}

/// `host` is a new engine, and `play` gives it the frames.
fn all_ways(what: &str, host: impl Fn() -> Host, play: impl Fn(&mut Host, &mut dyn FnMut(usize) -> usize)) {
    let run = |cut: &mut dyn FnMut(usize) -> usize| {
        let mut host = host();
        play(&mut host, cut);
        history(&host)
    };
    let whole = run(&mut |n| n);
    same(&format!("{what}, again"), &whole, &run(&mut |n| n));
    same(&format!("{what}, frame by frame"), &whole, &run(&mut |_| 1));
    same(&format!("{what}, in ragged batches"), &whole, &run(&mut ragged(1)));
    same(&format!("{what}, in other ragged batches"), &whole, &run(&mut ragged(2)));
}

fn listening() -> Arc<Plan> {
    plan(PatchPlan { bring_up: Vec::new(), ..patch_plan(&small().skin) })
}

#[test]
fn a_calibration_is_bit_identical_however_its_frames_are_cut() {
    let log: &[TimedFrame] = &small().log;
    let at = Time::from_nanos(small().session.started_wall_ns - EPOCH_NS);
    let start = log.partition_point(|f| f.time < at);
    let host = || Host::new(listening(), Restored::default(), Time::default());
    all_ways("calibration", host, |host, cut| {
        host.play(&log[..start], at, &mut *cut);
        host.command(say::start());
        host.play(&log[start..], log[log.len() - 1].time, &mut *cut);
        assert!(host.session().model_set.is_some(), "{:?}", host.session());
    });
}

#[test]
fn live_force_is_bit_identical_however_its_frames_are_cut() {
    let mut bench = small().in_use();
    let begin = bench.now();
    bench.log = Some(Vec::new());
    bench.seconds(2.0);
    bench.lay(0.8, 33);
    bench.inject(Fault::FramesLost { probability: 0.05 });
    bench.seconds(2.0);
    bench.inject(Fault::ModuleNoAck(board(13), module(0)));
    bench.seconds(1.0);
    bench.inject(Fault::BoardSilent(board(12)));
    bench.world.pump(PumpCommand::Ramp { target: taxel_skin::Kilopascal(10.0), kpa_per_s: 5.0 });
    bench.seconds(2.0);
    let log = bench.log.take().unwrap();
    all_ways(
        "live force",
        || Host::new(listening(), small().restored(), begin),
        |host, cut| {
            host.play(&log, begin + Duration::from_secs(7), cut);
            assert!(host.snapshots.iter().any(|s| s.force.total.is_some_and(|t| t.0 > 1.0)));
        },
    );
}
