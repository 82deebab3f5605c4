//! `grpc.health.v1`: whether each service can do what it is for.

use std::convert::Infallible;
use std::future::pending;
use std::time::Duration;
use taxel_engine::snapshot::ForceState;
use taxel_proto::v1::calibration_service_server::SERVICE_NAME as CALIBRATION;
use taxel_proto::v1::force_service_server::SERVICE_NAME as FORCE;
use taxel_proto::v1::model_service_server::SERVICE_NAME as MODEL;
use taxel_proto::v1::skin_service_server::SERVICE_NAME as SKIN;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

use crate::handle::Handle;

/// A health check is for supervisors, which look every few seconds; streams carry every change at once.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The services, the whole server under the empty name.
const SERVICES: [&str; 5] = ["", FORCE, SKIN, CALIBRATION, MODEL];

/// Keeps the reporter in step with the engine until the shutdown, then says so and ends every health stream, which
/// would hold the server open otherwise.
pub(crate) async fn report(handle: Handle, mut reporter: HealthReporter) -> Infallible {
    let mut shown = [None; SERVICES.len()];
    let mut looks = tokio::time::interval(LOOK_EVERY);
    looks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        tokio::select! {
            () = handle.shutdown.cancelled() => break,
            _ = looks.tick() => show(&reporter, &mut shown, serving(&handle)).await,
        }
    }
    show(&reporter, &mut shown, [false; SERVICES.len()]).await;
    for service in SERVICES {
        reporter.clear_service_status(service).await;
    }
    pending().await
}

async fn show(reporter: &HealthReporter, shown: &mut [Option<bool>], serving: [bool; SERVICES.len()]) {
    for ((service, shown), serving) in SERVICES.iter().zip(shown).zip(serving) {
        if *shown != Some(serving) {
            let status = if serving { ServingStatus::Serving } else { ServingStatus::NotServing };
            reporter.set_service_status(service, status).await;
            *shown = Some(serving);
        }
    }
}

/// Whether each of [`SERVICES`] can do what it is for.
fn serving(handle: &Handle) -> [bool; SERVICES.len()] {
    let engine = handle.health.has_changed().is_ok();
    let buses = engine && handle.health.borrow().buses.iter().all(|bus| bus.up);
    let force = engine && handle.patches.iter().all(|feed| feed.snapshot.borrow().force.state <= ForceState::Degraded);
    [engine, force, buses, buses, engine]
}
