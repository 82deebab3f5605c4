//! What is known of all robots of a router, at one moment. Time comes in as data: since the view began, and since 1970.

use std::collections::BTreeMap;
use std::time::{Duration, SystemTime};

use serde::Serialize;
use taxel_proto::judge::on_the_way;
use taxel_proto::v1::{Drift, DriftState, ForceSample, Health, ModelSetSummary};

use crate::belief::{self, NoForce};

/// Robots in one view; what more come is counted and not kept.
const ROBOTS_MAX: usize = 10_000;
/// Patches of one robot.
const PATCHES_MAX: usize = 64;

/// A robot's health comes once a second.
const HEALTH_AGE_MAX: Duration = Duration::from_secs(5);

/// All robots.
#[derive(Debug)]
pub struct Book {
    robots: BTreeMap<String, Robot>,
    age_max: Duration,
    refused: u64,
}

#[derive(Debug, Default)]
struct Robot {
    here: bool,
    since: Duration,
    forces: BTreeMap<String, Told>,
    /// When it came, and the health.
    health: Option<(Duration, Health)>,
    models: Vec<ModelSetSummary>,
}

/// A sample, when it came, and how much longer it was on its way than the quickest of its robot.
#[derive(Debug)]
struct Told {
    sample: ForceSample,
    came: Duration,
    delayed: Duration,
}

/// A patch of a robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Whose.
    pub robot: String,
    /// Whether its bridge is on the router.
    pub here: bool,
    /// For how long it has been, or has not been, in s.
    pub for_s: f64,
    /// Which; empty while nothing has come of any.
    pub patch: String,
    /// `OK` and so on as in the service, or `GONE`, or `SILENT` while nothing comes.
    pub state: String,
    /// The force in N; absent unless it may be believed.
    pub force_n: Option<f64>,
    /// Whether a simulator makes it, and no skin is touched.
    pub simulated: bool,
    /// Its standard uncertainty in N.
    pub sigma_n: Option<f64>,
    /// Its age in s.
    pub age_s: Option<f64>,
    /// Taxels that do not count.
    pub excluded: Option<u32>,
    /// Taxels that counted when the models were made and do not now: silent, or with a fault.
    pub lost: Option<u32>,
    /// Whether the zero holds.
    pub zero_valid: Option<bool>,
    /// When it was taken, s since 1970.
    pub zero_taken: Option<i64>,
    /// How far the zero followed the skin's temperature since then, in counts of the module that drifted furthest.
    pub drift_counts: Option<f64>,
    /// When the models in use were made, s since 1970.
    pub calibrated: Option<i64>,
    /// The models in use.
    pub model_set: String,
    /// Why the state is not OK.
    pub reasons: Vec<String>,
}

impl Book {
    /// Knows nobody yet; an older force than `age_max` is none.
    pub fn new(age_max: Duration) -> Self {
        Self { robots: BTreeMap::new(), age_max, refused: 0 }
    }

