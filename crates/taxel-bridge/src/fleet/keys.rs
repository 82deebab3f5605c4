//! Where a robot of a fleet lies in Zenoh.
//!
//! | key | what | how |
//! |---|---|---|
//! | `taxel/ROBOT/alive` | a liveliness token while the bridge runs | liveliness |
//! | `taxel/ROBOT/force/PATCH` | `taxel.v1.ForceSample` at the configured rate | published |
//! | `taxel/ROBOT/health` | `taxel.v1.Health` once a second, while the daemon answers | published |
//! | `taxel/ROBOT/models` | `taxel.v1.ListModelSetsResponse` with the sets in use | asked for |
//! | `taxel/ROBOT/events` | `taxel.v1.ListEventsResponse` | asked for |
//! | `taxel/ROBOT/import` | takes `taxel.v1.ImportModelSetRequest`, where the robot's configuration allows it | asked for |

/// Before all keys.
const ROOT: &str = "taxel";

/// Every robot's token.
pub const ALL_ALIVE: &str = "taxel/*/alive";
/// Every robot's forces.
pub const ALL_FORCES: &str = "taxel/*/force/*";
/// Every robot's health.
pub const ALL_HEALTH: &str = "taxel/*/health";

/// A robot's token.
pub fn alive(robot: &str) -> String {
    format!("{ROOT}/{robot}/alive")
}

/// A patch's force.
pub fn force(robot: &str, patch: &str) -> String {
    format!("{ROOT}/{robot}/force/{patch}")
}

/// A robot's health.
pub fn health(robot: &str) -> String {
    format!("{ROOT}/{robot}/health")
}

/// The model sets in use.
pub fn models(robot: &str) -> String {
    format!("{ROOT}/{robot}/models")
}

/// What happened lately.
pub fn events(robot: &str) -> String {
    format!("{ROOT}/{robot}/events")
}

/// Takes a model set.
pub fn import(robot: &str) -> String {
    format!("{ROOT}/{robot}/import")
}

/// Whose key it is, and what follows behind the robot's name.
pub fn split(key: &str) -> Option<(&str, &str)> {
    key.strip_prefix(ROOT)?.strip_prefix('/')?.split_once('/')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_tells_whose_it_is() {
        assert_eq!(split(&alive("icub01")), Some(("icub01", "alive")));
        assert_eq!(split(&force("icub01", "arm")), Some(("icub01", "force/arm")));
        assert_eq!(split(&health("r")), Some(("r", "health")));
        assert_eq!(split(&models("r")), Some(("r", "models")));
        let asked = [events("r"), import("r")];
        assert_eq!(asked, ["taxel/r/events", "taxel/r/import"]);
        for key in ["", "taxel", "taxel/r", "other/r/alive", "taxels/r/alive"] {
            assert_eq!(split(key), None, "{key}");
        }
    }
}
