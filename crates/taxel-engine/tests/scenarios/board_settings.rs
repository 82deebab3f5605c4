//! A model set comes into use only on boards that are set as they were when it was gathered: the rest looks the same
//! whatever a count is worth, so that nothing else tells a force that is half of the true one.

use taxel_engine::plan::BoardSetup;
use taxel_engine::record::KeptZero;
use taxel_engine::snapshot::ReasonCode;
use taxel_wire::icub::TriangleConfig;

use crate::prelude::*;

/// The small skin, its boards set in another way than usual.
fn with_boards(change: impl FnOnce(&mut Vec<BoardSetup>)) -> Arc<Plan> {
    let mut patch = patch_plan(&small_skin());
    change(&mut patch.bring_up);
    plan(patch)
}

pub fn with_shift(shift: u8) -> Arc<Plan> {
    let set = |triangles: &mut TriangleConfig| triangles.shift = shift;
    with_boards(|boards| boards.iter_mut().flat_map(|board| &mut board.triangles).for_each(set))
}

/// What a calibration left, on boards that were configured so.
struct Calibrated {
    world: World,
    configured: KeptZero,
    set: Arc<ModelSet>,
    session: Arc<SessionView>,
}

/// Up to 30 kPa with shift 1: a count is worth half of the usual. The bag is vented.
fn at_shift_1() -> &'static Calibrated {
    static CALIBRATED: OnceLock<Calibrated> = OnceLock::new();
    CALIBRATED.get_or_init(|| {
        let mut bench = Bench::new(small_world(), with_shift(1), Restored::default());
        bench.brought_up();
        let (configured, set) = (configured(&bench.host.plan.patches[0]), calibrate(&mut bench));
        let session = Arc::new(SessionView { state: SessionState::Review, ..bench.host.session().clone() });
        Calibrated { world: bench.world, configured, set, session }
    })
}

/// A session up to 30 kPa, whose set is in use then. The bag is vented.
fn calibrate(bench: &mut Bench) -> Arc<ModelSet> {
    bench.start_session(Some(30.0));
    bench.ramp(74.0, 4.0);
    bench.until_state(30.0, SessionState::Review);
    bench.vent(20.0);
    let set = bench.host.newest_set();
    bench.activate(&set.id).unwrap();
    set
}

impl Calibrated {
    /// The daemon starts anew, beside boards that stream, with this set in use and its session. It has configured them if
    /// they were configured otherwise.
    fn restarted_with(&self, plan: Arc<Plan>, set: Arc<ModelSet>) -> Bench {
        let restored = Restored {
            sessions: vec![Arc::clone(&self.session)],
            active: vec![(set.patch.clone(), set.id.clone())],
            model_sets: vec![set.into()],
            next_session: 2,
            zeros: vec![("small".to_owned(), self.configured.clone())],
            ..Restored::default()
        };
        let mut bench = Bench::new(self.world.clone(), plan, restored);
        bench.brought_up();
        bench
    }

    fn restarted(&self, plan: Arc<Plan>) -> Bench {
        self.restarted_with(plan, Arc::clone(&self.set))
    }
}

/// A kilogram is told within its interval.
fn weighs(bench: &mut Bench, story: &str) {
    bench.until_force(10.0, ForceState::Ok);
    let mark = bench.mark();
    bench.lay(1.0, 35);
    bench.seconds(3.0);
    bench.is_truthful_since(mark, story);
    assert!(bench.host.snapshot().force.total.is_some_and(|total| total.0 > 5.0), "{story}: {}", bench.host.present());
}

/// A set is not in use since the start; why, as told with the force and in the health.
fn unused(bench: &mut Bench) -> String {
    bench.seconds(5.0);
    assert_eq!(bench.host.state(), ForceState::Uncalibrated, "{}", bench.host.reasons());
    assert_eq!(bench.host.snapshot().force.reasons[0].code(), ReasonCode::NoModelSet);
    assert_eq!(bench.host.catalogue.active[0].1, None);
    let problems = &bench.host.health().problems;
    assert_eq!(bench.host.reasons(), format!("no model set is in use: {}", problems[0]));
    problems[0].clone()
}

