//! How everything is, for `diagnostic_msgs/msg/DiagnosticArray`: why a patch has no force, and what the daemon says of its
//! buses and boards.

use taxel_client::{Force, NoForce};
use taxel_proto::judge::{self, word};
use taxel_proto::v1::{ForceReason, ForceSample, ForceState, Health, PatchHealth, ReasonCode};
use taxel_skin::counted;

use crate::ros::types::{DiagnosticStatus, KeyValue};

/// Levels of `diagnostic_msgs/msg/DiagnosticStatus`.
pub const OK: u8 = 0;
/// Works, with shortcomings.
pub const WARN: u8 = 1;
/// Does not work.
pub const ERROR: u8 = 2;
/// Worked until lately.
pub const STALE: u8 = 3;

fn value(key: &str, value: impl ToString) -> KeyValue {
    (key.to_owned(), value.to_string())
}

/// A patch's level and the words for it. It changes only when something about the patch does.
fn level(judged: &Result<Force, NoForce>) -> (u8, String) {
    match judged {
        Ok(force) => of_force(&force.sample),
        Err(why) => {
            let is_old = matches!(
                why,
                NoForce::Sample(judge::NoForce::TooOld(..) | judge::NoForce::State(ForceState::Stale, ..))
            );
            (if is_old { STALE } else { ERROR }, format!("no force is published: {why}"))
        }
    }
}

fn of_force(sample: &ForceSample) -> (u8, String) {
    let mut words = sample.reasons.clone();
    if sample.high_n.is_none() {
        words.push("nothing bounds the force above".to_owned());
    }
    if sample.resultant_n.is_none() || sample.moment_nm.is_none() {
        words.push(
            "no wrench: the daemon's configuration has no outputs resultant and moment, or no normals".to_owned(),
        );
    }
    match (words.is_empty(), sample.simulated) {
        (true, false) => (OK, "OK".to_owned()),
        (true, true) => (OK, "OK, simulated: no skin is touched".to_owned()),
        (false, _) => (WARN, words.join("; ")),
    }
}

/// A patch's force, of which so many samples were published.
pub fn patch(robot: &str, patch: &str, judged: &Result<Force, NoForce>, published: u64) -> DiagnosticStatus {
    let (level, message) = level(judged);
    let mut values = vec![value("published", published)];
    match judged {
        Ok(Force { sample, age, .. }) => {
            values.extend([
                value("state", word(sample.state())),
                value("sequence", sample.sequence),
                value("taxels active", sample.active),
                value("taxels excluded", sample.excluded),
                value("taxels stale", sample.stale),
                value("taxels out of range", sample.out_of_range),
                value("model set", &sample.model_set),
                value("simulated", sample.simulated),
                value("age", format!("{:.3} s", age.as_secs_f64())),
            ]);
            values.extend(reasons(sample.causes.iter().map(ForceReason::code)));
        }
        Err(NoForce::Sample(judge::NoForce::State(state, _, codes))) => {
            values.push(value("state", word(*state)));
            values.extend(reasons(codes.iter().copied()));
        }
        Err(_) => {}
    }
    DiagnosticStatus { level, name: format!("taxel: force of {patch}"), message, hardware_id: robot.into(), values }
}

/// Why the state is not OK, for programs.
fn reasons(codes: impl Iterator<Item = ReasonCode>) -> Option<KeyValue> {
    let codes: Vec<_> = codes.map(|code| code.as_str_name().trim_start_matches("REASON_CODE_")).collect();
    (!codes.is_empty()).then(|| value("reasons", codes.join(" ")))
}

/// What the daemon says of itself, or why it says nothing.
pub fn daemon(robot: &str, health: Result<&Health, &String>) -> Vec<DiagnosticStatus> {
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
    problems.extend(
        health
            .store
            .as_ref()
            .filter(|store| !(store.problem.is_empty() && store.damage.is_empty()))
            .map(|store| format!("store: {}", store.problem)),
    );
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
        words.extend((silent > 0).then(|| counted(silent as usize, "module is silent", "modules are silent")));
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
    use crate::ros::good;
    use std::time::Duration;
    use taxel_proto::v1::{BoardHealth, BusHealth};

    fn force(sample: ForceSample) -> Result<Force, NoForce> {
        Ok(Force { total_n: 4.9, age: Duration::from_millis(20), sample })
    }

    #[test]
    fn a_patch_without_a_force_says_why() {
        assert_eq!(level(&force(good())), (OK, "OK".to_owned()));
        let demo = force(ForceSample { simulated: true, ..good() });
        assert_eq!(level(&demo), (OK, "OK, simulated: no skin is touched".to_owned()));
        assert!(patch("icub", "arm", &demo, 1).values.contains(&value("simulated", true)));
        let (reasons, codes) = (vec!["a board took a new zero".to_owned()], vec![ReasonCode::NotUnloaded]);
        let invalid = Err(NoForce::Sample(judge::NoForce::State(ForceState::TareInvalid, reasons, codes)));
        let said = level(&invalid);
        assert_eq!(said, (ERROR, "no force is published: TARE_INVALID: a board took a new zero".to_owned()));
        let values = patch("icub", "arm", &invalid, 1).values;
        assert_eq!(values[1..], [value("state", "TARE_INVALID"), value("reasons", "NOT_UNLOADED")]);
        assert_eq!(
            level(&Err(NoForce::Sample(judge::NoForce::TooOld(Duration::from_secs(3), Duration::from_millis(150))))).0,
            STALE
        );
        let (level, message) = level(&Err(NoForce::Lost("connection refused".to_owned())));
        assert_eq!(level, ERROR);
        assert!(message.contains("connection refused"), "{message}");
    }

    #[test]
    fn a_force_with_shortcomings_is_a_warning_that_names_them() {
        let sample = ForceSample {
            state: ForceState::Degraded.into(),
            reasons: vec!["3 taxels have a fault".into()],
            high_n: None,
            resultant_n: None,
            ..good()
        };
        let (level, message) = level(&force(sample));
        assert_eq!(level, WARN);
        for part in ["3 taxels have a fault", "nothing bounds", "no wrench"] {
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
        let silent = daemon("icub", Err(&"connection refused".to_owned()));
        assert_eq!((silent.len(), silent[0].level), (1, ERROR));
    }
}