    /// How many messages were of robots or patches beyond the limits.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    fn robot(&mut self, robot: &str, now: Duration) -> Option<&mut Robot> {
        if !self.robots.contains_key(robot) && self.robots.len() >= ROBOTS_MAX {
            self.refused += 1;
            return None;
        }
        Some(self.robots.entry(robot.to_owned()).or_insert_with(|| Robot { since: now, ..Robot::default() }))
    }

    /// A robot's token came or went. Whether that is news.
    pub fn alive(&mut self, robot: &str, here: bool, now: Duration) -> bool {
        let Some(robot) = self.robot(robot, now) else { return false };
        let news = robot.here != here;
        if news {
            (robot.here, robot.since) = (here, now);
            robot.health = robot.health.take().filter(|_| here); // of one that comes back it is another
        }
        news
    }

    /// A sample came.
    pub fn force(&mut self, robot: &str, patch: &str, sample: ForceSample, now: Duration) {
        let Some(robot) = self.robot(robot, now) else { return };
        if robot.forces.contains_key(patch) || robot.forces.len() < PATCHES_MAX {
            let delayed = on_the_way(sample.sent.as_ref(), SystemTime::now());
            robot.forces.insert(patch.to_owned(), Told { sample, came: now, delayed });
        } else {
            self.refused += 1;
        }
    }

    /// The health of a robot's daemon came.
    pub fn health(&mut self, robot: &str, health: Health, now: Duration) {
        if let Some(robot) = self.robot(robot, now) {
            robot.health = Some((now, health));
        }
    }

    /// The model sets in use came.
    pub fn models(&mut self, robot: &str, models: Vec<ModelSetSummary>, now: Duration) {
        if let Some(robot) = self.robot(robot, now) {
            robot.models = models;
        }
    }

    /// Robots whose model sets are not known as their samples name them.
    pub fn unknown_models(&self) -> Vec<String> {
        let unknown = |robot: &Robot| {
            let known = |id: &str| id.is_empty() || robot.models.iter().any(|set| set.model_set == id);
            robot.here && robot.forces.values().any(|told| !known(&told.sample.model_set))
        };
        self.robots.iter().filter(|(_, robot)| unknown(robot)).map(|(name, _)| name.clone()).collect()
    }

    /// How many robots are here, and how many were and are not.
    pub fn count(&self) -> (usize, usize) {
        let here = self.robots.values().filter(|robot| robot.here).count();
        (here, self.robots.len() - here)
    }

    /// Everything, robot by robot and patch by patch.
    pub fn rows(&self, now: Duration) -> Vec<Row> {
        let mut rows = Vec::new();
        for (name, robot) in &self.robots {
            if robot.forces.is_empty() {
                rows.push(robot.row(name, "", None, now, self.age_max));
            }
            for (patch, force) in &robot.forces {
                rows.push(robot.row(name, patch, Some(force), now, self.age_max));
            }
        }
        rows
    }
}

/// What does not count now beyond what was without a model from the beginning.
fn lost(sample: &ForceSample, set: &ModelSetSummary) -> u32 {
    (sample.excluded.saturating_add(sample.stale)).saturating_sub(set.taxels.saturating_sub(set.calibrated))
}

/// Whether a zero follows the temperature at all.
fn followed(drift: &Drift) -> bool {
    !matches!(drift.state(), DriftState::Unspecified | DriftState::Off)
}

impl Robot {
    fn row(&self, robot: &str, patch: &str, force: Option<&Told>, now: Duration, age_max: Duration) -> Row {
        let waited = force.map_or(Duration::ZERO, |told| now.saturating_sub(told.came).saturating_add(told.delayed));
        let sample = force.map(|told| &told.sample);
        let (state, reasons) = self.state(sample, waited, age_max);
        let good = sample.filter(|_| state == "OK" || state == "DEGRADED");
        // Nobody knows what has become of the zero of an engine that stands still, or of a daemon that says nothing.
        let is_new = |came: Duration| self.here && now.saturating_sub(came) <= HEALTH_AGE_MAX;
        let known = self.health.iter().filter(|(came, health)| is_new(*came) && health.engine_stalled_s.is_none());
        let zero = known.flat_map(|(_, health)| &health.patches).find(|health| health.patch == patch);
        let zero = zero.and_then(|health| health.tare.as_ref());
        let model_set = sample.map(|sample| sample.model_set.clone()).unwrap_or_default();
        let models = self.models.iter().find(|set| set.model_set == model_set);
        Row {
            robot: robot.to_owned(),
            here: self.here,
            for_s: now.saturating_sub(self.since).as_secs_f64(),
            patch: patch.to_owned(),
            state,
            force_n: good.and_then(|sample| sample.total_n),
            simulated: sample.is_some_and(|sample| sample.simulated),
            sigma_n: good.and_then(|sample| sample.total_sigma_n),
            age_s: sample.and_then(|sample| sample.age_s).map(|age_s| belief::age(age_s, waited).as_secs_f64()),
            excluded: sample.map(|sample| sample.excluded),
            lost: sample.zip(models).map(|(sample, set)| lost(sample, set)),
            zero_valid: zero.map(|zero| zero.valid),
            zero_taken: zero.and_then(|zero| Some(zero.time.as_ref()?.seconds)),
            drift_counts: zero
                .and_then(|zero| zero.drift.as_ref())
                .filter(|drift| followed(drift))
                .map(|d| d.max_counts),
            calibrated: models.and_then(|set| Some(set.created.as_ref()?.seconds)),
            model_set,
            reasons,
        }
    }

