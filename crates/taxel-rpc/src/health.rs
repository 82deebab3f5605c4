//! `grpc.health.v1`: whether each service can do what it is for, by a look every few milliseconds.

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

use crate::freshness::not_run_for;
use crate::handle::{Handle, PatchFeed};

/// By so much at most the report is late. A look takes microseconds.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// The store, which is no service of its own.
const STORE: &str = "taxel.store";

/// The services, the whole server under the empty name.
const SERVICES: [&str; 6] = ["", FORCE, SKIN, CALIBRATION, MODEL, STORE];

/// What was reported last, in the order of [`SERVICES`].
pub(crate) struct Report {
    handle: Handle,
    reporter: HealthReporter,
    shown: [Option<bool>; SERVICES.len()],
    stalled: bool,
}

impl Report {
    /// The first report, due before the first client can ask.
    pub(crate) async fn begin(handle: Handle, reporter: HealthReporter) -> Self {
        let mut report = Self { handle, reporter, shown: [None; SERVICES.len()], stalled: false };
        report.show(serving(&report.handle)).await;
        report
    }

    /// Keeps in step with the engine until the shutdown, and then ends every stream of the report, which would hold the
    /// server open otherwise.
    pub(crate) async fn keep(mut self) -> Infallible {
        let shutdown = self.handle.shutdown.clone();
        while !shutdown.is_cancelled() {
            self.log_stall();
            self.show(serving(&self.handle)).await;
            let _ = tokio::time::timeout(LOOK_EVERY, shutdown.cancelled()).await; // whichever comes first
        }
        self.show([false; SERVICES.len()]).await;
        for service in SERVICES {
            self.reporter.clear_service_status(service).await;
        }
        pending().await
    }

    /// A stall is logged where it begins; its end is logged where the engine runs again, which knows its length.
    fn log_stall(&mut self) {
        let stalled_for = self.handle.stalled_for().filter(|_| self.handle.is_connected());
        if let Some(silence) = stalled_for.filter(|_| !self.stalled) {
            tracing::warn!("{}: nothing that it published counts as good until it does", not_run_for(silence));
        }
        self.stalled = stalled_for.is_some();
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
    let connected = handle.is_connected();
    let runs = handle.stalled_for().is_none();
    let (all_up, store) = {
        let health = handle.health.borrow();
        // There are none before the first turn of the engine.
        (!health.buses.is_empty() && health.buses.iter().all(|bus| bus.up), health.store.clone())
    };
    let buses = runs && all_up;
    let calibrates = buses && store.problem.is_none();
    let has_force = |(patch, feed): (usize, &PatchFeed)| {
        let snapshot = feed.snapshot.borrow();
        snapshot.force.state <= ForceState::Degraded && handle.sending(patch, &snapshot, 0).freshness.is_fresh()
    };
    let force = runs && handle.patches.iter().enumerate().all(has_force);
    // Model sets are read without the engine.
    [runs, force, buses, calibrates, connected, connected && store.is_whole()]
}
