//! How everything is, for `diagnostic_msgs/msg/DiagnosticArray`: why a patch has no force, and what the daemon says of its
//! buses and boards.

use std::time::Duration;

use taxel_proto::v1::{ForceSample, ForceState, Health, PatchHealth, ReasonCode};

use crate::belief::NoForce;
use crate::ros::types::{DiagnosticStatus, KeyValue};

/// Levels of `diagnostic_msgs/msg/DiagnosticStatus`.
pub const OK: u8 = 0;
/// Works, with shortcomings.
pub const WARN: u8 = 1;
/// Does not work.
pub const ERROR: u8 = 2;
/// Worked until lately.
pub const STALE: u8 = 3;

/// What the bridge knows of a patch at one moment.
#[derive(Clone, Debug)]
pub struct PatchView<'a> {
    /// Its name at the daemon.
    pub patch: &'a str,
    /// Why the stream of its samples does not run; `None` while it runs.
    pub lost: Option<&'a str>,
    /// The newest sample.
    pub sample: Option<&'a ForceSample>,
    /// Its age, or why it is no force.
    pub belief: Result<Duration, NoForce>,
    /// Forces published so far.
    pub published: u64,
    /// Samples that were none.
    pub withheld: u64,
    /// Samples that the bridge did not see because newer ones were there.
    pub skipped: u64,
}

fn value(key: &str, value: impl ToString) -> KeyValue {
    KeyValue { key: key.to_owned(), value: value.to_string() }
}

/// A patch's level and the words for it. It changes only when something about the patch does.
pub fn level(view: &PatchView<'_>) -> (u8, String) {
    if let Some(lost) = view.lost {
        return (ERROR, format!("no force is published: no stream from the daemon: {lost}"));
    }
    let none = |why: &NoForce| format!("no force is published: {why}");
    match (&view.belief, view.sample) {
        (Err(why @ (NoForce::TooOld { .. } | NoForce::State { state: ForceState::Stale, .. })), _) => {
            (STALE, none(why))
        }
        (Err(why), _) => (ERROR, none(why)),
        (Ok(_), Some(sample)) => {
            let mut words = sample.reasons.clone();
            if sample.lower_bound {
                words.push("the force may be higher by any amount".to_owned());
            }
            if sample.resultant_n.is_none() || sample.moment_nm.is_none() {
                words.push(
                    "no wrench: the daemon's scene has no outputs resultant and moment, or no normals".to_owned(),
                );
            }
            match (words.is_empty(), sample.simulated) {
                (true, false) => (OK, "OK".to_owned()),
                (true, true) => (OK, "OK, simulated: no skin is touched".to_owned()),
                (false, _) => (WARN, words.join("; ")),
            }
        }
        (Ok(_), None) => (ERROR, none(&NoForce::Nothing)),
    }
}

/// A patch's force.
pub fn patch(robot: &str, view: &PatchView<'_>) -> DiagnosticStatus {
    let (level, message) = level(view);
    let mut values =
        vec![value("published", view.published), value("withheld", view.withheld), value("skipped", view.skipped)];
    if let Some(sample) = view.sample {
        values.extend([
            value("state", sample.state().as_str_name().trim_start_matches("FORCE_STATE_")),
            value("sequence", sample.sequence),
            value("taxels active", sample.active),
            value("taxels excluded", sample.excluded),
            value("taxels stale", sample.stale),
            value("taxels out of range", sample.out_of_range),
            value("area not covered", format!("{:.1} %", 100.0 * sample.uncovered_share)),
            value("model set", &sample.model_set),
            value("simulated", sample.simulated),
        ]);
        let short = |code: ReasonCode| code.as_str_name().trim_start_matches("REASON_CODE_");
        let codes: Vec<&str> = sample.causes.iter().map(|cause| short(cause.code())).collect();
        if !codes.is_empty() {
            values.push(value("reasons", codes.join(" ")));
        }
    }
    if let Ok(age) = &view.belief {
        values.push(value("age", format!("{:.3} s", age.as_secs_f64())));
    }
    DiagnosticStatus {
        level,
        name: format!("taxel: force of {}", view.patch),
        message,
        hardware_id: robot.into(),
        values,
    }
}

