//! How everything is, for `diagnostic_msgs/msg/DiagnosticArray`: why a patch has no force, and what the daemon says of itself.

use taxel_client::{Force, NoForce, troubles};
use taxel_proto::judge::{self, word};
use taxel_proto::v1::{ForceReason, ForceSample, ForceState, Health, ReasonCode};

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
        words.push("no wrench: taxeld.toml has no outputs resultant and moment, or no normals".to_owned());
    }
    match (words.is_empty(), sample.simulated) {
        (true, false) => (OK, "OK".to_owned()),
        (true, true) => (OK, "OK, simulated: no skin is touched".to_owned()),
        (false, _) => (WARN, words.join("; ")),
    }
}

/// A patch's force.
pub fn patch(robot: &str, patch: &str, judged: &Result<Force, NoForce>) -> DiagnosticStatus {
    let (level, message) = level(judged);
    let mut values = Vec::new();
    match judged {
        Ok(Force { sample, age, .. }) => {
            values.extend([
                value("state", word(sample.state())),
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

/// What the daemon says of itself, its buses, boards and zeros, or why it says nothing.
pub fn daemon(robot: &str, health: Result<&Health, &String>) -> DiagnosticStatus {
    let (level, message) = match health.map(troubles) {
        Err(why) => (ERROR, format!("no health from it: {why}")),
        Ok(troubles) if troubles.is_empty() => (OK, "OK".to_owned()),
        Ok(troubles) => (WARN, troubles.join("; ")),
    };
    DiagnosticStatus { level, name: "taxel: daemon".to_owned(), message, hardware_id: robot.to_owned(), values: vec![] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::good;
    use std::time::Duration;
    use taxel_proto::v1::BusHealth;

    fn force(sample: ForceSample) -> Result<Force, NoForce> {
        Ok(Force { total_n: 4.9, age: Duration::from_millis(20), sample })
    }

    #[test]
    fn a_patch_without_a_force_says_why() {
        assert_eq!(level(&force(good())), (OK, "OK".to_owned()));
        let demo = force(ForceSample { simulated: true, ..good() });
        assert_eq!(level(&demo), (OK, "OK, simulated: no skin is touched".to_owned()));
        assert!(patch("icub", "arm", &demo).values.contains(&value("simulated", true)));
        let (reasons, codes) = (vec!["a board took a new zero".to_owned()], vec![ReasonCode::NotUnloaded]);
        let invalid = Err(NoForce::Sample(judge::NoForce::State(ForceState::TareInvalid, reasons, codes)));
        let said = level(&invalid);
        assert_eq!(said, (ERROR, "no force is published: TARE_INVALID: a board took a new zero".to_owned()));
        let values = patch("icub", "arm", &invalid).values;
        assert_eq!(values, [value("state", "TARE_INVALID"), value("reasons", "NOT_UNLOADED")]);
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
    fn the_daemons_health_is_told_with_all_that_is_wrong() {
        let bus = BusHealth { bus: 0, up: false, problem: "no such device".into(), ..BusHealth::default() };
        let all = [
            (Ok(Health::default()), OK, "OK"),
            (Ok(Health { buses: vec![bus], ..Health::default() }), WARN, "bus 0 is down: no such device"),
            (Err("connection refused".to_owned()), ERROR, "no health from it: connection refused"),
        ];
        for (health, level, message) in all {
            let told = daemon("icub", health.as_ref());
            assert_eq!((told.name.as_str(), told.level, told.message.as_str()), ("taxel: daemon", level, message));
        }
    }
}
