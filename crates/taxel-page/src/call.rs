//! A call inside the process: through the same services, checks and limits as any that comes over gRPC.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::http::header::AUTHORIZATION;
use axum::http::uri::PathAndQuery;
use axum::http::{HeaderMap, HeaderValue};
use prost::Message;
use prost_reflect::{DynamicMessage, MessageDescriptor};
use taxel_proto::refusal::Refusal;
use taxel_rpc::{Seat, SharedServices};
use tonic::client::Grpc;
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::metadata::MetadataMap;
use tonic::transport::server::TcpConnectInfo;
use tonic::{Request, Status, Streaming};

use crate::methods::Method;

/// No message of the daemon is longer; its own limit is 16 MiB.
const MESSAGE_BYTES_MAX: usize = 32 << 20;

/// The other end of a connection, among the extensions of each request.
#[derive(Clone, Debug)]
pub(crate) struct Client {
    pub(crate) address: SocketAddr,
    pub(crate) seat: Arc<Seat>,
}

/// Who calls: what the layers around the services may judge it by.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    address: SocketAddr,
    /// Its `authorization` headers. It may send one; what is to be said of more the services know.
    authorization: Vec<HeaderValue>,
}

impl Caller {
    pub(crate) fn new(client: &Client, headers: &HeaderMap) -> Self {
        Self { address: client.address, authorization: headers.get_all(AUTHORIZATION).iter().cloned().collect() }
    }

    /// A request of this caller.
    pub(crate) fn request<M>(&self, message: M) -> Request<M> {
        let mut request = Request::new(message);
        let headers = self.authorization.iter().map(|authorization| (AUTHORIZATION, authorization.clone()));
        *request.metadata_mut() = MetadataMap::from_headers(headers.collect());
        request.extensions_mut().insert(TcpConnectInfo { local_addr: None, remote_addr: Some(self.address) });
        request
    }
}

/// Messages that are known by their descriptors alone; of those that come, this one.
#[derive(Clone, Debug)]
struct Dynamic(MessageDescriptor);

impl Codec for Dynamic {
    type Encode = DynamicMessage;
    type Decode = DynamicMessage;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        self.clone()
    }

    fn decoder(&mut self) -> Self {
        self.clone()
    }
}

impl Encoder for Dynamic {
    type Item = DynamicMessage;
    type Error = Status;

    fn encode(&mut self, message: DynamicMessage, bytes: &mut EncodeBuf<'_>) -> Result<(), Status> {
        Ok(message.encode(bytes).map_err(|error| Refusal::fault(format!("a request: {error}")))?)
    }
}

impl Decoder for Dynamic {
    type Item = DynamicMessage;
    type Error = Status;

    fn decode(&mut self, bytes: &mut DecodeBuf<'_>) -> Result<Option<DynamicMessage>, Status> {
        let message = DynamicMessage::decode(self.0.clone(), bytes);
        Ok(Some(message.map_err(|error| Refusal::fault(format!("an answer: {error}")))?))
    }
}

/// The way of a call of this method.
async fn way(
    services: &SharedServices,
    method: &Method,
) -> Result<(Grpc<SharedServices>, PathAndQuery, Dynamic), Status> {
    let path = format!("/{}", method.path()).parse().map_err(|_| Refusal::fault("the path of a method"))?;
    let mut grpc = Grpc::new(services.clone()).max_decoding_message_size(MESSAGE_BYTES_MAX);
    grpc.ready().await.unwrap_or_else(|never| match never {});
    Ok((grpc, path, Dynamic(method.output())))
}

/// Calls a method that answers with one message.
pub(crate) async fn unary(
    services: &SharedServices,
    method: &Method,
    request: Request<DynamicMessage>,
) -> Result<DynamicMessage, Status> {
    let (mut grpc, path, codec) = way(services, method).await?;
    grpc.unary(request, path, codec).await.map(tonic::Response::into_inner)
}

/// Calls a method that answers with a stream. Nothing is taken from the service before it is asked for here, so that a slow
/// reader gets the newest value next.
pub(crate) async fn streaming(
    services: &SharedServices,
    method: &Method,
    request: Request<DynamicMessage>,
) -> Result<Streaming<DynamicMessage>, Status> {
    let (mut grpc, path, codec) = way(services, method).await?;
    grpc.server_streaming(request, path, codec).await.map(tonic::Response::into_inner)
}
