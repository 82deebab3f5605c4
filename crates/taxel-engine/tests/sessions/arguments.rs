//! What commands say beside their names: targets, modules that are left out, and the set that is expected to be active.

use taxel_engine::command::{Command, Done};

use crate::daemon::{Daemon, id_of};
use crate::disk::EPOCH_NS;
use crate::model::Passing::Hold;
use crate::model::Set;
use crate::model::Step::{Import, Pass};

#[test]
fn a_session_says_when_it_began_and_who_vouches_for_its_rest() {
    let mut daemon = Daemon::new();
    daemon.apply(Pass(Hold));
    let (patch, confirmed_by) = (String::new(), Some("Ada".to_owned()));
    let (target, branches, leave_out) = (None, None, Vec::new());
    let reply = daemon.ask(Command::StartSession { patch, target, branches, confirmed_by, leave_out });
    let Ok(Done::Session(view)) = reply else { panic!("{reply:?}") };
    assert_eq!((view.started_wall_ns, view.confirmed_by.as_deref()), (EPOCH_NS + 4_000_000_000, Some("Ada")));
}

#[test]
fn an_activation_may_name_the_set_that_is_active_before_it() {
    let mut daemon = Daemon::new();
    let [first, second] = [0, 1].map(Set::Foreign);
    for set in [first, second] {
        daemon.apply(Import(set));
    }
    let mut activate = |set: Set, expected: &str| {
        let expected = Some(expected.to_owned());
        daemon.ask(Command::Activate { patch: String::new(), model_set: id_of(set), expected })
    };
    let why = activate(first, "m-other").unwrap_err().to_string();
    assert_eq!(why, "expected `m-other` to be active, but it is none");
    assert!(matches!(activate(first, ""), Ok(Done::Activated { previous: None, .. })));
    assert!(activate(second, "").is_err() && activate(second, &id_of(second)).is_err());
    let reply = activate(second, &id_of(first));
    assert!(matches!(&reply, Ok(Done::Activated { previous: Some(id), .. }) if *id == id_of(first)), "{reply:?}");
}
