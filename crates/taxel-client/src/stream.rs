//! The samples of one stream.

use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::{ForceSample, StreamRequest};
use tonic::{Status, Streaming};

use crate::connect::Line;
use crate::received::Received;

/// A stream of the force of a patch.
#[derive(Debug)]
pub struct Samples(Streaming<ForceSample>);

impl Samples {
    /// Subscribes; `patch` may be empty if the daemon has one, and without `rate_hz` each sample comes.
    ///
    /// # Errors
    /// What the daemon answers, or that it does not.
    pub async fn open(
        mut client: ForceServiceClient<Line>,
        patch: String,
        rate_hz: Option<f64>,
    ) -> Result<Self, Status> {
        Ok(Self(client.stream_force(StreamRequest { patch, rate_hz }).await?.into_inner()))
    }

    /// The next sample; `None` once the daemon has ended the stream. A call that is dropped loses no sample.
    ///
    /// # Errors
    /// Why the stream was lost.
    pub async fn next(&mut self) -> Result<Option<Received>, Status> {
        Ok(self.0.message().await?.map(Received::now))
    }
}
