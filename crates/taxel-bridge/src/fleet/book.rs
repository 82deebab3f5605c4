//! What is known of all robots of a router, at one moment. Time comes in as data.

use std::collections::BTreeMap;
use std::time::{Duration, SystemTime};

use serde::Serialize;
use taxel_client::Moment;
use taxel_proto::judge::{NoForce, judge, on_the_way, word};
use taxel_proto::v1::{ForceSample, ForceState, Health, ModelSetSummary};

/// Patches in one view; what more come is not kept.
const PATCHES_MAX: usize = 10_000;

/// A robot tells its force at least once a second, and its health.
const SILENT_AFTER: Duration = Duration::from_secs(3);

/// When something is looked at, or came.
#[derive(Clone, Copy, Debug)]
pub struct Now {
    /// By the clock that never steps.
    pub at: Moment,
    /// By the wall clock.
    pub wall: SystemTime,
}

/// All robots.
#[derive(Debug, Default)]
pub struct Book {
    patches: BTreeMap<(String, String), Patch>,
    health: BTreeMap<String, (Moment, Health)>,
    is_full: bool,
}

#[derive(Debug, Default)]
struct Patch {
    force: Option<(Moment, ForceSample)>,
    model: ModelSetSummary,
}

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
    /// Its age in s.
    pub age_s: Option<f64>,
    /// Whether a simulator makes it, and no skin is touched.
    pub simulated: bool,
    /// Taxels that do not count.
    pub excluded: Option<u32>,
    /// Whether the zero is valid; absent where the daemon's health is not known.
    pub zero_valid: Option<bool>,
    /// When the zero was taken, s since 1970.
    pub zero_taken: Option<i64>,
    /// The model set in use; empty where it is not known.
    pub model_set: String,
    /// When that was made, s since 1970.
    pub calibrated: Option<i64>,
    /// Why the state is not OK.
    pub reasons: Vec<String>,
}

impl Book {
    /// A sample came.
    pub fn force(&mut self, robot: &str, patch: &str, sample: ForceSample, now: Now) {
        if let Some(patch) = self.patch(robot, patch) {
            patch.force = Some((now.at, sample));
        }
    }

    /// The model set of a patch came.
    pub fn model(&mut self, robot: &str, patch: &str, model: ModelSetSummary) {
        if let Some(patch) = self.patch(robot, patch) {
            patch.model = model;
        }
    }

    /// The health of a robot's daemon came.
    pub fn health(&mut self, robot: &str, health: Health, now: Now) {
        if self.health.contains_key(robot) || self.health.len() < PATCHES_MAX {
            self.health.insert(robot.to_owned(), (now.at, health));
        }
    }

    /// Whether there are more patches than are shown.
    pub fn is_full(&self) -> bool {
        self.is_full
    }

    fn patch(&mut self, robot: &str, patch: &str) -> Option<&mut Patch> {
        let key = (robot.to_owned(), patch.to_owned());
        if !self.patches.contains_key(&key) && self.patches.len() >= PATCHES_MAX {
            self.is_full = true;
            return None;
        }
        Some(self.patches.entry(key).or_default())
    }

    /// Everything, robot by robot and patch by patch.
    pub fn rows(&self, now: Now) -> Vec<Row> {
        let row = |((robot, name), patch): (&(String, String), &Patch)| {
            let force = patch.row(now);
            Row { robot: robot.clone(), patch: name.clone(), ..self.with_zero(robot, name, force, now) }
        };
        self.patches.iter().map(row).collect()
    }

    /// Nobody knows what has become of the zero of an engine that stands still, or of a daemon that says nothing.
    fn with_zero(&self, robot: &str, patch: &str, row: Row, now: Now) -> Row {
        let health = self
            .health
            .get(robot)
            .filter(|(came, health)| now.at.since(*came) <= SILENT_AFTER && health.engine_stalled_s.is_none());
        let zero = health.and_then(|(_, health)| health.patches.iter().find(|health| health.patch == patch));
        let zero = zero.and_then(|health| health.tare.as_ref());
        let zero_taken = zero.and_then(|zero| Some(zero.time.as_ref()?.seconds));
        Row { zero_valid: zero.map(|zero| zero.valid), zero_taken, ..row }
    }
}

