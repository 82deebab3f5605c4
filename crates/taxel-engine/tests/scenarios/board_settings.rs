//! A model set comes into use only on boards that are set as they were when it was gathered: the rest looks the same
//! whatever a count is worth, so that nothing else tells a force that is half of the true one.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::command::{Command, Done, ErrorReason, Rejection};
use taxel_engine::known_set::{KnownSet, SetSummary};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{BoardSetup, Plan};
use taxel_engine::record::KeptZero;
use taxel_engine::snapshot::{ForceState, ReasonCode};
use taxel_sim::{Mass, PumpCommand, World};
use taxel_skin::TaxelIndex;
use taxel_wire::icub::TriangleConfig;

use crate::bench::{Bench, Disk};
use crate::rig::{module, patch_plan, plan, small_skin, small_world};
use crate::shared::configured;

/// The small skin, its boards set in another way than usual.
fn with_boards(change: impl FnOnce(&mut Vec<BoardSetup>)) -> Arc<Plan> {
    let mut patch = patch_plan(&small_skin());
    change(&mut patch.bring_up);
    plan(patch)
}

pub fn with_shift(shift: u8) -> Arc<Plan> {
    with_boards(|boards| set_shift(boards, shift))
}

fn set_shift(boards: &mut [BoardSetup], shift: u8) {
    boards.iter_mut().flat_map(|board| &mut board.triangles).for_each(|triangles| triangles.shift = shift);
}

/// Skin boards as at the calibration, but for their no-load value.
fn with_no_load(no_load: u8) -> Arc<Plan> {
    with_boards(|boards| {
        set_shift(boards, 1);
        boards.iter_mut().for_each(|board| board.board.no_load = no_load);
    })
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
    CALIBRATED.get_or_init(|| calibrated(with_shift(1)))
}

/// A session up to 30 kPa, whose set is in use then. The bag is vented.
fn calibrate(bench: &mut Bench) -> Arc<ModelSet> {
    bench.start_session(Some(30.0));
    bench.ramp(74.0, 4.0);
    bench.until_state(30.0, SessionState::Review);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    let set = bench.host.newest_set();
    bench.activate(&set.id).unwrap();
    set
}

fn calibrated(plan: Arc<Plan>) -> Calibrated {
    let configured = configured(&plan.patches[0]);
    let mut bench = Bench::new(small_world(), plan, Restored::default());
    bench.brought_up();
    let set = calibrate(&mut bench);
    Calibrated {
        world: bench.world.clone(),
        configured,
        set,
        session: Arc::new(SessionView { state: SessionState::Review, ..bench.host.session().clone() }),
    }
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
    assert_eq!(bench.host.reasons(), format!("no model set is active: {}", problems[0]));
    problems[0].clone()
}

fn other(id: &str, change: impl FnOnce(&mut ModelSet)) -> Arc<ModelSet> {
    let mut set = ModelSet { id: id.to_owned(), session: None, ..ModelSet::clone(&at_shift_1().set) };
    change(&mut set);
    Arc::new(set)
}

fn import(bench: &mut Bench, set: Arc<ModelSet>) {
    let taken = bench.ask(Command::Import { model_set: set, insist: false });
    assert!(matches!(taken, Ok(Done::Imported { .. })), "{taken:?}");
}

