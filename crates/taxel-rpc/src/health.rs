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

/// What was reported last, in the order of [`SERVICES`].
pub(crate) struct Report {
    handle: Handle,
    reporter: HealthReporter,
    shown: [Option<bool>; SERVICES.len()],
}

impl Report {
    /// The first report, due before the first client can ask.
    pub(crate) async fn begin(handle: Handle, reporter: HealthReporter) -> Self {
        let present = serving(&handle);
        let mut report = Self { handle, reporter, shown: [None; SERVICES.len()] };
        report.show(present).await;
        report
    }

    /// Keeps the report in step with the engine until the shutdown, then says so and ends every health stream, which
    /// would hold the server open otherwise.
    pub(crate) async fn keep(mut self) -> Infallible {
        let shutdown = self.handle.shutdown.clone();
        let mut looks = tokio::time::interval(LOOK_EVERY);
        looks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
        loop {
            tokio::select! {
                () = shutdown.cancelled() => break,
                _ = looks.tick() => self.show(serving(&self.handle)).await,
            }
        }
        self.show([false; SERVICES.len()]).await;
        for service in SERVICES {
            self.reporter.clear_service_status(service).await;
        }
        pending().await
    }

    async fn show(&mut self, serving: [bool; SERVICES.len()]) {
        for ((service, shown), serving) in SERVICES.iter().zip(&mut self.shown).zip(serving) {
            if *shown != Some(serving) {
                let status = if serving { ServingStatus::Serving } else { ServingStatus::NotServing };
                self.reporter.set_service_status(service, status).await;
                *shown = Some(serving);
            }
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
