//! What is known of all robots of a router, at one moment.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use taxel_client::{Moment, Received};
use taxel_proto::judge::{NoForce, word};
use taxel_proto::v1::ForceState;

/// A robot tells its force at least once a second.
const SILENT_AFTER: Duration = Duration::from_secs(3);

/// The newest force of each patch of each robot.
pub type Book = BTreeMap<(String, String), Received>;

/// A patch of a robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Whose.
    pub robot: String,
    /// Which.
    pub patch: String,
    /// `OK` and so on as in the service, or `SILENT` while nothing comes.
    pub state: String,
    /// The force in N; absent unless it may be believed.
    pub force_n: Option<f64>,
    /// Its standard uncertainty in N.
    pub sigma_n: Option<f64>,
    /// Whether a simulator makes it, and no skin is touched.
    pub simulated: bool,
    /// Taxels that do not count.
    pub excluded: Option<u32>,
    /// The model set in use; empty where it is not known.
    pub model_set: String,
    /// Why the state is not OK.
    pub reasons: Vec<String>,
}

/// Everything, robot by robot and patch by patch.
pub fn rows(book: &Book, now: Moment) -> Vec<Row> {
    book.iter().map(|((robot, patch), received)| row(robot, patch, received, now)).collect()
}

/// The robot's bridge has judged the force when it sent it; here it is judged again, by its age now.
fn row(robot: &str, patch: &str, received: &Received, now: Moment) -> Row {
    let (sample, waited, judged) = (received.sample(), received.waited(now), received.force(now, None));
    let (state, reasons) = match &judged {
        _ if waited > SILENT_AFTER => ("SILENT", vec![format!("nothing new for {:.1} s", waited.as_secs_f64())]),
        Err(old @ NoForce::TooOld(..)) => (word(ForceState::Stale), vec![old.to_string()]),
        _ => (word(sample.state()), sample.reasons.clone()),
    };
    let force = judged.ok().filter(|_| waited <= SILENT_AFTER);
    Row {
        robot: robot.to_owned(),
        patch: patch.to_owned(),
        state: state.to_owned(),
        force_n: force.map(|force| force.total_n),
        sigma_n: force.and(sample.total_sigma_n),
        simulated: sample.simulated,
        excluded: force.map(|_| sample.excluded),
        model_set: sample.model_set.clone(),
        reasons,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;
    use taxel_proto::v1::ForceSample;

    /// A good force that was sent so long ago.
    fn sent(ago_s: f64) -> ForceSample {
        ForceSample {
            state: ForceState::Ok.into(),
            total_n: Some(4.9),
            total_sigma_n: Some(0.5),
            age_s: Some(0.02),
            max_age_s: 0.15,
            sent: Some((SystemTime::now() - Duration::from_secs_f64(ago_s)).into()),
            excluded: 3,
            model_set: "m-1".into(),
            ..ForceSample::default()
        }
    }

    fn icub_arm() -> (String, String) {
        ("icub".to_owned(), "arm".to_owned())
    }

    /// The first row in so many seconds.
    fn first(book: &Book, in_s: f64) -> Row {
        rows(book, Moment::now() + Duration::from_secs_f64(in_s)).remove(0)
    }

    #[test]
    fn a_force_grows_old_and_a_robot_that_falls_silent_has_none() {
        let mut book = Book::default();
        book.insert(icub_arm(), Received::now(sent(0.0)));
        let now = first(&book, 0.0);
        assert_eq!((now.state.as_str(), now.force_n, now.excluded), ("OK", Some(4.9), Some(3)));
        for (in_s, state, why) in [(1.0, "STALE", "ms old, more than 150 ms"), (3.1, "SILENT", "nothing new for 3.")] {
            let row = first(&book, in_s);
            assert_eq!((row.state.as_str(), row.force_n, row.sigma_n), (state, None, None));
            assert!(row.reasons[0].contains(why), "{:?}", row.reasons);
        }
        let tare = ForceSample { state: ForceState::TareInvalid.into(), reasons: vec!["why".into()], ..sent(0.0) };
        book.insert(icub_arm(), Received::now(tare));
        let row = first(&book, 0.0);
        assert_eq!((row.state.as_str(), row.force_n, row.reasons), ("TARE_INVALID", None, vec!["why".to_owned()]));
    }
}
