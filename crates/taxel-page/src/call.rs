//! A call inside the process: through the same services, checks and limits as any that comes over gRPC.

use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;

use futures_util::future::poll_fn;
use futures_util::stream::{self, Stream};
use http_body_util::Full;
use hyper::HeaderMap;
use hyper::body::Body as _;
use hyper::header::{AUTHORIZATION, CONTENT_TYPE, HeaderValue, TE};
use prost_reflect::{DynamicMessage, MessageDescriptor};
use taxel_proto::refusal::Refusal;
use tonic::body::Body;
use tonic::transport::server::TcpConnectInfo;
use tonic::{Code, Status};
use tower::ServiceExt;
use tower::util::BoxCloneSyncService;

use crate::frames::{Unframed, framed};
use crate::methods::Method;

/// The daemon's gRPC services with all the layers that lie around them, called without a socket.
pub type Services = BoxCloneSyncService<hyper::Request<Body>, hyper::Response<Body>, std::convert::Infallible>;

/// Who calls: what the layers around the services may judge it by.
#[derive(Clone, Debug)]
pub struct Caller {
    /// The address it calls from.
    pub address: SocketAddr,
    /// Its `authorization` headers. It may send one; what is to be said of more the services know.
    pub authorization: Vec<HeaderValue>,
}

impl Caller {
    pub(crate) fn new(address: SocketAddr, headers: &HeaderMap) -> Self {
        Self { address, authorization: headers.get_all(AUTHORIZATION).iter().cloned().collect() }
    }

    /// What of its headers its call carries.
    #[must_use]
    pub fn headers(&self) -> HeaderMap {
        self.authorization.iter().map(|authorization| (AUTHORIZATION, authorization.clone())).collect()
    }
}

/// Whether a caller may make the call with this path, `/taxel.v1.Service/Method`, as the services themselves judge it; asked
/// before the body of a request is read, so that whoever may not make a call takes no place from those who may.
pub type Permits = Arc<dyn Fn(&Caller, &str) -> Result<(), Status> + Send + Sync>;

/// The services as this caller calls them: with its address and its `authorization`.
pub(crate) fn as_of(services: &Services, caller: &Caller) -> Services {
    let caller = caller.clone();
    Services::new(services.clone().map_request(move |mut call: hyper::Request<Body>| {
        call.headers_mut().extend(caller.headers());
        call.extensions_mut().insert(TcpConnectInfo { local_addr: None, remote_addr: Some(caller.address) });
        call
    }))
}

/// Makes the call. Gives its answer once the head of it is there.
pub(crate) async fn begin(
    services: Services,
    method: &Method,
    request: &DynamicMessage,
    caller: &Caller,
) -> Result<Answer, Status> {
    let path = method.path();
    let mut call = hyper::Request::new(Body::new(Full::new(framed(request))));
    *call.method_mut() = hyper::Method::POST;
    *call.uri_mut() = format!("/{path}").parse().map_err(|_| Refusal::fault("the path of a method"))?;
    call.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("application/grpc"));
    call.headers_mut().insert(TE, HeaderValue::from_static("trailers"));
    let response = match as_of(&services, caller).oneshot(call).await {
        Ok(response) => response,
        Err(never) => match never {},
    };
    ended(response.headers())?;
    let (output, body) = (method.output(), response.into_body());
    Ok(Answer { body, output, unframed: Unframed::default(), over: false })
}

/// The status in a head or in trailers; `Ok` if it is OK or there is none.
fn ended(headers: &HeaderMap) -> Result<(), Status> {
    match Status::from_header_map(headers) {
        Some(status) if status.code() != Code::Ok => Err(status),
        _ => Ok(()),
    }
}

/// An answer on its way: one message or many.
pub(crate) struct Answer {
    body: Body,
    output: MessageDescriptor,
    unframed: Unframed,
    over: bool,
}

impl Answer {
    /// The next message; nothing once the answer has ended well.
    pub(crate) async fn next(&mut self) -> Result<Option<DynamicMessage>, Status> {
        loop {
            if let Some(message) = self.unframed.next(&self.output)? {
                return Ok(Some(message));
            }
            if self.over {
                return Ok(None);
            }
            match poll_fn(|cx| Pin::new(&mut self.body).poll_frame(cx)).await {
                None => self.over = true,
                Some(Err(status)) => return Err(status),
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(data) => self.unframed.push(&data),
                    Err(frame) => frame.trailers_ref().map_or(Ok(()), ended)?,
                },
            }
        }
    }

    /// The one message of a call that does not stream.
    pub(crate) async fn only(mut self) -> Result<DynamicMessage, Status> {
        let message = self.next().await?.ok_or_else(|| Refusal::fault("the call was answered without a message"))?;
        while self.next().await?.is_some() {} // the status comes after the message
        Ok(message)
    }

    /// Its messages, and at the end how it ended if that was not well. Nothing is taken from the service before it is
    /// asked for here, so that a slow reader gets the newest value next.
    pub(crate) fn messages(self) -> impl Stream<Item = Result<DynamicMessage, Status>> + Send {
        stream::unfold(Some(self), |answer| async {
            let mut answer = answer?;
            match answer.next().await {
                Ok(Some(message)) => Some((Ok(message), Some(answer))),
                Ok(None) => None,
                Err(status) => Some((Err(status), None)),
            }
        })
    }
}
