//! Before all services: who calls, whether the table lets that one through, and whether there is room.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use http_body::Frame;
use taxel_proto::refusal::{Refusal, complete};
use taxel_proto::v1::ErrorReason;
use tonic::body::Body;
use tonic::codegen::{Bytes, Service, http};
use tonic::{Code, Status};
use tower_layer::Layer;

use crate::access::caller::Caller;
use crate::access::origin::Origin;
use crate::access::rules::Access;
use crate::access::table::{Kind, Method, method};
use crate::refusals::Refusals;
use crate::shares::{Place, Shares};

/// Longest method name that an answer repeats, in characters.
const NAME_CHARS_MAX: usize = 100;

/// What stands before the services. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Gate {
    access: Access,
    shares: Arc<Shares>,
    refusals: Arc<Refusals>,
}

/// What a call was let through with.
struct Admitted {
    caller: Caller,
    /// Of a stream whose service takes none itself.
    place: Option<Place>,
}

impl Gate {
    pub(crate) fn new(access: Access, shares: Arc<Shares>, refusals: Arc<Refusals>) -> Self {
        Self { access, shares, refusals }
    }

    fn admit(&self, request: &http::Request<Body>) -> Result<Admitted, Status> {
        let path = request.uri().path();
        let no_origin = || Refusal::fault("the connection has no origin, which is a fault of this program");
        let origin = request.extensions().get::<Arc<Origin>>().ok_or_else(no_origin)?;
        let judged = self.judge(origin, path, request.headers());
        judged.inspect_err(|status| {
            let (peer, code) = (origin.key(), status.code());
            self.refusals.tell((&code.to_string(), &peer), || {
                format!("a call was refused: {} from {}: {}", shown(path), origin.place(), status.message())
            });
        })
    }

    fn judge(&self, origin: &Arc<Origin>, path: &str, headers: &http::HeaderMap) -> Result<Admitted, Status> {
        let mut shown_credentials = headers.get_all(http::header::AUTHORIZATION).iter();
        let credential = shown_credentials.next().map(http::HeaderValue::as_bytes);
        if shown_credentials.next().is_some() {
            return Err(Refusal::unauthenticated("the metadata `authorization` is there twice").into());
        }
        let caller = self.access.rules().caller(origin, credential)?;
        let method = method(path).ok_or_else(|| {
            Refusal::new(Code::Unimplemented, ErrorReason::MethodUnknown, format!("there is no method {}", shown(path)))
        })?;
        if caller.role < Some(method.role) {
            return Err(denied(&caller, method));
        }
        let place = match method.kind {
            Kind::ForeignStream => Some(self.shares.stream(&caller)?),
            Kind::Command => self.shares.command(&caller).map(|()| None)?,
            Kind::SessionStart => self.shares.session_start(&caller).map(|()| None)?,
            Kind::Read | Kind::Stream => None,
        };
        Ok(Admitted { caller, place })
    }
}

/// Why this caller may not call this method, and how to get there.
fn denied(caller: &Caller, method: Method) -> Status {
    let has = caller.role.map_or("no role", |role| role.name());
    let (needed, name) = (method.role, method.name);
    let how = match &*caller.origin {
        _ if caller.by_token => "the token file gives each token its role",
        Origin::Unix(..) => "an [[access.grant]] for your account or one of its groups, or a token, gives it",
        Origin::Loopback(_) => {
            "show a token (metadata `authorization: Bearer TOKEN`), or come over the Unix socket with an account that an \
             [[access.grant]] names"
        }
        Origin::Insecure(_) => "come over TLS with a client certificate that an [[access.grant]] names",
        Origin::Tls(..) => "an [[access.grant]] for a name of your certificate, or a token, gives it",
    };
    let text = |who: &str| {
        format!("{name} needs the role {needed}; {who} over {} has {has}: {how}", caller.origin.transport())
    };
    let (code, text) = match &caller.name {
        Some(_) => (Code::PermissionDenied, text(&caller.who())),
        None => (Code::Unauthenticated, text("a caller without credentials")),
    };
    Refusal::new(code, ErrorReason::RoleTooLow, text).about("method", name).about("role", needed).into()
}

/// A path that a peer sent, short and harmless.
fn shown(path: &str) -> String {
    path.strip_prefix('/').unwrap_or(path).chars().take(NAME_CHARS_MAX).flat_map(char::escape_debug).collect()
}

impl<S> Layer<S> for Gate {
    type Service = Guarded<S>;

    fn layer(&self, inner: S) -> Guarded<S> {
        Guarded { inner, gate: self.clone() }
    }
}

/// The services behind the gate.
#[derive(Clone)]
pub(crate) struct Guarded<S> {
    inner: S,
    gate: Gate,
}

type Answer<E> = Pin<Box<dyn Future<Output = Result<http::Response<Body>, E>> + Send>>;

impl<S> Service<http::Request<Body>> for Guarded<S>
where
    S: Service<http::Request<Body>, Response = http::Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = http::Response<Body>;
    type Error = S::Error;
    type Future = Answer<S::Error>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, mut request: http::Request<Body>) -> Self::Future {
        match self.gate.admit(&request) {
            Ok(Admitted { caller, place }) => {
                request.extensions_mut().insert(caller);
                let answer = self.inner.call(request);
                Box::pin(async move {
                    let mut answer = answer.await?;
                    complete(answer.headers_mut());
                    Ok(match place {
                        None => answer,
                        Some(place) => answer.map(|body| Body::new(Held { body, _place: place })),
                    })
                })
            }
            Err(status) => Box::pin(std::future::ready(Ok(status.into_http()))),
        }
    }
}

/// The answer of a call. It holds a place until it has ended or its reader is gone, and a refusal at its end that has no
/// reason for programs gets one.
struct Held {
    body: Body,
    _place: Place,
}

impl http_body::Body for Held {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let mut polled = Pin::new(&mut self.body).poll_frame(cx);
        if let Poll::Ready(Some(Ok(frame))) = &mut polled
            && let Some(trailers) = frame.trailers_mut()
        {
            complete(trailers);
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }
}
