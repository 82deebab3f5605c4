//! Where a robot of a fleet lies in Zenoh.
//!
//! | key | what | how often |
//! |---|---|---|
//! | `taxel/ROBOT/force/PATCH` | `taxel.v1.ForceSample` | at the configured rate, also where there is no force |
//! | `taxel/ROBOT/health` | `taxel.v1.Health` | once a second, while the daemon answers |

/// Every robot's keys.
pub const ALL: &str = "taxel/**";

/// What a key holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told<'a> {
    /// A patch's force.
    Force(&'a str),
    /// The daemon's health.
    Health,
}

/// The key of something that a robot tells.
pub fn key(robot: &str, told: Told<'_>) -> String {
    match told {
        Told::Force(patch) => format!("taxel/{robot}/force/{patch}"),
        Told::Health => format!("taxel/{robot}/health"),
    }
}

/// Whose key it is, and what it holds; `None` for any other.
pub fn split(key: &str) -> Option<(&str, Told<'_>)> {
    let (robot, rest) = key.strip_prefix("taxel/")?.split_once('/')?;
    let told = match rest.split_once('/') {
        Some(("force", patch)) => Told::Force(patch),
        None if rest == "health" => Told::Health,
        _ => return None,
    };
    Some((robot, told))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_says_whose_it_is_and_what_it_holds() {
        for told in [Told::Force("arm"), Told::Health] {
            assert_eq!(split(&key("icub01", told)), Some(("icub01", told)));
        }
        for other in ["", "taxel", "taxel/r", "other/r/health", "taxels/r/health", "taxel/r/health/x", "taxel/r/x/arm"]
        {
            assert_eq!(split(other), None, "{other}");
        }
    }
}
