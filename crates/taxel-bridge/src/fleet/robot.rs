//! What one robot tells a fleet.
//!
//! Samples go on as the service's own protobuf messages: every field survives (state, reasons, uncertainty), a reader in
//! any language generates them from `proto/`, later fields are compatible, and a sample is a third of its JSON.

use std::time::{Duration, SystemTime};

use prost::Message;
use taxel_client::{Force, Forces, NoForce};
use taxel_proto::judge::{self, withheld};
use taxel_proto::v1::{ForceReason, ForceSample, GetModelSetRequest, ModelSetSummary, ReasonCode};
use tokio::time::{Interval, MissedTickBehavior, interval};
use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;

use crate::daemon::{Daemon, HealthFeed, answered};
use crate::fleet::keys::{Told, key};
use crate::link::tried;

/// A model set goes out so often, for whoever begins to listen.
const MODEL_EVERY: Duration = Duration::from_secs(1);
/// The daemon is asked for it each time that so many of these have passed.
const MODEL_ASKED_EVERY: u64 = 10;

/// Tells a patch's force at a rate, also that there is none.
///
/// # Errors
/// If the session is closed.
pub async fn force(session: Session, robot: String, patch: String, forces: Forces, rate_hz: f64) -> anyhow::Result<()> {
    let publisher = publisher(&session, &robot, Told::Force(&patch), "taxel.v1.ForceSample").await?;
    let mut ticks = ticks(Duration::from_secs_f64(1.0 / rate_hz));
    loop {
        ticks.tick().await;
        let sample = passed_on(&patch, forces.force());
        tried("a force", publisher.put(sample.encode_to_vec()).await)?;
    }
}

/// Tells which model set a patch uses.
///
/// # Errors
/// If the session is closed.
pub async fn model(session: Session, robot: String, patch: String, daemon: Daemon) -> anyhow::Result<()> {
    let publisher = publisher(&session, &robot, Told::Model(&patch), "taxel.v1.ModelSetSummary").await?;
    let (mut ticks, mut count, mut model) = (ticks(MODEL_EVERY), 0, None);
    loop {
        ticks.tick().await;
        if count % MODEL_ASKED_EVERY == 0 {
            model = in_use(&daemon, &patch).await;
        }
        count += 1;
        if let Some(model) = &model {
            tried("a model set", publisher.put(model.encode_to_vec()).await)?;
        }
    }
}

/// The model set in use; `None` without one, or if the daemon does not answer.
async fn in_use(daemon: &Daemon, patch: &str) -> Option<ModelSetSummary> {
    let request = GetModelSetRequest { patch: patch.to_owned(), ..GetModelSetRequest::default() };
    answered(daemon.models().get_model_set(request)).await.ok()?.summary
}

/// Tells the daemon's health when it has been asked. A daemon that does not answer has none; its forces say so.
///
/// # Errors
/// If the session is closed.
pub async fn health(session: Session, robot: String, mut health: HealthFeed) -> anyhow::Result<()> {
    let publisher = publisher(&session, &robot, Told::Health, "taxel.v1.Health").await?;
    loop {
        health.changed().await?;
        let bytes = health.borrow_and_update().as_ref().ok().map(Message::encode_to_vec);
        if let Some(bytes) = bytes {
            tried("the health", publisher.put(bytes).await)?;
        }
    }
}

/// A publisher that waits for no reader.
async fn publisher(session: &Session, robot: &str, told: Told<'_>, schema: &str) -> anyhow::Result<Publisher<'static>> {
    let publisher = session.declare_publisher(key(robot, told)).congestion_control(CongestionControl::Drop);
    tried("a publisher", publisher.encoding(Encoding::APPLICATION_PROTOBUF.with_schema(schema)).await)
}

/// What was missed is not made up for: the value of a tick that is long past is an old one.
fn ticks(period: Duration) -> Interval {
    let mut ticks = interval(period);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    ticks
}

/// The sample as it goes on now, with its age by now: without any figure of the force where there is none.
fn passed_on(patch: &str, judged: Result<Force, NoForce>) -> ForceSample {
    let now = Some(SystemTime::now().into());
    let nothing = ForceSample { patch: patch.to_owned(), sent: now, ..ForceSample::default() };
    match judged {
        Ok(Force { age, sample, .. }) => ForceSample { age_s: Some(age.as_secs_f64()), sent: now, ..sample },
        Err(NoForce::Sample(judge::NoForce::State(state, reasons, codes))) => {
            let causes = codes.into_iter().map(|code| ForceReason { code: code.into(), ..ForceReason::default() });
            let none = withheld(&nothing, ReasonCode::Unspecified, String::new());
            ForceSample { state: state.into(), reasons, causes: causes.collect(), ..none }
        }
        Err(NoForce::Sample(why)) => withheld(&nothing, why.code(), why.to_string()),
        Err(why) => withheld(&nothing, ReasonCode::NoStream, format!("no stream from the daemon: {why}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::v1::ForceState;

    #[test]
    fn what_goes_on_carries_its_age_by_now() {
        let sample = ForceSample { age_s: Some(0.02), total_n: Some(4.9), ..ForceSample::default() };
        let sent = passed_on("arm", Ok(Force { total_n: 4.9, age: Duration::from_millis(50), sample }));
        assert_eq!((sent.age_s, sent.total_n), (Some(0.05), Some(4.9)));
    }

    #[test]
    fn where_there_is_no_force_the_state_and_the_reason_go_on_without_a_figure() {
        let ms = Duration::from_millis;
        let sample = NoForce::Sample;
        let tare =
            judge::NoForce::State(ForceState::TareInvalid, vec!["no rest".into()], vec![ReasonCode::RestNotProven]);
        let cases = [
            (sample(tare), ForceState::TareInvalid, ReasonCode::RestNotProven, "no rest"),
            (sample(judge::NoForce::TooOld(ms(520), ms(150))), ForceState::Stale, ReasonCode::FrameOld, "520 ms old"),
            (NoForce::Lost("refused".into()), ForceState::Stale, ReasonCode::NoStream, "no stream from the daemon"),
            (NoForce::NothingYet(None), ForceState::Stale, ReasonCode::NoStream, "no sample yet"),
        ];
        for (why, state, code, words) in cases {
            let sent = passed_on("arm", Err(why));
            assert_eq!((sent.patch.as_str(), sent.state(), sent.total_n), ("arm", state, None));
            assert_eq!(sent.causes[0].code(), code);
            assert!(sent.reasons[0].contains(words), "{:?}", sent.reasons);
        }
    }
}