    fn state(&self, sample: Option<&ForceSample>, waited: Duration, age_max: Duration) -> (String, Vec<String>) {
        let Some(sample) = sample.filter(|_| self.here) else {
            let state = if self.here { "SILENT" } else { "GONE" };
            return (state.to_owned(), Vec::new());
        };
        let name = sample.state().as_str_name().trim_start_matches("FORCE_STATE_").to_owned();
        match belief::believe(sample, waited, age_max) {
            Ok(_) => (name, sample.reasons.clone()),
            Err(NoForce::State { .. }) if waited <= age_max => (name, sample.reasons.clone()),
            Err(NoForce::TooOld { .. } | NoForce::State { .. }) => {
                ("SILENT".to_owned(), vec![format!("nothing new for {:.1} s", waited.as_secs_f64())])
            }
            Err(why) => ("STALE".to_owned(), vec![why.to_string()]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::tests::good;
    use taxel_proto::Timestamp;
    use taxel_proto::v1::{PatchHealth, TareStatus};

    fn s(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    /// A good force that was sent so many seconds after the robot was switched on.
    fn sent(seconds: f64) -> ForceSample {
        let sample = good();
        let monotonic_ns = Some(((seconds - sample.age_s.unwrap()) * 1e9).round() as i64);
        ForceSample { monotonic_ns, ..sample }
    }

    fn book() -> Book {
        let mut book = Book::new(s(1.0));
        assert!(book.alive("icub", true, s(1.0)));
        book.force("icub", "arm", sent(102.0), s(2.0));
        book
    }

    #[test]
    fn a_robot_is_seen_with_its_force_its_zero_and_its_models() {
        let mut book = book();
        assert_eq!(book.unknown_models(), ["icub"]);
        let created = Some(Timestamp { seconds: 1_600_000_000, nanos: 0 });
        let (model_set, taxels, calibrated) = ("m-1".to_owned(), 230, 229);
        let set =
            ModelSetSummary { model_set, created, taxels, calibrated, active: true, ..ModelSetSummary::default() };
        book.models("icub", vec![set], s(2.0));
        assert!(book.unknown_models().is_empty());
        let time = Some(Timestamp { seconds: 1_700_000_000, nanos: 0 });
        let mut drift = Drift { max_counts: -1.5, ..Drift::default() };
        drift.set_state(DriftState::Following);
        let tare = Some(TareStatus { valid: true, time, drift: Some(drift), ..TareStatus::default() });
        let patches = vec![PatchHealth { patch: "arm".into(), tare, ..PatchHealth::default() }];
        book.health("icub", Health { patches, ..Health::default() }, s(2.0));
        assert_eq!(book.rows(s(2.5)).len(), 1);
        let row = book.rows(s(2.5)).remove(0);
        assert_eq!((row.robot.as_str(), row.patch.as_str(), row.state.as_str(), row.here), ("icub", "arm", "OK", true));
        assert_eq!((row.force_n, row.sigma_n, row.age_s, row.for_s), (Some(4.9), Some(0.5), Some(0.52), 1.5));
        assert_eq!((row.zero_valid, row.zero_taken), (Some(true), Some(1_700_000_000)));
        assert_eq!((row.calibrated, row.model_set.as_str()), (Some(1_600_000_000), "m-1"));
        assert_eq!((row.drift_counts, row.lost), (Some(-1.5), Some(0)));
        assert_eq!([7.0, 7.1].map(|at| book.rows(s(at))[0].zero_valid), [Some(true), None], "a health that is old");
        let patches =
            vec![PatchHealth { patch: "arm".into(), tare: Some(TareStatus::default()), ..Default::default() }];
        book.health("icub", Health { patches, engine_stalled_s: Some(0.2), ..Health::default() }, s(2.0));
        assert_eq!(book.rows(s(2.5))[0].zero_valid, None, "an engine that stands still tells no zero");
        book.force("icub", "arm", ForceSample { excluded: 3, stale: 20, ..sent(102.0) }, s(2.0));
        assert_eq!(book.rows(s(2.5))[0].lost, Some(22), "one had no model from the beginning");
    }

    #[test]
    fn a_robot_that_falls_silent_or_vanishes_has_no_force_any_more() {
        let mut book = book();
        let row = book.rows(s(3.1)).remove(0);
        assert_eq!((row.state.as_str(), row.force_n, row.sigma_n), ("SILENT", None, None));
        assert_eq!(row.reasons, ["nothing new for 1.1 s"]);
        book.force("icub", "arm", sent(103.2), s(3.2));
        assert!(book.alive("icub", false, s(3.3)));
        assert!(!book.alive("icub", false, s(3.4)), "told once");
        let row = book.rows(s(3.5)).remove(0);
        assert_eq!((row.state.as_str(), row.here, row.force_n), ("GONE", false, None));
        assert_eq!(book.count(), (0, 1));
        assert!(book.alive("icub", true, s(4.0)));
        book.force("icub", "arm", sent(104.0), s(4.0));
        assert_eq!(book.rows(s(4.0))[0].force_n, Some(4.9));
    }

    /// What waited at a router, in a queue, or while this machine slept.
    #[test]
    fn a_force_that_was_long_on_its_way_is_as_old_as_it_is() {
        let mut book = book();
        let told = |book: &Book, now: f64| (book.rows(s(now))[0].state.clone(), book.rows(s(now))[0].age_s.unwrap());
        book.force("icub", "arm", sent(102.5), s(3.1));
        let (state, age_s) = told(&book, 3.2);
        assert!(state == "OK" && (0.715..0.725).contains(&age_s), "{state}, {age_s} s");
        book.force("icub", "arm", sent(103.0), s(3_600.0));
        assert_eq!(told(&book, 3_600.0).0, "SILENT");
        book.force("icub", "arm", sent(3_700.1), s(3_600.1));
        assert_eq!(told(&book, 3_600.1).0, "OK");
        // Its clock loses a third of a second in an hour.
        book.force("icub", "arm", sent(7_299.8), s(7_200.1));
        assert_eq!(told(&book, 7_200.1), ("OK".to_owned(), 0.02));
        // It was switched off and on.
        book.force("icub", "arm", sent(30.0), s(7_300.0));
        assert_eq!(told(&book, 7_300.0).0, "OK");
    }

    #[test]
    fn a_robot_that_has_told_nothing_is_listed_all_the_same() {
        let mut book = Book::new(s(1.0));
        book.alive("icub", true, s(0.0));
        let row = book.rows(s(0.5)).remove(0);
        assert_eq!((row.patch.as_str(), row.state.as_str(), row.force_n), ("", "SILENT", None));
    }

    #[test]
    fn more_robots_and_patches_than_a_view_holds_are_counted_and_take_no_memory() {
        let mut book = Book::new(s(1.0));
        for n in 0..PATCHES_MAX + 3 {
            book.force("icub", &n.to_string(), good(), s(0.0));
        }
        assert_eq!((book.rows(s(0.0)).len(), book.refused()), (PATCHES_MAX, 3));
        for n in 0..ROBOTS_MAX + 4 {
            book.alive(&n.to_string(), true, s(0.0));
        }
        assert_eq!((book.count(), book.refused()), ((ROBOTS_MAX - 1, 1), 8));
    }
}
