//! What an operator can look up later: each thing once, in the order in which it happened, with its time.

use taxel_engine::events::EventKind;

use crate::prelude::*;

fn kinds(bench: &Bench) -> Vec<EventKind> {
    bench.host.events.iter().map(|event| event.kind).collect()
}

fn texts(bench: &Bench, kind: EventKind) -> Vec<&str> {
    bench.host.events.iter().filter(|event| event.kind == kind).map(|event| event.text.as_str()).collect()
}

#[test]
fn a_calibration_is_told_from_its_zero_to_its_activation() {
    let (mut bench, _) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    bench.activate(&set).unwrap();
    let sessions = texts(&bench, EventKind::Session);
    let states = ["TARING", "RAMPING", "FITTING", "REVIEW", "ACTIVE"].map(|state| format!("session 1 is {state}"));
    assert_eq!(sessions, states);
    assert_eq!(texts(&bench, EventKind::Activated), [format!("{set} is in use")]);
    let activated = bench.host.events.iter().find(|event| event.kind == EventKind::Activated).unwrap();
    assert_eq!((activated.patch.as_str(), activated.model_set.as_deref()), ("small", Some(&*set)));
    assert!(kinds(&bench).contains(&EventKind::Tared) && kinds(&bench)[0] == EventKind::BusUp, "{:?}", kinds(&bench));
    let times: Vec<i64> = bench.host.events.iter().map(|event| event.wall_ns).collect();
    assert!(times.is_sorted() && times[0] >= EPOCH_NS, "{times:?}");
    let last = bench.host.events.iter().rfind(|event| event.kind == EventKind::Session).unwrap();
    assert_eq!((last.session, last.model_set.as_deref()), (Some(1), Some(&*set)));
    assert_eq!(bench.host.session().state, SessionState::Active);
}

#[test]
fn a_zero_that_is_lost_and_taken_again_and_a_bus_that_goes_and_comes_are_told_with_the_reason() {
    let mut bench = small().in_use();
    bench.host.events.clear();
    bench.host.notice(BusNotice::BusOff);
    bench.seconds(1.0);
    bench.host.notice(BusNotice::Up);
    bench.seconds(1.0);
    bench.tare(None).unwrap();
    bench.until_force(5.0, ForceState::Ok);
    let lost = texts(&bench, EventKind::ZeroLost);
    assert!(lost.len() == 1 && lost[0].contains("bus-off"), "{lost:?}");
    assert_eq!(texts(&bench, EventKind::Tared).len(), 1);
    assert!(bench.host.events.iter().all(|event| event.kind != EventKind::Activated), "it was in use from the start");
}

#[test]
fn faults_that_come_and_go_are_told_with_their_taxels_once_a_second_at_most() {
    let mut bench = small().in_use();
    bench.seconds(2.0);
    bench.host.events.clear();
    let fault = Fault::TaxelStuck { taxel: TaxelIndex(7), value: 255 };
    bench.inject(fault);
    bench.seconds(20.0);
    bench.repair(fault);
    bench.seconds(90.0);
    let of = |kind| bench.host.events.iter().filter(move |event| event.kind == kind);
    let came: Vec<_> = of(EventKind::FaultsCame).filter(|event| event.taxels.contains(&7)).collect();
    assert!(!came.is_empty() && came[0].text.contains("1 taxel ("), "{:?}", bench.host.events);
    assert!(of(EventKind::FaultsWent).any(|event| event.taxels.contains(&7)), "{:?}", bench.host.events);
    let times: Vec<i64> = of(EventKind::FaultsCame).map(|event| event.wall_ns).collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= 1_000_000_000), "{times:?}");
}
