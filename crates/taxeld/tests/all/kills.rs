//! The daemon is killed at random while it imports, activates and calibrates: what was acknowledged is there when it comes
//! back, and the set in use is the one that was. 12 times, or as often as TAXELD_KILLS says.

use std::collections::BTreeMap;

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::model_set::ModelSet;
use taxel_model::{GaugeUncertainty, Status, TaxelModel};
use taxel_proto::v1::calibration_service_client::CalibrationServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_store::models_json;
use tonic::transport::Channel;

use crate::common::*;
use crate::daemon::Daemon;

/// Kills unless the environment says otherwise.
const KILLS: u64 = 12;

/// Taxels of the 16 modules of the simulated patch.
const TAXELS: usize = 160;

/// A connection, once the engine has had its first turn.
async fn served(daemon: &Daemon) -> Channel {
    daemon.stream().await.message().await.unwrap();
    Channel::from_shared(format!("http://{}", daemon.address)).unwrap().connect().await.unwrap()
}

/// A set that differs from others by its number.
fn model_set(number: u64) -> (String, String) {
    let mut set = ModelSet {
        patch: "forearm".to_owned(),
        created_wall_ns: 1,
        method: format!("none {number}"),
        baseline: vec![TaxelBaseline { mean: 200.0, noise: 0.5 }; TAXELS],
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.01,
        gauge_offset_kpa: 0.1,
        taxels: vec![TaxelModel::without_curve(Status::NoData, GaugeUncertainty::default()); TAXELS],
        ..ModelSet::default()
    };
    set.id = models_json::content_id(&set);
    let text = models_json::to_json(&set).unwrap();
    (set.id, text)
}

/// What was acknowledged, and what was asked for when the daemon was killed.
#[derive(Default)]
struct Told {
    /// By the number of a set: its id.
    sets: BTreeMap<u64, String>,
    active: Option<String>,
    asked: Option<String>,
    sessions: Vec<u64>,
    next: u64,
}

impl Told {
    /// Does the next thing: imports a set, activates it, and starts or ends a session every third time.
    async fn go_on(&mut self, channel: &Channel) -> Result<(), tonic::Status> {
        self.next += 1;
        let (number, mut models) = (self.next, ModelServiceClient::new(channel.clone()));
        let (id, json) = model_set(number);
        models.import_model_set(v1::ImportModelSetRequest { json, insist: true }).await?;
        self.sets.insert(number, id.clone());
        self.asked = Some(id.clone());
        let activate = v1::ActivateModelSetRequest { model_set: id.clone(), ..v1::ActivateModelSetRequest::default() };
        models.activate_model_set(activate).await?;
        self.active = self.asked.take();
        if number % 3 == 0 {
            let mut calibration = CalibrationServiceClient::new(channel.clone());
            let start =
                v1::StartSessionRequest { confirmed_by: "Ann".to_owned(), ..v1::StartSessionRequest::default() };
            match calibration.start_session(start).await {
                Ok(session) => self.sessions.push(session.into_inner().session),
                Err(status) if status.code() == tonic::Code::FailedPrecondition => {
                    let session = self.sessions.last().copied().unwrap_or_default();
                    let action = v1::SessionAction::Abort.into();
                    let abort = v1::AdvanceSessionRequest { session, action, ..Default::default() };
                    let _ = calibration.advance_session(abort).await;
                }
                Err(status) => return Err(status),
            }
        }
        Ok(())
    }

    /// Whether all of it is there.
    async fn check(&mut self, channel: &Channel, cycle: u64) {
        let mut models = ModelServiceClient::new(channel.clone());
        let begun = Instant::now();
        let mut listed = Vec::new();
        // Nothing is listed before the engine's first turn.
        while listed.is_empty() && !self.sets.is_empty() {
            assert!(begun.elapsed() < PATIENCE, "cycle {cycle}: no set is listed");
            listed = all_sets(&mut models).await;
        }
        for id in self.sets.values() {
            assert!(
                listed.iter().any(|set| set.model_set == *id),
                "cycle {cycle}: {id} is lost, {} are there",
                listed.len()
            );
        }
        let active = listed.iter().find(|set| set.active).map(|set| set.model_set.clone());
        assert!(active == self.active || active == self.asked, "cycle {cycle}: {active:?} is in use");
        (self.active, self.asked) = (active, None);
        if let Some((number, id)) = self.sets.iter().nth(cycle as usize % self.sets.len().max(1)) {
            let request = v1::ExportModelSetRequest { model_set: id.clone(), ..v1::ExportModelSetRequest::default() };
            let text = models.export_model_set(request).await.unwrap().into_inner().json;
            assert_eq!(text, model_set(*number).1, "cycle {cycle}");
        }
        let mut calibration = CalibrationServiceClient::new(channel.clone());
        for number in self.sessions.iter().rev().take(3) {
            let found = calibration.get_session(v1::SessionRequest { session: *number }).await;
            assert!(found.is_ok(), "cycle {cycle}: session {number}: {found:?}");
        }
        let mut skin = SkinServiceClient::new(channel.clone());
        let problems = skin.get_health(()).await.unwrap().into_inner().problems;
        assert!(!problems.iter().any(|problem| problem.contains("store")), "cycle {cycle}: {problems:?}");
    }
}

async fn all_sets(models: &mut ModelServiceClient<Channel>) -> Vec<v1::ModelSetSummary> {
    models.list_model_sets(v1::ListRequest::default()).await.unwrap().into_inner().model_sets
}

#[tokio::test]
async fn what_was_acknowledged_is_there_after_kills_at_random_moments() {
    let folder = tempfile::tempdir().unwrap();
    let kills = std::env::var("TAXELD_KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(KILLS);
    let mut told = Told::default();
    let mut seed = 1_u64;
    for cycle in 0..kills {
        let mut daemon = Daemon::start_in(folder.path(), |_, _| {});
        let channel = served(&daemon).await;
        told.check(&channel, cycle).await;
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        for _ in 0..(seed >> 60) % 6 {
            told.go_on(&channel).await.unwrap();
        }
        // Dead at any moment of what is done next.
        let (pid, after) = (daemon.child.0.id(), Duration::from_micros((seed >> 33) % 60_000));
        let kill = tokio::task::spawn_blocking(move || {
            std::thread::sleep(after);
            Command::new("kill").args(["-KILL", &pid.to_string()]).status().unwrap();
        });
        while told.go_on(&channel).await.is_ok() {}
        kill.await.unwrap();
        daemon.child.0.wait().unwrap();
    }
    let daemon = Daemon::start_in(folder.path(), |_, _| {});
    let channel = served(&daemon).await;
    told.check(&channel, kills).await;
    println!("{kills} kills: {} sets and {} sessions acknowledged, none lost", told.sets.len(), told.sessions.len());
    assert!(told.sets.len() as u64 >= kills, "the daemons got somewhere: {} sets", told.sets.len());
}
