//! What one robot tells a fleet.
//!
//! | key | what | how often |
//! |---|---|---|
//! | `taxel/ROBOT/force/PATCH` | `taxel.v1.ForceSample` | at the configured rate, also where there is no force |
//! | `taxel/ROBOT/health` | `taxel.v1.Health` | once a second, while the daemon answers |
//!
//! Samples go on as the service's own protobuf messages: every field survives (state, reasons, uncertainty), a reader in
//! any language generates them from `proto/`, later fields are compatible, and a sample is a third of its JSON.

use std::time::{Duration, SystemTime};

use prost::Message;
use taxel_client::{Forces, Moment, Received};
use taxel_proto::v1::ForceSample;
use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;

use crate::daemon::Daemon;
use crate::link::tried;
use crate::ticks;

/// How often the daemon is asked for its health.
const HEALTH_EVERY: Duration = Duration::from_secs(1);

/// The forces of every robot.
pub const FORCES: &str = "taxel/*/force/*";

/// The key of a patch's force.
fn force_key(robot: &str, patch: &str) -> String {
    format!("taxel/{robot}/force/{patch}")
}

/// The key of a daemon's health.
fn health_key(robot: &str) -> String {
    format!("taxel/{robot}/health")
}

/// The robot and the patch of the key of a force.
pub fn robot_and_patch(key: &str) -> Option<(&str, &str)> {
    key.strip_prefix("taxel/")?.split_once("/force/")
}

/// Tells a patch's newest sample at a rate, also where it is no force any more.
///
/// # Errors
/// If the session is closed.
pub async fn force(session: Session, robot: String, patch: String, forces: Forces, rate_hz: f64) -> anyhow::Result<()> {
    let publisher = publisher(&session, force_key(&robot, &patch), "taxel.v1.ForceSample").await?;
    let mut due = ticks(Duration::from_secs_f64(1.0 / rate_hz));
    loop {
        due.tick().await;
        if let Some(received) = forces.newest() {
            let sample = passed_on(&received, Moment::now());
            tried("a force", publisher.put(sample.encode_to_vec()).await)?;
        }
    }
}

/// Tells the daemon's health once a second. A daemon that does not answer has none; its forces say so.
///
/// # Errors
/// If the session is closed.
pub async fn health(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let publisher = publisher(&session, health_key(&robot), "taxel.v1.Health").await?;
    let mut due = ticks(HEALTH_EVERY);
    loop {
        due.tick().await;
        if let Ok(health) = daemon.health().await {
            tried("the health", publisher.put(health.encode_to_vec()).await)?;
        }
    }
}

/// A publisher that waits for no reader.
async fn publisher(session: &Session, key: String, schema: &str) -> anyhow::Result<Publisher<'static>> {
    let publisher = session.declare_publisher(key).congestion_control(CongestionControl::Drop);
    tried("a publisher", publisher.encoding(Encoding::APPLICATION_PROTOBUF.with_schema(schema)).await)
}

/// The sample as it goes on now.
fn passed_on(received: &Received, now: Moment) -> ForceSample {
    ForceSample { sent: Some(SystemTime::now().into()), ..received.told(now) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::v1::{ForceState, ReasonCode};

    #[test]
    fn a_sample_goes_on_with_its_age_by_now_and_without_a_figure_once_it_is_too_old() {
        let received = Received::now(ForceSample {
            state: ForceState::Ok.into(),
            total_n: Some(4.9),
            age_s: Some(0.02),
            max_age_s: 0.15,
            model_set: "m-1".into(),
            simulated: true,
            sent: Some(SystemTime::now().into()),
            ..ForceSample::default()
        });
        let soon = passed_on(&received, Moment::now() + Duration::from_millis(50));
        assert!(soon.total_n == Some(4.9) && soon.age_s >= Some(0.07), "{soon:?}");
        let late = passed_on(&received, Moment::now() + Duration::from_millis(500));
        assert_eq!(
            (late.state(), late.total_n, late.causes[0].code()),
            (ForceState::Stale, None, ReasonCode::FrameOld)
        );
        assert_eq!((late.max_age_s, late.model_set.as_str(), late.simulated), (0.15, "m-1", true));
    }

    #[test]
    fn a_key_says_whose_force_it_is() {
        assert_eq!(robot_and_patch(&force_key("icub01", "arm")), Some(("icub01", "arm")));
        for other in ["", "taxel", "taxel/r", "other/r/force/arm", &health_key("icub01")] {
            assert_eq!(robot_and_patch(other), None, "{other}");
        }
    }
}
