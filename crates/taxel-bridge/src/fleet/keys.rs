//! Where a robot of a fleet lies in Zenoh.
//!
//! | key | what | how often |
//! |---|---|---|
//! | `taxel/ROBOT/force/PATCH` | `taxel.v1.ForceSample` | at the configured rate, also where there is no force |
//! | `taxel/ROBOT/health` | `taxel.v1.Health` | once a second, while the daemon answers |

/// The forces of every robot.
pub const FORCES: &str = "taxel/*/force/*";

/// The key of a patch's force.
pub fn force(robot: &str, patch: &str) -> String {
    format!("taxel/{robot}/force/{patch}")
}

/// The key of a daemon's health.
pub fn health(robot: &str) -> String {
    format!("taxel/{robot}/health")
}

/// The robot and the patch of the key of a force.
pub fn split(key: &str) -> Option<(&str, &str)> {
    key.strip_prefix("taxel/")?.split_once("/force/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_says_whose_force_it_is() {
        assert_eq!(split(&force("icub01", "arm")), Some(("icub01", "arm")));
        for other in ["", "taxel", "taxel/r", "other/r/force/arm", &health("icub01")] {
            assert_eq!(split(other), None, "{other}");
        }
    }
}
