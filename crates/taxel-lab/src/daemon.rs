//! A running daemon, as the laboratory asks it.

use anyhow::Context;
use taxel_client::{Line, Server, model_set_named};
use taxel_proto::v1::calibration_service_client::CalibrationServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_proto::v1::validation_service_client::ValidationServiceClient;
use taxel_proto::v1::{ExportModelSetRequest, ListRequest, Load, PatchRequest, Session, SessionRequest, Skin};

/// Largest answer: a model set as text, with the framing around it.
const ANSWER_BYTES_MAX: usize = 17 << 20;

/// A connection. All services share it.
pub struct Daemon {
    line: Line,
    patch: String,
}

/// Connects, and asks.
///
/// # Errors
/// Nobody answers, or the daemon refuses.
pub fn ask<T>(server: &Server, asking: impl AsyncFnOnce(Daemon) -> anyhow::Result<T>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let line = server.connect().await.context("`--server` names another daemon")?;
        asking(Daemon { line, patch: server.patch.clone() }).await
    })
}

impl Daemon {
    fn models(&self) -> ModelServiceClient<Line> {
        ModelServiceClient::new(self.line.clone()).max_decoding_message_size(ANSWER_BYTES_MAX)
    }

    fn calibration(&self) -> CalibrationServiceClient<Line> {
        CalibrationServiceClient::new(self.line.clone()).max_decoding_message_size(ANSWER_BYTES_MAX)
    }

    /// A model set as MODELS.json: by its id, the beginning of it, or `newest`; the active one if it is empty.
    ///
    /// # Errors
    /// No such set, several of them, or no daemon any more.
    pub async fn export_set(&self, wanted: &str) -> anyhow::Result<String> {
        let model_set = if wanted.is_empty() { String::new() } else { self.full_id(wanted).await? };
        let request = ExportModelSetRequest { model_set, patch: self.patch.clone() };
        Ok(self.models().export_model_set(request).await.map_err(refused)?.into_inner().json)
    }

    async fn full_id(&self, wanted: &str) -> anyhow::Result<String> {
        let request = ListRequest { patch: self.patch.clone(), ..Default::default() };
        let sets = self.models().list_model_sets(request).await.map_err(refused)?.into_inner().model_sets;
        model_set_named(sets.into_iter().map(|set| set.model_set).collect(), wanted).map_err(anyhow::Error::msg)
    }

    /// A session.
    ///
    /// # Errors
    /// No such session, or no daemon any more.
    pub async fn session(&self, session: u64) -> anyhow::Result<Session> {
        Ok(self.calibration().get_session(SessionRequest { session }).await.map_err(refused)?.into_inner())
    }

    /// The samples of a session, as `taxeld sessions export` writes them.
    ///
    /// # Errors
    /// No samples, or no daemon any more.
    pub async fn samples(&self, session: u64) -> anyhow::Result<String> {
        let mut pieces =
            self.calibration().export_samples(SessionRequest { session }).await.map_err(refused)?.into_inner();
        let mut table = String::new();
        while let Some(piece) = pieces.message().await.map_err(refused)? {
            table += &piece.text;
        }
        Ok(table)
    }

    /// The skin of a patch: where its taxels are.
    ///
    /// # Errors
    /// No such patch, or no daemon any more.
    pub async fn skin(&self, patch: &str) -> anyhow::Result<Skin> {
        let request = PatchRequest { patch: patch.to_owned() };
        Ok(SkinServiceClient::new(self.line.clone()).get_skin(request).await.map_err(refused)?.into_inner())
    }

    /// The known loads of a patch.
    ///
    /// # Errors
    /// No such patch, or no daemon any more.
    pub async fn loads(&self, patch: &str) -> anyhow::Result<Vec<Load>> {
        let request = PatchRequest { patch: patch.to_owned() };
        let validation = ValidationServiceClient::new(self.line.clone()).get_validation(request).await;
        Ok(validation.map_err(refused)?.into_inner().loads)
    }
}

/// What the daemon says, without the words of its transport.
fn refused(status: tonic::Status) -> anyhow::Error {
    anyhow::anyhow!("{}", status.message())
}