fn other(id: &str, change: impl FnOnce(&mut ModelSet)) -> Arc<ModelSet> {
    let mut set = ModelSet { id: id.to_owned(), session: None, ..ModelSet::clone(&at_shift_1().set) };
    change(&mut set);
    Arc::new(set)
}

#[test]
fn after_a_restart_with_another_shift_there_is_no_force_and_the_board_is_named() {
    let mut bench = at_shift_1().restarted(with_shift(2));
    let why = unused(&mut bench);
    let id = &at_shift_1().set.id;
    assert_eq!(
        why,
        format!(
            "model set `{id}` of patch `small` is not used: `{id}` was gathered with shift 0-5 = 1 on board 13, where \
             the configuration has shift 0-5 = 2 (and 1 more): set it as it was, activate a set that was gathered as it is now, or \
             calibrate again"
        )
    );
    let mark = bench.mark();
    bench.lay(1.0, 35);
    bench.seconds(3.0);
    bench.is_truthful_since(mark, "a count is worth twice of what it was");
    assert!(!bench.has_force_since(mark));
    assert_eq!(bench.host.catalogue.sessions[0].state, SessionState::Review, "its set is not in use");
}

/// It was not in use while another configuration was, so that its session could be laid aside.
#[test]
fn a_set_whose_session_was_laid_aside_while_it_did_not_fit_is_not_used_once_it_fits() {
    let mut bench = at_shift_1().restarted(with_shift(2));
    let (session, id) = (at_shift_1().session.number, at_shift_1().set.id.as_str());
    bench.ask(Command::DiscardSession { session }).unwrap();
    let restored = bench.host.disk.found();
    assert_eq!(restored.sessions[0].state, SessionState::Discarded);
    let mut bench = Bench::new(bench.world, with_shift(1), restored);
    let why = unused(&mut bench);
    let said = format!("model set `{id}` of patch `small` is not used: its session was discarded; activate another");
    assert!(why.starts_with(&said), "{why}");
}

#[test]
fn after_a_restart_with_the_settings_of_the_calibration_the_force_is_told_as_before() {
    let mut bench = at_shift_1().restarted(with_shift(1));
    assert!(bench.host.health().problems.is_empty());
    assert_eq!(bench.host.catalogue.sessions[0].state, SessionState::Active);
    weighs(&mut bench, "the same settings");
    let mut other_period = Plan::clone(&with_shift(1));
    other_period.patches[0].period = Duration::from_millis(60);
    other_period.patches[0].bring_up.iter_mut().for_each(|board| board.board.period_ms = 60);
    // Boards that do not stream yet: nothing has to be proven at the earlier period.
    let Calibrated { set, session, configured, .. } = at_shift_1();
    let (set, session, configured) = (Arc::clone(set), Arc::clone(session), configured.clone());
    let silent = Calibrated { world: small_world(), set, session, configured };
    weighs(&mut silent.restarted(Arc::new(other_period)), "no count depends on the period");
}

#[test]
fn a_set_of_boards_with_another_shift_is_imported_and_not_activated() {
    let mut bench = small().in_charge();
    bench.import(other("m-other", |_| {}));
    let why = refused_as(ErrorReason::LayoutChanged, bench.ask(say::activate("m-other")));
    let said =
        "`m-other` was gathered with shift 0-5 = 1 on board 13, where the configuration has shift 0-5 = 2 (and 1 more)";
    assert!(why.starts_with(said), "{why}");
    assert_eq!(bench.host.catalogue.active[0].1.as_ref(), Some(&small().set.id), "what is refused has no effect");
    weighs(&mut bench, "another set was refused");
    // An operator who changes the configuration then may use it.
    let mut later = at_shift_1().restarted(with_shift(1));
    later.import(other("m-other", |_| {}));
    later.activate("m-other").unwrap();
    weighs(&mut later, "a set of boards with the same settings");
}
