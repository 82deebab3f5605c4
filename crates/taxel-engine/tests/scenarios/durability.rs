//! What is acknowledged is on disk, and what the disk refuses has no effect.

use taxel_engine::command::RequestId;
use taxel_engine::loads::{KnownLoad, Weight};

use crate::prelude::*;
use crate::say::{activate, import, other, tare};

/// Everything that a reader or an operator sees, but counters and time.
fn seen(bench: &Bench) -> String {
    let snapshot = bench.host.snapshot();
    format!("{:?} {:?} {:?}", bench.host.catalogue, snapshot.tare, snapshot.force.model_set)
}

/// A disk that takes its time, and then refuses.
fn is_refused_and_has_no_effect(bench: &mut Bench, request: RequestId, before: &str, what: &str) {
    assert!(!bench.host.replied(request), "{what} was answered before it was on disk");
    assert_eq!(seen(bench), before, "{what} took effect before it was on disk");
    bench.host.commit(Err("no space left on device".to_owned()));
    let reply = bench.host.reply(request);
    let Some(Err(Rejection::Unavailable(_, why))) = reply else { panic!("{what}: {reply:?}") };
    assert!(why.contains("no space left on device") && why.contains("nothing has changed"), "{what}: {why}");
    bench.seconds(1.0);
    assert_eq!(seen(bench), before, "{what} took effect although it was refused");
}

#[test]
fn what_the_disk_refuses_has_no_effect() {
    let (weight, note, by) = (Weight::Kilogram(0.5), String::new(), "Ada".to_owned());
    let load = KnownLoad { weight, relative_sigma: 0.005, note, by, replaces: None };
    for (what, command, kilogram) in [
        ("an activation", activate("m-other"), 0.0),
        ("a tare", tare(), 0.0),
        ("a load", Command::RecordLoad { patch: String::new(), load }, 0.5),
    ] {
        let mut bench = small().in_use();
        bench.import(other("m-other"));
        bench.lay(kilogram, 33);
        bench.seconds(1.5);
        bench.host.disk_is_slow = true;
        let before = seen(&bench);
        let request = bench.host.command(command.clone());
        bench.seconds(3.0);
        assert_eq!(bench.host.commits.len(), 1);
        if what == "an activation" {
            let why = bench.refused(activate(&small().set.id));
            assert!(why.contains("is being activated"), "{why}");
        }
        is_refused_and_has_no_effect(&mut bench, request, &before, what);
        bench.host.disk_is_slow = false;
        bench.ask(command).expect("and can be asked for again");
    }
}

/// Before there is any zero one is taken by itself, but none beside one that waits for the disk.
#[test]
fn a_tare_that_the_disk_refuses_does_not_keep_the_first_zero_away() {
    let mut bench = small().started();
    bench.brought_up();
    assert_ne!(bench.host.state(), ForceState::Ok, "no zero yet");
    bench.host.disk_is_slow = true;
    let request = bench.host.command(tare());
    bench.seconds(4.0);
    assert!(!bench.host.replied(request));
    assert_eq!(bench.host.state(), ForceState::TareInvalid, "it waits for the disk, and nothing else is taken");
    bench.host.commit(Err("no space left on device".to_owned()));
    bench.until_force(3.0, ForceState::Ok);
}

#[test]
fn a_second_import_of_a_set_is_not_acknowledged_while_the_first_waits_for_the_disk() {
    for result in [Ok(()), Err("no space left on device".to_owned())] {
        let mut bench = small().in_use();
        bench.host.disk_is_slow = true;
        let first = bench.host.command(import(other("m-other")));
        let second = bench.host.command(import(other("m-other")));
        bench.seconds(0.5);
        assert!(!bench.host.replied(first) && !bench.host.replied(second));
        let known = |bench: &Bench| bench.host.catalogue.model_sets.iter().filter(|set| set.id == "m-other").count();
        assert_eq!(known(&bench), 0, "it is not on disk");
        bench.host.commit(result.clone());
        for request in [first, second] {
            let why = bench.host.reply(request).unwrap().err().map(|refused| refused.to_string());
            assert_eq!(why.is_none(), result.is_ok());
            assert!(why.is_none_or(|why| why.contains("nothing has changed: no space left on device")));
        }
        assert_eq!(known(&bench), usize::from(result.is_ok()));
    }
}
