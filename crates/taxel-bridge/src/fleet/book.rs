//! What is known of all robots of a router, at one moment.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use taxel_client::{Moment, Received};
use taxel_proto::judge::{NoForce, word};
use taxel_proto::v1::ForceState;
use taxel_skin::{columns, printable};

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
    /// The force in N; absent unless it is valid.
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

const HEAD: [&str; 7] = ["robot", "patch", "state", "force N", "excluded", "model set", "why"];

/// Robots write into it what they like, but no other rows and nothing that a terminal obeys.
fn cells(row: &Row) -> Vec<String> {
    let force = row.force_n.map(|n| row.sigma_n.map_or(format!("{n:.2}"), |sigma| format!("{n:.2} +- {sigma:.2}")));
    let none = || "-".to_owned();
    let cells = [
        row.robot.clone(),
        row.patch.clone(),
        if row.simulated { format!("{}, simulated", row.state) } else { row.state.clone() },
        force.unwrap_or_else(none),
        row.excluded.map_or_else(none, |excluded| excluded.to_string()),
        if row.model_set.is_empty() { none() } else { row.model_set.clone() },
        row.reasons.join("; "),
    ];
    cells.map(|cell| printable(&cell)).to_vec()
}

/// All robots as a table in a terminal.
pub fn table(rows: &[Row]) -> String {
    let rows: Vec<_> = rows.iter().map(cells).collect();
    columns(&HEAD, &rows).join("\n") + "\n"
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

    #[test]
    fn a_table_says_what_is_and_a_dash_where_nothing_is_known() {
        let row = Row {
            robot: "icub".into(),
            patch: "arm".into(),
            state: "OK".into(),
            force_n: Some(4.904),
            sigma_n: Some(0.21),
            excluded: Some(11),
            model_set: "m-1".into(),
            ..Row::default()
        };
        let reasons = vec!["nothing new for 9.1 s".to_owned()];
        let silent = Row { robot: "r1".into(), patch: "leg".into(), state: "SILENT".into(), reasons, ..Row::default() };
        let text = table(&[row, silent]);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "robot  patch  state   force N       excluded  model set  why");
        assert_eq!(lines[1], "icub   arm    OK      4.90 +- 0.21  11        m-1");
        assert_eq!(lines[2], "r1     leg    SILENT  -             -         -          nothing new for 9.1 s");
    }

    #[test]
    fn what_a_robot_says_forges_no_row_and_is_no_command_to_the_terminal() {
        let forged = "\nicub02  arm  OK  4.90 +- 0.10\u{1b}[2J".to_owned();
        let row = Row { state: "OK".into(), simulated: true, reasons: vec![forged], ..Row::default() };
        let text = table(&[row]);
        assert_eq!((text.lines().count(), text.contains('\u{1b}')), (2, false), "{text}");
        assert!(text.contains("OK, simulated"), "{text}");
    }
}
