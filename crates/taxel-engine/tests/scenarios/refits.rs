//! Stored samples fitted once more, alone or together.

use taxel_engine::calibration::{Refit, SessionSamples};

use crate::prelude::*;
use crate::say::start;

/// Two sessions of one skin in review, the first to 30 kPa and the second to 40, and what is on disk of them.
struct Shelf {
    plan: Arc<Plan>,
    sessions: Vec<Arc<SessionView>>,
    samples: Vec<SessionSamples>,
    /// The set that each session's own fit gave.
    own: Vec<Arc<ModelSet>>,
}

fn two_sessions() -> Bench {
    let (mut bench, _) = in_review(30.0);
    session_of(bench.ask(start()));
    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(74.0, 4.0);
    bench.until_pressure(40.0);
    bench.finish(2);
    bench
}

fn shelf() -> &'static Shelf {
    static SHELF: OnceLock<Shelf> = OnceLock::new();
    SHELF.get_or_init(|| {
        let bench = two_sessions();
        Shelf {
            plan: Arc::clone(&bench.host.plan),
            sessions: bench.host.catalogue.sessions.clone(),
            samples: [1, 2].map(|number| bench.host.disk.samples[&number].clone()).into(),
            own: [0, 1].map(|position| bench.host.set(position)).into(),
        }
    })
}

impl Shelf {
    fn plan(&self, sessions: Vec<Arc<SessionView>>) -> Result<Refit, Rejection> {
        Refit::plan(self.plan.patches[0].clone(), sessions)
    }

    /// The sessions of these positions, in this order.
    fn fit(&self, positions: &[usize]) -> ModelSet {
        let refit = self.plan(positions.iter().map(|k| self.sessions[*k].clone()).collect()).unwrap();
        let samples = refit.numbers().into_iter().map(|number| self.samples[number as usize - 1].clone()).collect();
        ModelSet::clone(&refit.job(samples, 1).unwrap().run(|_| String::new()).result.unwrap())
    }

    /// Why the two cannot be fitted together after a change of the second.
    fn refused(&self, change: impl FnOnce(&mut SessionView)) -> String {
        let mut sessions = self.sessions.clone();
        change(Arc::make_mut(&mut sessions[1]));
        self.plan(sessions).unwrap_err().to_string()
    }
}

/// All of a set but its id and when it was made.
fn content(set: &ModelSet) -> String {
    format!("{:?}", ModelSet { id: String::new(), created_wall_ns: 0, ..set.clone() })
}

#[test]
fn a_refit_is_the_sessions_own_fit() {
    for k in [0, 1] {
        let set = shelf().fit(&[k]);
        assert_eq!(content(&set), content(&shelf().own[k]));
    }
}

#[test]
fn two_sessions_together_give_one_set_in_whatever_order_they_are_named() {
    let both = shelf().fit(&[0, 1]);
    assert_eq!(content(&both), content(&shelf().fit(&[1, 0])));
    assert!(both.method.ends_with(", of sessions 1, 2 together") && both.session == Some(2), "{}", both.method);
    assert_eq!(both.pressure_max_kpa.to_bits(), shelf().own[1].pressure_max_kpa.to_bits());
    assert_eq!(both.baseline, shelf().own[1].baseline, "the zero of the last ramp");
    let samples = |set: &ModelSet| set.taxels.iter().map(|model| model.quality.samples).max().unwrap();
    assert!(samples(&both) > samples(&shelf().own[1]), "{} of {}", samples(&both), samples(&shelf().own[1]));
    let usable = both.taxels.iter().filter(|model| model.is_usable()).count();
    assert!(usable >= 70, "{usable} of 80");
    let repeated = both.taxels.iter().filter(|model| model.quality.repeatability_kpa.is_some()).count();
    assert!(repeated >= 70, "two ramps tell how well they repeat: {repeated} of 80");
}

