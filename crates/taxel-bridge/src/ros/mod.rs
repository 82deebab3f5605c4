//! Topics and services of ROS 2, without ROS.

pub mod diagnostics;
pub mod messages;
pub mod node;
pub mod publish;
pub mod tare;
pub mod types;
pub mod zenoh;

/// What the node is called. Two bridges differ by their namespaces.
const NODE: &str = "taxel_bridge";

/// A patch's name as ROS takes it: what it does not take becomes an underscore, and no digit is first.
pub fn name_of(patch: &str) -> String {
    let taken = patch.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
    if taken.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') { taken } else { format!("_{taken}") }
}

/// A good sample of 4.9 N.
#[cfg(test)]
fn good() -> taxel_proto::v1::ForceSample {
    use taxel_proto::v1::{ForceSample, ForceState, Vector3};
    let vector = |x, y, z| Some(Vector3 { x, y, z });
    ForceSample {
        sequence: 7,
        state: ForceState::Ok.into(),
        total_n: Some(4.9),
        total_sigma_n: Some(0.5),
        low_n: Some(3.9),
        high_n: Some(6.1),
        age_s: Some(0.02),
        max_age_s: 0.15,
        monotonic_ns: Some(1),
        time: Some(taxel_proto::Timestamp { seconds: 1_700_000_000, nanos: 5 }),
        resultant_n: vector(1.0, -2.0, 3.0),
        moment_nm: vector(0.1, 0.2, 0.3),
        centre_of_pressure_m: vector(0.01, 0.02, 0.03),
        patch: "left_forearm".into(),
        model_set: "m-1".into(),
        ..ForceSample::default()
    }
}

#[test]
fn a_patch_has_a_name_that_ros_takes() {
    for (patch, name) in [("left_forearm", "left_forearm"), ("l-arm 2", "l_arm_2"), ("2nd", "_2nd"), ("", "_")] {
        assert_eq!(name_of(patch), name);
        assert!(ros2_client::Name::parse(name).is_ok());
    }
}