#[test]
fn after_a_restart_with_another_shift_there_is_no_force_and_the_board_is_named() {
    let mut bench = at_shift_1().restarted(with_shift(2));
    let why = unused(&mut bench);
    let id = &at_shift_1().set.id;
    assert_eq!(
        why,
        format!(
            "model set `{id}` of patch `small` is not used: `{id}` was gathered with shift 1 on module 0 of board 13, where \
             the configuration has shift 2 (and 7 more): set it as it was, activate a set that was gathered as it is now, or \
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
    let mut restored = Disk::after_a_crash(&bench.host).restored;
    restored.model_sets = vec![Arc::clone(&at_shift_1().set).into()];
    restored.active = vec![(at_shift_1().set.patch.clone(), id.to_owned())];
    assert_eq!(restored.sessions[0].state, SessionState::Discarded);
    let mut bench = Bench::new(bench.world, with_shift(1), restored);
    let why = unused(&mut bench);
    let said = format!("model set `{id}` of patch `small` is not used: its session was laid aside; activate another");
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
    let mut bench = calibrated(with_shift(2)).restarted(with_shift(2));
    let own = bench.host.catalogue.active[0].1.clone();
    bench.until_force(10.0, ForceState::Ok);
    import(&mut bench, other("m-other", |_| {}));
    let activation = Command::Activate { patch: String::new(), model_set: "m-other".to_owned(), expected: None };
    let Err(Rejection::FailedPrecondition(ErrorReason::LayoutChanged, why)) = bench.ask(activation.clone()) else {
        panic!("not refused")
    };
    let said =
        "`m-other` was gathered with shift 1 on module 0 of board 13, where the configuration has shift 2 (and 7 more)";
    assert!(why.starts_with(said), "{why}");
    assert_eq!(bench.host.catalogue.active[0].1, own, "what is refused has no effect");
    weighs(&mut bench, "another set was refused");
    // Whoever changes the configuration then may use it.
    let mut later = at_shift_1().restarted(with_shift(1));
    import(&mut later, other("m-other", |_| {}));
    later.ask(activation).unwrap();
    weighs(&mut later, "a set of boards with the same settings");
}

/// As many taxels, and each with the model of another one.
#[test]
fn a_set_of_other_modules_or_of_boards_in_another_order_is_not_used() {
    let calibrated = at_shift_1();
    let lines = calibrated.set.board_settings.clone();
    assert!(lines[0].ends_with("; modules 0-5") && lines[1].ends_with("; modules 0-1"), "{lines:?}");
    let other_modules = vec![lines[0].replace("modules 0-5", "modules 1-6"), lines[1].clone()];
    let other_order = vec![lines[1].clone(), lines[0].clone()];
    for (lines, said) in [
        (other_modules, "with modules 1-6 on board 13, where the configuration has modules 0-5: "),
        (other_order, "with board 12, board 13 in this order, where the configuration has board 13, board 12: "),
    ] {
        let set = other("m-other", |set| set.board_settings = lines);
        let why = unused(&mut calibrated.restarted_with(with_shift(1), Arc::clone(&set)));
        assert!(why.contains(said), "{why}");
        let mut bench = calibrated.restarted(with_shift(1));
        import(&mut bench, set);
        let why =
            bench.refused(Command::Activate { patch: String::new(), model_set: "m-other".to_owned(), expected: None });
        assert!(why.contains(said), "{why}");
    }
}

#[test]
fn a_set_that_is_read_from_the_disk_first_is_refused_all_the_same() {
    let stored = other("m-stored", |_| {});
    let model_sets = vec![KnownSet::stored(SetSummary::of(&stored))];
    let restored = Restored { model_sets, ..Restored::default() };
    let mut bench = Bench::new(at_shift_1().world.clone(), with_shift(0), restored);
    bench.host.shelf.push(stored);
    let activation = Command::Activate { patch: String::new(), model_set: "m-stored".to_owned(), expected: None };
    let why = bench.refused(activation);
    assert!(why.contains("shift 1 on module 0 of board 13, where the configuration has shift 0"), "{why}");
    assert_eq!(bench.host.catalogue.active[0].1, None);
}

/// The counts of a load and the higher no-load value make up for each other: the skin lies where it lay at rest.
#[test]
fn a_load_that_another_no_load_value_makes_up_for_is_not_taken_for_rest() {
    let mut bench = at_shift_1().restarted(with_no_load(250));
    let mark = bench.mark();
    bench.world.lay(Mass::on_disc(1.0, TaxelIndex(35), 20_000.0)).unwrap();
    let why = unused(&mut bench);
    assert!(why.contains("no_load 240 on board 13, where the configuration has no_load 250 (and 1 more)"), "{why}");
    bench.is_truthful_since(mark, "a load beside another no-load value");
    // With the right one it is told from rest.
    let mut bench = at_shift_1().restarted(with_no_load(240));
    let mark = bench.mark();
    bench.world.lay(Mass::on_disc(1.0, TaxelIndex(35), 20_000.0)).unwrap();
    bench.seconds(10.0);
    bench.is_truthful_since(mark, "a load at the start");
    assert_eq!(bench.host.state(), ForceState::TareInvalid);
}

#[test]
fn where_the_settings_of_one_side_are_not_known_nothing_changes() {
    let calibrated = at_shift_1();
    // An earlier version, a file, or a daemon that only listened.
    let listened = ["board 13: settings unknown", "board 12: settings unknown"].map(str::to_owned).to_vec();
    for lines in [Vec::new(), listened, vec!["as they were".to_owned()]] {
        let set = other("m-unknown", |set| set.board_settings.clone_from(&lines));
        let mut bench = calibrated.restarted_with(with_shift(1), set);
        assert_eq!(bench.host.catalogue.active[0].1.as_deref(), Some("m-unknown"), "{lines:?}");
        weighs(&mut bench, "a set whose settings are not known");
        import(&mut bench, other("m-too", |set| set.board_settings.clone_from(&lines)));
        bench.activate("m-too").unwrap();
    }
    // One that only listens now does not know what the boards were told.
    let restored = Restored {
        active: vec![(calibrated.set.patch.clone(), calibrated.set.id.clone())],
        model_sets: vec![Arc::clone(&calibrated.set).into()],
        ..Restored::default()
    };
    let mut bench = Bench::new(calibrated.world.clone(), with_boards(Vec::clear), restored);
    weighs(&mut bench, "a daemon that only listens");
    import(&mut bench, other("m-too", |_| {}));
    bench.activate("m-too").unwrap();
}

/// A hand: other values on some modules of a board, as exceptions.
fn hand(exceptions: &[(u8, u8, u16)]) -> Arc<Plan> {
    with_boards(|boards| {
        let usual = boards[0].triangles[0];
        let of = |&(number, shift, cdc_offset): &(u8, u8, u16)| TriangleConfig {
            first: module(number),
            last: module(number),
            shift,
            cdc_offset,
            ..usual
        };
        boards[0].triangles.extend(exceptions.iter().map(of));
    })
}

#[test]
fn of_a_hand_each_module_is_compared_with_its_own_settings() {
    let calibrated = calibrated(hand(&[(2, 1, 0x2000), (4, 1, 0x2200)]));
    let mut bench = calibrated.restarted(hand(&[(4, 1, 0x2200), (2, 1, 0x2000)]));
    assert!(bench.host.health().problems.is_empty());
    bench.tare(Some("Ada")).unwrap(); // other commands: the boards were configured anew
    weighs(&mut bench, "the same exceptions in another order");
    // What was an exception may be said of the board, and the board's be exceptions: the same for each module.
    let turned = with_boards(|boards| {
        let usual = boards[0].triangles[0];
        let (first, last) = (module(0), module(5));
        let part = |first: u8, last: u8, shift: u8, cdc_offset: u16| TriangleConfig {
            first: module(first),
            last: module(last),
            shift,
            cdc_offset,
            ..usual
        };
        let all = TriangleConfig { first, last, shift: 1, ..usual };
        boards[0].triangles = vec![all, part(0, 3, 2, 0x2200), part(5, 5, 2, 0x2200), part(2, 2, 1, 0x2000)];
    });
    assert!(calibrated.restarted(turned).host.health().problems.is_empty());
    for (exceptions, said) in [
        (vec![(2, 1, 0x2000)], "shift 1 on module 4 of board 13, where the configuration has shift 2: "),
        (
            vec![(2, 1, 0x2200), (4, 1, 0x2200)],
            "cdc_offset 0x2000 on module 2 of board 13, where the configuration has cdc_offset 0x2200: ",
        ),
        (
            vec![(2, 1, 0x2000), (4, 1, 0x2200), (5, 0, 0x2200)],
            "shift 2 on module 5 of board 13, where the configuration has shift 0: ",
        ),
    ] {
        let why = unused(&mut calibrated.restarted(hand(&exceptions)));
        assert!(why.contains(said), "{why}");
    }
}

#[test]
fn boards_of_another_type_are_told_from_those_of_the_calibration() {
    let other_type = with_boards(|boards| {
        set_shift(boards, 1);
        boards[1].board.kind = 8;
    });
    let why = unused(&mut at_shift_1().restarted(other_type));
    assert!(why.contains("type 0 on board 12, where the configuration has type 8: "), "{why}");
}

#[test]
fn a_skin_whose_set_is_of_other_settings_is_calibrated_again() {
    let mut bench = at_shift_1().restarted(with_shift(2));
    unused(&mut bench);
    calibrate(&mut bench);
    bench.tare(None).unwrap();
    weighs(&mut bench, "calibrated again");
}
