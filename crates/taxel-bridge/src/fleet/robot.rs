//! What one robot tells a fleet unasked.
//!
//! Samples go on as the service's own protobuf messages: every field survives (state, reasons, uncertainty), a reader in
//! any language generates them from `proto/`, later fields are compatible, and a sample is a third of its JSON.

use std::time::Duration;

use prost::Message;
use taxel_proto::judge::withheld;
use taxel_proto::v1::{ForceSample, ReasonCode};
use taxel_ticks::Ticks;
use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;

use crate::belief::passed_on;
use crate::feed::{Feed, HealthFeed};
use crate::fleet::keys;
use crate::link::tried;

/// The schema behind a protobuf payload.
const FORCE: &str = "taxel.v1.ForceSample";
const HEALTH: &str = "taxel.v1.Health";

/// How a payload says what it is.
pub(super) fn protobuf(schema: &str) -> Encoding {
    Encoding::APPLICATION_PROTOBUF.with_schema(schema)
}

/// Announces a robot; it is there until the token is dropped.
///
/// # Errors
/// If the session is closed.
pub async fn announce(session: &Session, robot: &str) -> anyhow::Result<LivelinessToken> {
    tried("announcing the robot", session.liveliness().declare_token(keys::alive(robot)).await)
}

async fn publisher(session: &Session, key: String, schema: &str) -> anyhow::Result<Publisher<'static>> {
    let publisher = session.declare_publisher(key).congestion_control(CongestionControl::Drop);
    tried("a publisher", publisher.encoding(protobuf(schema)).await)
}

/// Where one patch's force goes out.
pub struct ForceKey(Publisher<'static>);

impl ForceKey {
    /// Declares it.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn declare(session: &Session, robot: &str, patch: &str) -> anyhow::Result<Self> {
        Ok(Self(publisher(session, keys::force(robot, patch), FORCE).await?))
    }

    /// Sends a sample; waits for no reader.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn send(&self, sample: &ForceSample) -> anyhow::Result<()> {
        tried("a force", self.0.put(sample.encode_to_vec()).await)
    }
}

/// The patch's newest sample as it may go on now.
fn now(feed: &Feed) -> ForceSample {
    let newest = feed.force.borrow();
    let nothing = ForceSample { patch: feed.section.name.clone(), ..ForceSample::default() };
    match (&newest.received, &newest.lost) {
        (Some(received), None) => passed_on(&received.sample, received.waited()),
        (received, lost) => {
            let reason = lost.as_deref().unwrap_or("no sample has come yet");
            let last = received.as_ref().map_or(&nothing, |received| &received.sample);
            withheld(last, ReasonCode::NoStream, format!("no stream from the daemon: {reason}"))
        }
    }
}

/// Tells a patch's force at a rate, also that there is none.
///
/// # Errors
/// If the session is closed, or the system has no timer.
pub async fn force(session: Session, robot: String, feed: Feed, rate_hz: f64) -> anyhow::Result<()> {
    let key = ForceKey::declare(&session, &robot, &feed.section.name).await?;
    let mut ticks = Ticks::every(Duration::from_secs_f64(1.0 / rate_hz))?;
    loop {
        ticks.tick().await?;
        let sample = now(&feed);
        key.send(&sample).await?;
    }
}

/// Tells the daemon's health when it has been asked. A daemon that does not answer has none; its forces say so.
///
/// # Errors
/// If the session is closed.
pub async fn health(session: Session, robot: String, mut health: HealthFeed) -> anyhow::Result<()> {
    let publisher = publisher(&session, keys::health(&robot), HEALTH).await?;
    loop {
        health.changed().await?;
        let bytes = health.borrow_and_update().as_ref().ok().map(Message::encode_to_vec);
        if let Some(bytes) = bytes {
            tried("the health", publisher.put(bytes).await)?;
        }
    }
}