/// What the daemon says of itself, or why it says nothing.
pub fn daemon(robot: &str, health: Result<&Health, &str>) -> Vec<DiagnosticStatus> {
    let status = |level, name: String, message: String, values| DiagnosticStatus {
        level,
        name: format!("taxel: {name}"),
        message,
        hardware_id: robot.to_owned(),
        values,
    };
    let health = match health {
        Err(why) => return vec![status(ERROR, "daemon".into(), format!("no health from it: {why}"), Vec::new())],
        Ok(health) => health,
    };
    let said = |words: &[String]| if words.is_empty() { (OK, "OK".to_owned()) } else { (WARN, words.join("; ")) };
    let mut problems = health.problems.clone();
    problems
        .extend(health.store.as_ref().filter(|store| !store.whole).map(|store| format!("store: {}", store.problem)));
    let (level, message) = said(&problems);
    let mut all = vec![status(level, "daemon".into(), message, vec![value("streams", health.streams)])];
    // What an engine that stands still said last is nothing that is so now.
    let known = |level, name, message, values| match health.engine_stalled_s {
        Some(_) => status(STALE, name, "not known: the daemon's engine does not run".to_owned(), Vec::new()),
        None => status(level, name, message, values),
    };
    for bus in &health.buses {
        let level = if !bus.up {
            ERROR
        } else if bus.dropped + bus.malformed > 0 {
            WARN
        } else {
            OK
        };
        let message = if bus.up { "up".to_owned() } else { format!("down: {}", bus.problem) };
        let counts = [("frames", bus.frames), ("dropped", bus.dropped), ("malformed", bus.malformed)];
        all.push(known(level, format!("bus {}", bus.bus), message, counts.map(|(k, v)| value(k, v)).to_vec()));
    }
    for board in &health.boards {
        let silent = board.modules_enabled.saturating_sub(board.modules_fresh);
        let mut words = board.warnings.clone();
        words.extend((silent > 0).then(|| format!("{silent} modules are silent")));
        let (level, message) = said(&words);
        let name = format!("board {} of {}", board.address, board.patch);
        let mut values = vec![value("bring-up", &board.bring_up), value("scans", board.scans)];
        values.extend(board.celsius.map(|celsius| value("temperature", format!("{celsius:.1} C"))));
        all.push(known(level, name, message, values));
    }
    all.extend(health.patches.iter().map(|patch| {
        let (level, message) = zero(patch);
        known(
            level,
            format!("zero of {}", patch.patch),
            message,
            vec![value("taxels with a fault", patch.faulty.len())],
        )
    }));
    all
}

fn zero(patch: &PatchHealth) -> (u8, String) {
    match &patch.tare {
        Some(tare) if tare.valid => (OK, tare.reason.clone()),
        Some(tare) => (ERROR, format!("not valid: {}", tare.reason)),
        None => (ERROR, "none".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::{believe, tests::good};
    use taxel_proto::v1::{BoardHealth, BusHealth};

    const LIMIT: Duration = Duration::from_millis(150);

    fn view(sample: &ForceSample) -> PatchView<'_> {
        PatchView {
            patch: "arm",
            lost: None,
            sample: Some(sample),
            belief: believe(sample, Duration::ZERO, LIMIT),
            published: 1,
            withheld: 2,
            skipped: 3,
        }
    }

    #[test]
    fn a_patch_without_a_force_says_why() {
        assert_eq!(level(&view(&good())), (OK, "OK".to_owned()));
        let demo = ForceSample { simulated: true, ..good() };
        assert_eq!(level(&view(&demo)), (OK, "OK, simulated: no skin is touched".to_owned()));
        assert!(patch("icub", &view(&demo)).values.contains(&value("simulated", true)));
        let sample = ForceSample {
            state: ForceState::TareInvalid.into(),
            reasons: vec!["a board took a new zero".into()],
            ..good()
        };
        let said = level(&view(&sample));
        assert_eq!(said, (ERROR, "no force is published: TARE_INVALID: a board took a new zero".to_owned()));
        let sample = ForceSample { age_s: Some(3.0), ..good() };
        assert_eq!(level(&view(&sample)).0, STALE);
        let good = good();
        let lost = PatchView { lost: Some("connection refused"), ..view(&good) };
        let (level, message) = level(&lost);
        assert_eq!(level, ERROR);
        assert!(message.contains("connection refused"), "{message}");
    }

    #[test]
    fn a_force_with_shortcomings_is_a_warning_that_names_them() {
        let sample = ForceSample {
            state: ForceState::Degraded.into(),
            reasons: vec!["3 taxels have a fault".into()],
            lower_bound: true,
            resultant_n: None,
            ..good()
        };
        let (level, message) = level(&view(&sample));
        assert_eq!(level, WARN);
        for part in ["3 taxels have a fault", "higher by any amount", "no wrench"] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn the_daemons_health_is_told_part_by_part() {
        let health = Health {
            buses: vec![BusHealth { bus: 0, up: false, problem: "no such device".into(), ..BusHealth::default() }],
            boards: vec![BoardHealth {
                patch: "arm".into(),
                address: 13,
                modules_enabled: 16,
                modules_fresh: 14,
                ..BoardHealth::default()
            }],
            patches: vec![PatchHealth { patch: "arm".into(), ..PatchHealth::default() }],
            ..Health::default()
        };
        let all = daemon("icub", Ok(&health));
        let told: Vec<_> = all.iter().map(|s| (s.name.as_str(), s.level, s.message.as_str())).collect();
        assert_eq!(
            told,
            [
                ("taxel: daemon", OK, "OK"),
                ("taxel: bus 0", ERROR, "down: no such device"),
                ("taxel: board 13 of arm", WARN, "2 modules are silent"),
                ("taxel: zero of arm", ERROR, "none"),
            ]
        );
        let stalled = daemon("icub", Ok(&Health { engine_stalled_s: Some(0.3), ..health }));
        let told: Vec<_> = stalled[1..].iter().map(|s| (s.level, s.message.as_str(), s.values.len())).collect();
        assert_eq!(told, [(STALE, "not known: the daemon's engine does not run", 0); 3]);
        let silent = daemon("icub", Err("connection refused"));
        assert_eq!((silent.len(), silent[0].level), (1, ERROR));
    }
}
