//! ROS 2 as `rmw_zenoh` speaks it, without ROS.

pub mod attachment;
pub mod cdr;
pub mod diagnostics;
pub mod keys;
pub mod messages;
pub mod node;
pub mod publish;
pub mod tare;
pub mod types;

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
