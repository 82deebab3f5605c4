//! What is told of a gauge from what it read.

use super::*;

fn ms(ms: i64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

const TIMEOUT: Duration = Duration::from_millis(500);

/// A gauge that is read every 10 ms for so many seconds.
fn read(seconds: f64, kpa: impl Fn(f64) -> f64) -> GaugeHistory {
    let mut gauge = GaugeHistory::default();
    (0..(100.0 * seconds) as i64).for_each(|n| gauge.push(ms(10 * n), Kilopascal(kpa(0.01 * n as f64))));
    gauge
}

/// What a ramp allows, kPa/s.
const STEEPEST: f64 = 5.0;

#[test]
fn a_step_that_no_pressure_makes_is_a_jump_until_the_gauge_is_back() {
    let off = |t: f64| if (1.0..2.5).contains(&t) { 3.0 } else { 0.0 };
    let gauge = read(4.0, |t| 4.0 * t + off(t));
    assert!((gauge.jumped(ms(0), ms(1500), STEEPEST) - 3.0).abs() < 0.1, "{:?}", gauge.jumps);
    assert!(gauge.jumped(ms(0), ms(4000), STEEPEST).abs() < 0.1 && gauge.jumped(ms(1500), ms(2400), STEEPEST) == 0.0);
    assert!((gauge.jumped(ms(1500), ms(4000), STEEPEST) + 3.0).abs() < 0.1, "it may have been wrong before");
    let hidden = read(2.0, |t| if (1.0..1.02).contains(&t) { f64::NAN } else { 4.0 * t + off(t) });
    assert!((hidden.jumped(ms(0), ms(1500), STEEPEST) - 3.0).abs() < 0.2, "{:?}", hidden.jumps);
}

#[test]
fn what_a_pressure_does_is_no_jump() {
    let vented = |t: f64| if t < 1.0 { 70.0 } else { 70.0 * (-(t - 1.0) / 0.3).exp() };
    let stuck = |t: f64| if (1.0..3.0).contains(&t) { 5.0 } else { 5.0 * t };
    let coarse = |t: f64| (0.4 * t).floor();
    let spikes = |t: f64| t + if ((100.0 * t).round() as i64) % 37 == 0 { 9.0 } else { 0.0 };
    for (what, gauge) in [
        ("a vented bag", read(4.0, vented)),
        ("a gauge that stood still and caught up", read(4.0, stuck)),
        ("a gauge of coarse steps", read(20.0, coarse)),
        ("spikes of one reading", read(4.0, spikes)),
        ("noise", read(4.0, |t| 4.0 * t + 0.3 * (1e4 * t).sin())),
    ] {
        assert_eq!(gauge.jumped(ms(0), ms(20_000), STEEPEST), 0.0, "{what}: {:?}", gauge.jumps);
    }
}

#[test]
fn pressure_is_linear_between_readings_and_nowhere_else() {
    let mut gauge = GaugeHistory::default();
    gauge.push(ms(0), Kilopascal(10.0));
    gauge.push(ms(100), Kilopascal(20.0));
    assert_eq!(gauge.at(ms(25), TIMEOUT), PressureAt::Known(Kilopascal(12.5)));
    assert_eq!(gauge.at(ms(100), TIMEOUT), PressureAt::Known(Kilopascal(20.0)));
    assert_eq!(gauge.at(ms(101), TIMEOUT), PressureAt::NotYet);
    assert_eq!(gauge.at(ms(-1), TIMEOUT), PressureAt::Unknown);
    gauge.push(ms(700), Kilopascal(30.0));
    assert_eq!(gauge.at(ms(300), TIMEOUT), PressureAt::Unknown, "the gauge was silent for longer than the limit");
}

#[test]
fn trend_is_that_of_the_last_second() {
    let gauge = read(3.0, |t| 5.0 + 2.0 * (t - 1.0).max(0.0));
    let trend = gauge.trend(ms(2_990)).unwrap();
    assert!((trend.rate_kpa_per_s - 2.0).abs() < 1e-9 && (trend.level_kpa - 8.98).abs() < 0.02, "{trend:?}");
    assert_eq!(gauge.trend(ms(10_000)), None);
}

#[test]
fn a_pressure_that_has_begun_to_fall_or_is_not_heard_does_not_hold() {
    let mut gauge = read(2.0, |t| 50.0 * t);
    assert!(gauge.is_holding(ms(1_995)));
    assert!(!gauge.is_holding(ms(2_200)), "what it did in the last 0.2 s nobody knows");
    for i in 200..210 {
        gauge.push(ms(i * 10), Kilopascal(100.0 - 3.0 * (i - 199) as f64));
    }
    assert!(gauge.trend(ms(2_095)).unwrap().rate_kpa_per_s > 0.0, "the trend still rises");
    assert!(!gauge.is_holding(ms(2_095)));
}

#[test]
fn a_gauge_is_at_rest_where_it_stands_still_but_for_single_spikes() {
    let limits = RestLimits { drift_kpa: 0.3, spike_kpa: 1.2, timeout: TIMEOUT };
    let at = |kpa: &dyn Fn(f64) -> f64| read(3.0, kpa).at_rest(ms(2_990), limits);
    let still = GaugeAtRest::Still { kpa: Kilopascal(5.8), newest: ms(2_990) };
    assert_eq!(at(&|t| if t < 1.9 { 60.0 } else { 5.8 }), still, "what was before does not count");
    assert_eq!(at(&|t| if (2.40..2.45).contains(&t) { 40.0 } else { 5.8 }), still);
    let between = |from: f64, until: f64| move |t: f64| if (from..until).contains(&t) { 0.8 } else { 5.8 };
    for (what, moves) in [
        ("away for a tenth of it and more", at(&between(2.3, 2.45))),
        ("jumped just before its end", at(&between(2.975, 9.0))),
        ("jumps soon after its beginning", at(&between(2.15, 9.0))),
    ] {
        assert_eq!(moves, GaugeAtRest::Moves(0.8, 5.8), "{what}");
    }
    assert!(matches!(at(&|t| 0.7 * t), GaugeAtRest::Moves(..)), "it rises");
    assert!(matches!(at(&|t| 0.5 * t), GaugeAtRest::Still { .. }), "by less than it may drift");
    assert_eq!(at(&between(2.985, 9.0)), GaugeAtRest::Moves(0.8, 5.8), "it may be the first of a jump");
    assert!(matches!(at(&|t| if t > 2.8 { f64::NAN } else { 5.8 }), GaugeAtRest::Moves(..)), "no number is no rest");
    let silent = read(2.0, |_| 5.8);
    assert_eq!(silent.at_rest(ms(2_500), limits), GaugeAtRest::NotHeard);
    assert_eq!(GaugeHistory::default().at_rest(ms(2_500), limits), GaugeAtRest::NotHeard);
}

#[test]
fn a_spike_moves_neither_rate_nor_level() {
    let trend = read(2.0, |t| if (1.935..1.945).contains(&t) { 60.0 } else { t }).trend(ms(1_990)).unwrap();
    assert!((trend.rate_kpa_per_s - 1.0).abs() < 0.05 && (trend.level_kpa - 1.99).abs() < 0.05, "{trend:?}");
}

#[test]
fn a_gauge_that_stands_still_is_told_from_one_that_makes_coarse_steps() {
    let stands_from_1_to_2_s = |t: f64| if (1.0..2.0).contains(&t) { 4.0 } else { 4.0 * t };
    let over = read(3.0, stands_from_1_to_2_s);
    assert_eq!((over.stuck_by(ms(900)), over.stuck_by(ms(2_100))), (0.0, 0.0));
    for at in [1_000, 1_500, 1_990] {
        assert_eq!(over.stuck_by(ms(at)), 4.0, "at {at} ms");
    }
    let still = read(1.915, stands_from_1_to_2_s);
    assert!((still.stuck_by(ms(1_100)) - 3.6).abs() < 0.01, "{}", still.stuck_by(ms(1_100)));
    let coarse = read(3.0, |t| (4.0 * t).floor() * 0.1);
    assert!((coarse.stuck_by(ms(1_100)) - 0.1).abs() < 1e-9 || coarse.stuck_by(ms(1_100)) == 0.0);
}

#[test]
fn readings_out_of_order_are_left_out() {
    let mut gauge = GaugeHistory::default();
    for (time, kpa) in [(10, 1.0), (10, 9.0), (5, 9.0)] {
        gauge.push(ms(time), Kilopascal(kpa));
        assert_eq!(gauge.newest(), Some((ms(10), Kilopascal(1.0))));
    }
}

#[test]
fn memory_is_bounded() {
    let mut gauge = GaugeHistory::default();
    for i in 0..100_000 {
        gauge.push(Time::from_nanos(i), Kilopascal(0.0));
    }
    assert_eq!(gauge.readings.len(), READINGS_MAX);
}

#[test]
fn a_gauge_that_repeated_itself_and_then_jumps_has_stepped() {
    let coarse = |jump: f64| read(4.0, move |t| if t < 3.0 { 0.0 } else { jump });
    let gauge = coarse(5.0);
    assert_eq!(gauge.jumped(ms(0), ms(4_000), STEEPEST), 0.0, "a gauge that stood still may have caught up");
    let stepped =
        [(2_000, 3_500), (0, 2_980), (3_000, 3_990)].map(|(from, until)| gauge.stepped(ms(from), ms(until), STEEPEST));
    assert_eq!(stepped, [5.0, 0.0, 0.0]);
    let spike = |t: f64| if (1.0..1.01).contains(&t) { 10.0 } else { 0.0 };
    let (coarse, pump) = (coarse(1.0), read(4.0, |t| 20.0 * t));
    for (what, gauge) in [("a coarse gauge", coarse), ("a pump", pump), ("a spike", read(4.0, spike))] {
        assert_eq!(gauge.stepped(ms(0), ms(4_000), STEEPEST), 0.0, "{what}");
    }
}

#[test]
fn what_a_gauge_is_counted_from_changes_no_step_of_it() {
    let mut gauge = read(2.0, |_| 4.0);
    gauge.count_from(4.0);
    (200..400).for_each(|n| gauge.push(ms(10 * n), Kilopascal(4.5)));
    assert_eq!(gauge.at(ms(1_000), TIMEOUT), PressureAt::Known(Kilopascal(0.0)));
    assert_eq!(gauge.newest().unwrap().1, Kilopascal(0.5));
    assert_eq!(gauge.jumped(ms(0), ms(4_000), STEEPEST), 0.0, "{:?}", gauge.jumps);
}
