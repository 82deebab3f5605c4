//! The way to a daemon. What of a connection every client needs is in `taxel-client`; here is what the command line adds.

use prost::Message;
use taxel_client::{ConnectError, Line, Server};
use taxel_proto::v1::audit_service_client::AuditServiceClient;
use taxel_proto::v1::calibration_service_client::CalibrationServiceClient;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_proto::v1::validation_service_client::ValidationServiceClient;
use taxel_proto::v1::{ListRequest, ModelSetSummary, PatchRequest, Session, SessionRequest};
use tonic::Streaming;

use super::failure::{Failure, Outcome};
use super::json;
use super::places::Places;

/// Largest answer: a model set as text, with the framing around it.
const ANSWER_BYTES_MAX: usize = 17 << 20;

/// Which daemon is asked, and how its answer is shown.
#[derive(Debug, clap::Args)]
pub struct Asked {
    #[command(flatten)]
    server: Server,
    /// Print the answer as JSON, one message a line.
    #[arg(long)]
    pub json: bool,
}

impl Asked {
    /// Opens the connection.
    ///
    /// # Errors
    /// The address and why nobody answers there.
    pub async fn daemon(&self) -> Outcome<Daemon> {
        Daemon::at(&self.server).await
    }

    /// Shows an answer, a message of this name, as JSON, or for people.
    ///
    /// # Errors
    /// If there is no message of this name.
    pub fn show<M: Message>(&self, name: &str, answer: &M, print: impl FnOnce(&M)) -> Outcome {
        match self.json {
            true => json::print(name, answer)?,
            false => print(answer),
        }
        Ok(())
    }
}

/// A connection. All services share it.
#[derive(Clone)]
pub struct Daemon {
    channel: Line,
    /// Name of the patch as asked for; empty for the only one.
    pub patch: String,
}

impl Daemon {
    /// Opens the connection to a daemon.
    ///
    /// # Errors
    /// The address and why nobody answers there.
    pub async fn at(server: &Server) -> Outcome<Self> {
        let channel = server.connect().await.map_err(|error| match error {
            ConnectError::Unreached { .. } => Failure::from(anyhow::Error::from(error))
                .help("taxeld run --config FILE   # or name a daemon that runs: --server ADDRESS"),
            of_a_file => anyhow::Error::from(of_a_file).into(),
        })?;
        Ok(Self { channel, patch: server.patch.clone() })
    }

    /// The same daemon, asked about another patch.
    pub fn about(&self, patch: &str) -> Self {
        Self { channel: self.channel.clone(), patch: patch.to_owned() }
    }

    /// `ForceService`.
    pub fn force(&self) -> ForceServiceClient<Line> {
        ForceServiceClient::new(self.channel.clone())
    }

    /// `SkinService`.
    pub fn skin(&self) -> SkinServiceClient<Line> {
        SkinServiceClient::new(self.channel.clone())
    }

    /// `AuditService`.
    pub fn audit(&self) -> AuditServiceClient<Line> {
        AuditServiceClient::new(self.channel.clone()).max_decoding_message_size(ANSWER_BYTES_MAX)
    }

    /// `CalibrationService`.
    pub fn calibration(&self) -> CalibrationServiceClient<Line> {
        CalibrationServiceClient::new(self.channel.clone()).max_decoding_message_size(ANSWER_BYTES_MAX)
    }

    /// `ModelService`.
    pub fn models(&self) -> ModelServiceClient<Line> {
        ModelServiceClient::new(self.channel.clone())
            .max_decoding_message_size(ANSWER_BYTES_MAX)
            .max_encoding_message_size(ANSWER_BYTES_MAX)
    }

    /// Where the taxels of a patch are.
    ///
    /// # Errors
    /// No such patch, or a lost connection.
    pub async fn places(&self, patch: &str) -> Outcome<Places> {
        let request = PatchRequest { patch: patch.to_owned() };
        Ok(Places::of(&self.skin().get_skin(request).await?.into_inner()))
    }

    /// A session as it changes.
    ///
    /// # Errors
    /// No such session, or a lost connection.
    pub async fn watch_session(&self, session: u64) -> Outcome<Streaming<Session>> {
        Ok(self.calibration().watch_session(SessionRequest { session }).await?.into_inner())
    }

    /// All model sets of the patch, newest first.
    ///
    /// # Errors
    /// One that refuses, or a lost connection.
    pub async fn model_sets(&self) -> Outcome<Vec<ModelSetSummary>> {
        let request = ListRequest { patch: self.patch.clone(), ..ListRequest::default() };
        Ok(self.models().list_model_sets(request).await?.into_inner().model_sets)
    }

    /// `ValidationService`.
    pub fn validation(&self) -> ValidationServiceClient<Line> {
        ValidationServiceClient::new(self.channel.clone())
    }
}
