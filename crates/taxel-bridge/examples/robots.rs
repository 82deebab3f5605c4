//! A load generator: robots that tell a router their force as bridges do, each with a session of its own.
//!
//! `cargo run --release -p taxel-bridge --example robots -- ENDPOINT ROBOTS RATE_HZ SECONDS`

use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_bridge::config::ZenohSection;
use taxel_bridge::fleet::robot::{self, ForceKey};
use taxel_bridge::link;
use taxel_proto::v1::{ForceSample, ForceState, Vector3};

/// A sample with everything that a scene can ask for but contacts.
fn sample(sequence: u64) -> ForceSample {
    let vector = |x, y, z| Some(Vector3 { x, y, z });
    ForceSample {
        sequence,
        state: ForceState::Degraded.into(),
        total_n: Some(4.9 + (sequence % 10) as f64 * 0.01),
        total_sigma_n: Some(0.2),
        age_s: Some(0.012),
        monotonic_ns: Some(1_000_000_000),
        time: Some(taxel_proto::Timestamp { seconds: 1_700_000_000, nanos: 0 }),
        active: 14,
        excluded: 11,
        uncovered_share: 0.02,
        model_set: "m-0123456789abcdef".into(),
        reasons: vec!["2 taxels are beyond their calibrated range".into()],
        patch: "left_forearm".into(),
        resultant_n: vector(0.1, -0.2, 4.8),
        moment_nm: vector(0.01, 0.02, 0.03),
        centre_of_pressure_m: vector(0.05, 0.01, 0.03),
        detection_floor_n: Some(0.3),
        ..ForceSample::default()
    }
}

async fn one(section: ZenohSection, name: String, rate_hz: f64, until: Instant) -> anyhow::Result<u64> {
    let session = link::open(&section).await?;
    let _alive = robot::announce(&session, &name).await?;
    let key = ForceKey::declare(&session, &name, "left_forearm").await?;
    let mut tick = tokio::time::interval(Duration::from_secs_f64(1.0 / rate_hz));
    let mut sent = 0;
    while Instant::now() < until {
        tick.tick().await;
        sent += 1;
        key.send(&sample(sent)).await?;
    }
    Ok(sent)
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let arguments: Vec<_> = std::env::args().collect();
    let [_, endpoint, robots, rate_hz, seconds] = &arguments[..] else {
        anyhow::bail!("expected ENDPOINT ROBOTS RATE_HZ SECONDS");
    };
    let robots: usize = robots.parse().context("ROBOTS")?;
    let rate_hz: f64 = rate_hz.parse().context("RATE_HZ")?;
    let until = Instant::now() + Duration::from_secs_f64(seconds.parse().context("SECONDS")?);
    let section = ZenohSection { router: Some(endpoint.clone()), config: None };
    let mut tasks = tokio::task::JoinSet::new();
    for robot in 0..robots {
        tasks.spawn(one(section.clone(), format!("robot{robot}"), rate_hz, until));
        // Robots do not start at the same moment.
        tokio::time::sleep(Duration::from_secs_f64(1.0 / rate_hz / robots as f64)).await;
    }
    let mut sent = 0;
    while let Some(robot) = tasks.join_next().await {
        sent += robot??;
    }
    println!("{sent}");
    Ok(())
}