#[test]
fn sessions_that_do_not_go_together_are_refused_and_named() {
    let why = shelf().refused(|view| view.patch = "other".to_owned());
    assert_eq!(why, "session 2 is of patch `other`, the others are of `small`");
    let why = shelf().refused(|view| view.number = 1);
    assert_eq!(why, "sessions: session 1 is named twice");
    let why = shelf().refused(|view| view.state = SessionState::Ramping);
    assert_eq!(why, "session 2 is RAMPING; finish or abort it first");
    let why = shelf().refused(|view| view.accepted = 36_000);
    assert!(why.contains("36000 is the most that are fitted at once"), "{why}");
    let why = shelf().refused(|view| view.left_out = vec![8]);
    assert_eq!(why, "session 2 was without module 9 of patch `small`, which has 8 now");
    let other = ["board 13: shift 3".to_owned(), "board 12: shift 3".to_owned()];
    let why = shelf().refused(|view| view.board_settings = other.into());
    assert!(why.contains("session 1 (board 13: type 0; ") && why.ends_with("session 2 (board 13: shift 3)"), "{why}");
    let why = shelf().plan(Vec::new()).unwrap_err().to_string();
    assert_eq!(why, "sessions: 0 are named, expected 1 to 32");
}

#[test]
fn samples_of_another_layout_are_refused_and_named() {
    let refit = shelf().plan(shelf().sessions.clone()).unwrap();
    let mut samples = shelf().samples.clone();
    samples[1].samples[7].counts = samples[1].samples[7].counts.counts().slice(0..70).into();
    let why = refit.job(samples, 1).unwrap_err().to_string();
    assert_eq!(why, "session 2 is of another layout of patch `small`, or has counts of another width");
}

#[test]
fn a_module_that_one_session_was_without_gets_no_models_of_both() {
    let mut sessions = shelf().sessions.clone();
    Arc::make_mut(&mut sessions[1]).left_out = vec![2];
    let job = shelf().plan(sessions).unwrap().job(shelf().samples.clone(), 1).unwrap();
    let set = job.run(|_| String::new()).result.unwrap();
    assert!(set.taxels[20..30].iter().all(|model| !model.is_usable()));
    assert!(set.taxels[..20].iter().filter(|model| model.is_usable()).count() > 15);
}

/// That nothing is acknowledged before it is on disk holds for every set that is kept: see `durability.rs`.
#[test]
fn a_refit_is_kept_once_and_not_used_by_that_and_not_kept_of_a_session_that_is_gone() {
    let (mut bench, _) = in_review(30.0);
    let own = bench.host.set(0);
    let keep = |id: &str| {
        let model_set = Arc::new(ModelSet { id: id.to_owned(), ..ModelSet::clone(&own) });
        Command::KeepRefit { model_set, sessions: vec![1] }
    };
    for (id, was_known) in [("m-other", false), ("m-other", true), (own.id.as_str(), true)] {
        let Ok(Done::Kept { model_set, known }) = bench.ask(keep(id)) else { panic!("`{id}` was not kept") };
        assert_eq!((model_set.id.as_str(), known), (id, was_known));
        assert_eq!(bench.host.catalogue.model_sets.len(), 2, "nothing is there twice");
    }
    assert_eq!(bench.host.catalogue.active[0].1, None, "it is not in use");
    bench.host.disk_is_slow = true;
    let deletion = bench.host.command(Command::DeleteSession { session: 1 });
    assert_eq!(bench.refused(keep("m-late")), "session 1 is being deleted: ask again");
    bench.host.disk_is_slow = false;
    bench.host.commit(Ok(()));
    assert!(bench.host.reply(deletion).unwrap().is_ok());
    let reply = bench.ask(keep("m-late"));
    assert!(matches!(reply, Err(Rejection::NotFound(..))), "{reply:?}");
    assert!(bench.host.catalogue.model_sets.iter().all(|set| set.id != "m-late"));
}
