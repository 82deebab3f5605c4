//! Random walks over the table.

use proptest::prelude::*;
use proptest::sample::select;
use proptest_state_machine::{ReferenceStateMachine, StateMachineTest, prop_state_machine};
use taxel_engine::calibration::SessionState;

use crate::check::{Seen, check};
use crate::daemon::Daemon;
use crate::model::{Disk, Model, Passing, Set, Step};

struct Table;

impl ReferenceStateMachine for Table {
    type State = Model;
    type Transition = Step;

    fn init_state() -> BoxedStrategy<Model> {
        Just(Model::new()).boxed()
    }

    fn transitions(model: &Model) -> BoxedStrategy<Step> {
        let last = model.live.sessions.keys().next_back().copied().unwrap_or(0);
        // Mostly the newest session, at times an older one or one that is not there.
        let number = || prop_oneof![4 => Just(last.max(1)), 1 => 1..=last + 1];
        let foreign = [0, 1, 2].map(Set::Foreign);
        let known: Vec<Set> = model.live.known.iter().copied().chain([Set::Foreign(0)]).collect();
        let passes = [Passing::Rise, Passing::Rise, Passing::Hold, Passing::Vent, Passing::Vent];
        let idle = [Passing::GaugeSilent, Passing::ModuleSilent];
        let disk =
            [Step::DiskSlow, Step::DiskSlow, Step::DiskWrites, Step::DiskWrites, Step::DiskFast, Step::DiskFails];
        let fits = model.fits.len().saturating_sub(3)..model.fits.len().max(1);
        prop_oneof![
            20 => Just(usual(model)),
            8 => select(passes.to_vec()).prop_map(Step::Pass),
            2 => select(idle.to_vec()).prop_map(Step::Pass),
            2 => Just(Step::StartSession),
            3 => number().prop_map(Step::StartRamp),
            3 => number().prop_map(Step::FinishRamp),
            2 => number().prop_map(Step::Abort),
            2 => number().prop_map(Step::Discard),
            4 => select(known).prop_map(Step::Activate),
            2 => select(foreign.to_vec()).prop_map(Step::Import),
            2 => any::<bool>().prop_map(|confirmed| Step::Tare { confirmed }),
            1 => Just(Step::BringUp),
            1 => Just(Step::BusOff),
            4 => (fits, prop::bool::weighted(0.8)).prop_map(|(fit, well)| Step::FitEnds { fit, well }),
            4 => select(disk.to_vec()),
            1 => Just(Step::Restart),
        ]
        .boxed()
    }

    fn preconditions(model: &Model, step: &Step) -> bool {
        model.knows(*step)
    }

    fn apply(mut model: Model, step: &Step) -> Model {
        model.apply(*step);
        model
    }
}

/// What usually comes next: left to chance alone, few walks would come as far as models in use.
fn usual(model: &Model) -> Step {
    let fit = model.fits.iter().rposition(|fit| fit.out);
    let made =
        model.live.known.iter().copied().rfind(|set| matches!(set, Set::Fit(_)) && model.live.active != Some(*set));
    match (model.open(), fit, made) {
        (Some((_, SessionState::Taring)), ..) if model.kpa() > 0 => Step::Pass(Passing::Vent),
        (Some((_, SessionState::Taring)), ..) => Step::Pass(Passing::Hold),
        (Some((_, SessionState::Ramping)), ..) => Step::Pass(Passing::Rise),
        (Some(_), Some(fit), _) => Step::FitEnds { fit, well: true },
        (Some(_), None, _) if model.disk == Disk::Slow => Step::DiskFast,
        (None, _, Some(set)) if model.disk == Disk::Fast => Step::Activate(set),
        (None, ..) if model.disk == Disk::Failed => Step::Restart,
        (None, ..) if model.kpa() > 0 => Step::Pass(Passing::Vent),
        _ => Step::StartSession,
    }
}

struct Walk;

impl StateMachineTest for Walk {
    type SystemUnderTest = (Daemon, Seen);
    type Reference = Table;

    fn init_test(_: &Model) -> (Daemon, Seen) {
        (Daemon::new(), Seen::default())
    }

    fn apply((mut daemon, mut seen): (Daemon, Seen), model: &Model, step: Step) -> (Daemon, Seen) {
        seen.before(&daemon, step);
        daemon.apply(step);
        check(&daemon, &mut seen, model, step);
        (daemon, seen)
    }
}

prop_state_machine! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn sessions_keep_to_the_table(sequential 1..60 => Walk);
}
