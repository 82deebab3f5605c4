//! `ForceService`: the newest force, once or as a stream.

use taxel_proto::v1;
use taxel_proto::v1::force_service_server::ForceService;
use tonic::{Request, Response};

use crate::convert;
use crate::service::{Reply, Service};
use crate::stream::{MessageStream, subscribe};

#[tonic::async_trait]
impl ForceService for Service {
    async fn get_force(&self, request: Request<v1::PatchRequest>) -> Reply<v1::ForceSample> {
        let patch = self.patch(&request.get_ref().patch)?;
        let snapshot = self.snapshot(patch);
        let sending = self.handle.sending(patch, &snapshot, 0);
        Ok(Response::new(convert::force_in_full(self.plan(patch), &snapshot, sending)))
    }

    type StreamForceStream = MessageStream<v1::ForceSample>;

    async fn stream_force(&self, request: Request<v1::StreamRequest>) -> Reply<Self::StreamForceStream> {
        let request = request.into_inner();
        let patch = self.patch(&request.patch)?;
        subscribe(self, patch, request.rate_hz, convert::force).map(Response::new)
    }
}
