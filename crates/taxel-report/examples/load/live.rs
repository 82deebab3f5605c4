//! A daemon that has a force.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_engine::model_set::ModelSet;
use taxel_proto::v1::TareRequest;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_report::daemon::client::{connect, give_models, start};
use taxel_report::daemon::process::{Daemon, Home, Scene};
use taxel_store::models_json;
use tokio::task::JoinSet;
use tonic::transport::Channel;

const SEED: u64 = 1;

/// Modules of ten taxels on each bus of [`Live::ten_buses`].
const MODULES: usize = 50;
const BUSES: usize = 10;

/// The boards are up by then, and the hand that plays the operator, which lays a mass on each skin for the second five of
/// every ten seconds, has taken it away.
const UNTOUCHED_AFTER: Duration = Duration::from_millis(10_500);

/// A daemon with its folder.
pub struct Live {
    pub daemon: Daemon,
    pub home: Home,
    pub patches: Vec<String>,
}

impl Live {
    /// The calibrated forearm with every output; `service` are further sections.
    pub async fn forearm(taxeld: &Path, service: &str) -> anyhow::Result<Self> {
        let models = models_json::to_json(&*taxel_report::calibrate(SEED)?)?;
        let home = Home::forearm(taxeld, service, Scene::Full, SEED)?;
        let (daemon, ..) = start(&home, Some(models)).await?;
        Ok(Self { daemon, home, patches: vec!["left_forearm".to_owned()] })
    }

    /// Ten simulated buses with 500 taxels each, all with models.
    pub async fn ten_buses(taxeld: &Path) -> anyhow::Result<Self> {
        let patches: Vec<String> = (0..BUSES).map(|bus| format!("patch{bus}")).collect();
        let bus = |(bus, patch): (usize, &String)| {
            let boards = (0..MODULES).step_by(16).zip(1..).map(|(first, address)| {
                let last = (MODULES - first - 1).min(15);
                format!("{{ address = {address}, modules = \"0-{last}\" }},")
            });
            let boards: String = boards.collect();
            format!(
                "[[bus]]\nname = \"bus{bus}\"\nsource = \"sim\"\nseed = {bus}\n\
                 [[patch]]\nname = \"{patch}\"\nbus = \"bus{bus}\"\nboards = [{boards}]\n"
            )
        };
        let home = Home::with(taxeld, "", &patches.iter().enumerate().map(bus).collect::<String>())?;
        let mut daemon = home.start()?;
        let begun = Instant::now();
        let channel = connect(&mut daemon).await?;
        let forearm = taxel_report::calibrate(SEED)?;
        for patch in &patches {
            give_models(&channel, models_json::to_json(&spread(&forearm, patch))?, patch).await?;
        }
        tokio::time::sleep(UNTOUCHED_AFTER.saturating_sub(begun.elapsed())).await;
        let mut zeros = JoinSet::new();
        patches.iter().for_each(|patch| drop(zeros.spawn(zero(channel.clone(), patch.clone()))));
        while let Some(zero) = zeros.join_next().await {
            zero?.with_context(|| daemon.complaints())?;
        }
        Ok(Self { daemon, home, patches })
    }
}

/// The forearm's models for a larger patch: each taxel gets one of them, which is as good as any for what it costs.
fn spread(forearm: &Arc<ModelSet>, patch: &str) -> ModelSet {
    let taxels = 10 * MODULES;
    let set = ModelSet {
        patch: patch.to_owned(),
        baseline: forearm.baseline.iter().cycle().take(taxels).cloned().collect(),
        taxels: forearm.taxels.iter().cycle().take(taxels).cloned().collect(),
        ..ModelSet::clone(forearm)
    };
    ModelSet { id: models_json::content_id(&set), ..set }
}

/// Takes the zero of a patch on which nothing lies.
async fn zero(channel: Channel, patch: String) -> anyhow::Result<()> {
    let request = TareRequest { patch, confirmed_by: "the load harness".to_owned() };
    SkinServiceClient::new(channel).tare(request).await?;
    Ok(())
}
