//! More scans than a board can send, and boards with a period of their own.

use crate::prelude::*;

/// Whether a frame is one of a module of these boards.
fn is_skin(frame: &TimedFrame, boards: &[u16]) -> bool {
    matches!(frame.frame.id, CanId::Standard(id) if id >> 8 == 4 && boards.contains(&(id >> 4 & 0xF)))
}

/// What the boards send while the scene goes on for so long.
fn recorded(bench: &mut Bench, seconds: f64, boards: &[u16]) -> Vec<TimedFrame> {
    bench.log = Some(Vec::new());
    bench.seconds(seconds);
    let mut log = bench.log.take().unwrap();
    log.retain(|frame| is_skin(frame, boards));
    log
}

/// The same frames, their times squeezed by a factor and moved to begin at `begin`.
fn replayed(log: &[TimedFrame], begin: Time, factor: f64) -> Vec<TimedFrame> {
    let first = log[0].time;
    let at = |frame: &TimedFrame| begin + Duration::from_secs_f64(factor * frame.time.since(first).as_secs_f64());
    log.iter().map(|frame| TimedFrame { time: at(frame), ..*frame }).collect()
}

/// Scans of a second node with the identifiers of board 13, which sends what the skin read at rest.
fn second_node(skin: &Calibrated, phase_ms: u64) {
    let mut bench = skin.in_use();
    bench.seconds(1.0);
    let log = recorded(&mut bench, 1.0, &[13]);
    bench.lay(1.0, 33);
    bench.seconds(3.0);
    // Its scans come at the boards' own times, moved by the phase.
    let periods = (bench.now().since(log[0].time).as_secs_f64() / 0.05).ceil();
    let begin = log[0].time + Duration::from_secs_f64(0.05 * periods) + Duration::from_millis(phase_ms);
    let mark = bench.mark();
    bench.foreign = replayed(&log, begin, 1.0).into();
    bench.seconds(4.0);
    bench.is_truthful_since(mark, &format!("a second node {phase_ms} ms after the board"));
    let warnings = bench.host.health().boards[0].warnings.join("; ");
    assert!(warnings.contains("Does another node use its CAN ids"), "{phase_ms} ms: {warnings}");
}

#[test]
fn a_second_node_with_a_boards_identifiers_does_not_hide_a_load() {
    for phase_ms in 1..=49 {
        second_node(small(), phase_ms);
    }
}

/// A board that sends every `ms`, on a bus that is not simulated otherwise: its frames are those of the simulated one.
fn at_a_period_of(ms: u64) -> Bench {
    let mut bench = small().in_use();
    let log = recorded(&mut bench, 25.0, &[12, 13]);
    bench.passes = Box::new(|frame| !is_skin(frame, &[12, 13]));
    let begin = bench.now() + Duration::from_millis(20);
    bench.foreign = replayed(&log, begin, ms as f64 / 50.0).into();
    bench
}

#[test]
fn a_board_that_sends_at_another_period_gets_a_warning() {
    for ms in [10, 100] {
        let mut bench = at_a_period_of(ms);
        let expected = format!("sends every {ms} ms, the configuration says 50 ms");
        bench.until(4.5, &expected, |host| host.health().boards.iter().all(|board| board.warnings.contains(&expected)));
    }
    let mut bench = small().in_use();
    bench.seconds(10.0);
    assert!(bench.host.health().boards.iter().all(|board| board.warnings.is_empty()), "{:?}", bench.host.health());
}
