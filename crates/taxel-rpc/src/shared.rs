//! The services without a socket, for whoever speaks for clients within the process: the page.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use tonic::body::Body;
use tonic::codegen::{Service, http};
use tonic::service::Routes;
use tonic::transport::server::TcpConnectInfo;

use crate::access::layer::Guarded;
use crate::access::origin::Origin;
use crate::connection::Peer;

/// All services behind the gate. A request carries the client's address as [`TcpConnectInfo`] and its `authorization`, and
/// is judged as if the client had come over TCP without TLS.
#[derive(Clone)]
pub struct SharedServices {
    guarded: Guarded<Routes>,
}

impl SharedServices {
    pub(crate) const fn new(guarded: Guarded<Routes>) -> Self {
        Self { guarded }
    }
}

impl Service<http::Request<Body>> for SharedServices {
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = Pin<Box<dyn Future<Output = Result<http::Response<Body>, Infallible>> + Send>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        self.guarded.poll_ready(cx)
    }

    fn call(&mut self, mut request: http::Request<Body>) -> Self::Future {
        let address = request.extensions().get::<TcpConnectInfo>().and_then(TcpConnectInfo::remote_addr);
        if let Some(address) = address {
            request.extensions_mut().insert(Peer { origin: Arc::new(Origin::of_tcp(address)), seat: None });
        }
        self.guarded.call(request)
    }
}