impl Patch {
    /// The robot's bridge has judged the force when it sent it; here it is judged again, by its age now.
    fn row(&self, now: Now) -> Row {
        let model_set = self.model.model_set.clone();
        let calibrated = self.model.created.as_ref().map(|created| created.seconds);
        let silent = |reasons| Row { state: "SILENT".to_owned(), reasons, ..Row::default() };
        let Some((came, sample)) = &self.force else {
            return Row { model_set, calibrated, ..silent(Vec::new()) };
        };
        let waited = now.at.since(*came).max(on_the_way(sample.sent.as_ref(), now.wall));
        if waited > SILENT_AFTER {
            let why = format!("nothing new for {:.1} s", waited.as_secs_f64());
            return Row { model_set, calibrated, ..silent(vec![why]) };
        }
        let judged = judge(sample, waited, None);
        let (state, reasons) = match &judged {
            Err(old @ NoForce::TooOld(..)) => (ForceState::Stale, vec![old.to_string()]),
            _ => (sample.state(), sample.reasons.clone()),
        };
        let (good, force) = (judged.is_ok().then_some(sample), judged.ok());
        Row {
            state: word(state).to_owned(),
            force_n: force.map(|force| force.total_n),
            sigma_n: good.and_then(|sample| sample.total_sigma_n),
            age_s: force.map(|force| force.age.as_secs_f64()),
            simulated: sample.simulated,
            excluded: good.map(|sample| sample.excluded),
            model_set,
            calibrated,
            reasons,
            ..Row::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::Timestamp;
    use taxel_proto::v1::{PatchHealth, TareStatus};

    const WALL_S: u64 = 1_700_000_000;

    /// So many seconds after a view began.
    fn at(begun: Moment, seconds: f64) -> Now {
        let after = Duration::from_secs_f64(seconds);
        Now { at: begun + after, wall: SystemTime::UNIX_EPOCH + Duration::from_secs(WALL_S) + after }
    }

    /// A good force that was sent so many seconds after a view began.
    fn sent(seconds: f64) -> ForceSample {
        let sent = SystemTime::UNIX_EPOCH + Duration::from_secs(WALL_S) + Duration::from_secs_f64(seconds);
        ForceSample {
            state: ForceState::Ok.into(),
            total_n: Some(4.9),
            total_sigma_n: Some(0.5),
            age_s: Some(0.02),
            max_age_s: 0.15,
            sent: Some(sent.into()),
            excluded: 3,
            ..ForceSample::default()
        }
    }

    #[test]
    fn a_robot_is_shown_with_its_force_its_zero_and_its_model_set() {
        let (mut book, begun) = (Book::default(), Moment::now());
        book.force("icub", "arm", sent(1.0), at(begun, 1.0));
        let created = Some(Timestamp { seconds: 1_600_000_000, nanos: 0 });
        book.model("icub", "arm", ModelSetSummary { model_set: "m-1".into(), created, ..Default::default() });
        let time = Some(Timestamp { seconds: WALL_S as i64, nanos: 0 });
        let tare = Some(TareStatus { valid: true, time, ..TareStatus::default() });
        let patches = vec![PatchHealth { patch: "arm".into(), tare, ..PatchHealth::default() }];
        let health = Health { patches, ..Health::default() };
        book.health("icub", health.clone(), at(begun, 1.0));
        let row = book.rows(at(begun, 1.1)).remove(0);
        assert_eq!((row.robot.as_str(), row.patch.as_str(), row.state.as_str()), ("icub", "arm", "OK"));
        assert_eq!((row.force_n, row.sigma_n, row.excluded), (Some(4.9), Some(0.5), Some(3)));
        assert!((row.age_s.unwrap() - 0.12).abs() < 1e-6);
        let row = book.rows(at(begun, 1.5)).remove(0);
        assert_eq!((row.state.as_str(), row.force_n, row.sigma_n, row.age_s), ("STALE", None, None, None));
        assert_eq!(row.reasons, ["520 ms old, more than 150 ms"]);
        assert_eq!((row.zero_valid, row.zero_taken), (Some(true), Some(WALL_S as i64)));
        assert_eq!((row.calibrated, row.model_set.as_str()), (Some(1_600_000_000), "m-1"));
        assert_eq!(book.rows(at(begun, 4.1))[0].zero_valid, None, "a health that is old");
        book.health("icub", Health { engine_stalled_s: Some(0.2), ..health }, at(begun, 1.0));
        assert_eq!(book.rows(at(begun, 1.5))[0].zero_valid, None, "an engine that stands still tells no zero");
    }

    #[test]
    fn a_robot_that_falls_silent_has_no_force_any_more() {
        let (mut book, begun) = (Book::default(), Moment::now());
        book.force("icub", "arm", sent(1.0), at(begun, 1.0));
        let row = book.rows(at(begun, 4.1)).remove(0);
        assert_eq!((row.state.as_str(), row.force_n, row.sigma_n, row.age_s), ("SILENT", None, None, None));
        assert_eq!(row.reasons, ["nothing new for 3.1 s"]);
        book.force("icub", "arm", sent(4.2), at(begun, 4.2));
        assert_eq!(book.rows(at(begun, 4.2))[0].force_n, Some(4.9));
        let tare = ForceSample { state: ForceState::TareInvalid.into(), reasons: vec!["why".into()], ..sent(4.3) };
        book.force("icub", "arm", tare, at(begun, 4.3));
        let row = book.rows(at(begun, 4.3)).remove(0);
        assert_eq!((row.state.as_str(), row.force_n, row.age_s), ("TARE_INVALID", None, None));
        assert_eq!(row.reasons, ["why"]);
    }

    /// What waited at a router, in a queue, or while this computer slept.
    #[test]
    fn a_force_that_was_long_on_its_way_is_as_old_as_it_is() {
        let (mut book, begun) = (Book::default(), Moment::now());
        book.force("icub", "arm", sent(1.0), at(begun, 2.0));
        assert_eq!(book.rows(at(begun, 2.1))[0].reasons, ["1120 ms old, more than 150 ms"]);
        book.force("icub", "arm", sent(2.0), at(begun, 3_600.0));
        assert_eq!(book.rows(at(begun, 3_600.0))[0].state, "SILENT");
    }

    #[test]
    fn more_patches_than_a_view_holds_take_no_memory() {
        let (mut book, now) = (Book::default(), at(Moment::now(), 1.0));
        for n in 0..PATCHES_MAX {
            book.force("icub", &n.to_string(), sent(1.0), now);
        }
        assert!(!book.is_full());
        book.force("icub", "one more", sent(1.0), now);
        assert_eq!((book.rows(now).len(), book.is_full()), (PATCHES_MAX, true));
    }
}
