//! Before all services: who calls, whether the table lets that one through, and whether there is room.

use std::mem;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use taxel_proto::refusal::{Refusal, complete};
use taxel_proto::v1::ErrorReason;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::body::Body;
use tonic::codegen::{Service, http};
use tonic::{Code, Status};
use tower_layer::Layer;

use crate::access::caller::Caller;
use crate::access::origin::Origin;
use crate::access::rules::Access;
use crate::access::standing::Standing;
use crate::access::table::{Kind, Method, method};
use crate::answers::Answers;
use crate::guard::Peer;
use crate::limits::Limits;
use crate::refusals::Refusals;
use crate::request_body::RequestBody;
use crate::shares::{Place, Shares, What};

/// Longest method name that an answer repeats, in characters.
const NAME_CHARS_MAX: usize = 100;

/// What stands before the services. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Gate {
    access: Access,
    shares: Arc<Shares>,
    refusals: Arc<Refusals>,
    answers: Arc<Answers>,
    imports: Arc<Semaphore>,
    body_pause: Duration,
}

/// The right to have a large request read, by extension from the gate to the service.
#[derive(Clone)]
pub(crate) struct ImportTurn(
    #[expect(dead_code, reason = "free again when this is dropped")] Arc<OwnedSemaphorePermit>,
);

/// What a call was let through with.
struct Admitted {
    caller: Caller,
    peer: Peer,
    method: Method,
    /// Of a call that does not stream, or of a stream whose service takes none itself.
    place: Option<Place>,
    /// Of a stream whose service takes its place, until it does.
    opening: Option<Place>,
}

impl Gate {
    pub(crate) fn new(
        access: Access,
        (shares, refusals): (Arc<Shares>, Arc<Refusals>),
        answers: Arc<Answers>,
        limits: &Limits,
    ) -> Self {
        let imports = Arc::new(Semaphore::new(limits.imports));
        Self { access, shares, refusals, answers, imports, body_pause: limits.body_pause }
    }

    fn admit(&self, request: &http::Request<Body>) -> Result<Admitted, Status> {
        let path = request.uri().path();
        let no_origin = || Refusal::fault("the connection has no origin, which is a fault of this program");
        let peer = request.extensions().get::<Peer>().ok_or_else(no_origin)?;
        self.judge(peer, path, request.headers()).inspect_err(|status| self.tell(peer, path, status))
    }

    /// Whether the rules let this peer make this call; nothing is counted yet.
    pub(crate) fn permits(&self, peer: &Peer, path: &str, headers: &http::HeaderMap) -> Result<(), Status> {
        self.permitted(peer, path, headers).map(drop).inspect_err(|status| self.tell(peer, path, status))
    }

    /// Tells the log of a refusal.
    fn tell(&self, peer: &Peer, path: &str, status: &Status) {
        let origin = &peer.origin;
        self.refusals.tell((&status.code().to_string(), &origin.key()), || {
            format!("a call was refused: {} from {}: {}", shown(path), origin.place(), status.message())
        });
    }

    /// Who calls what, if its role is enough for it.
    fn permitted(&self, peer: &Peer, path: &str, headers: &http::HeaderMap) -> Result<(Caller, Method), Status> {
        let mut shown_credentials = headers.get_all(http::header::AUTHORIZATION).iter();
        let credential = shown_credentials.next().map(http::HeaderValue::as_bytes);
        if shown_credentials.next().is_some() {
            return Err(Refusal::unauthenticated("the metadata `authorization` is there twice").into());
        }
        let caller = self.access.rules().caller(&peer.origin, credential)?;
        let method = method(path).ok_or_else(|| {
            Refusal::new(Code::Unimplemented, ErrorReason::MethodUnknown, format!("there is no method {}", shown(path)))
        })?;
        if caller.role < Some(method.role) {
            return Err(denied(&caller, method));
        }
        Ok((caller, method))
    }

    fn judge(&self, peer: &Peer, path: &str, headers: &http::HeaderMap) -> Result<Admitted, Status> {
        let (caller, method) = self.permitted(peer, path, headers)?;
        let place = match method.kind {
            Kind::Read | Kind::Command | Kind::SessionStart | Kind::Import => Some(What::Call),
            Kind::ForeignStream => Some(What::Stream),
            Kind::Stream | Kind::Push => None,
        };
        let place = place.map(|what| self.shares.place(what, &caller)).transpose()?;
        let opens = method.kind == Kind::Stream;
        let opening = opens.then(|| self.shares.place(What::Opening, &caller)).transpose()?;
        match method.kind {
            Kind::Command | Kind::Import | Kind::Push => self.shares.command(&caller)?,
            Kind::SessionStart => self.shares.session_start(&caller)?,
            Kind::Read | Kind::Stream | Kind::ForeignStream => {}
        }
        Ok(Admitted { caller, peer: peer.clone(), method, place, opening })
    }

    /// The request as its service gets it. One that may be large waits for its turn before anything of its body is read.
    async fn prepare(
        &self,
        mut request: http::Request<Body>,
        (caller, peer): (Caller, &Peer),
        kind: Kind,
    ) -> http::Request<Body> {
        request.extensions_mut().insert(caller);
        if kind == Kind::Push {
            let (gate, peer) = (self.clone(), peer.clone());
            let (path, headers) = (request.uri().path().to_owned(), request.headers().clone());
            let judge = move || gate.permits(&peer, &path, &headers);
            request.extensions_mut().insert(Standing::new(self.access.clone(), judge));
        }
        if kind == Kind::Import
            && let Ok(turn) = Arc::clone(&self.imports).acquire_owned().await
        {
            request.extensions_mut().insert(ImportTurn(Arc::new(turn)));
        }
        if !kind.has_one_request() {
            return request;
        }
        request.map(|body| Body::new(RequestBody::new(body, self.body_pause)))
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

impl<S> Guarded<S> {
    pub(crate) const fn gate(&self) -> &Gate {
        &self.gate
    }
}

type Answer<E> = Pin<Box<dyn Future<Output = Result<http::Response<Body>, E>> + Send>>;

impl<S> Service<http::Request<Body>> for Guarded<S>
where
    S: Service<http::Request<Body>, Response = http::Response<Body>> + Clone + Send + 'static,
    S::Future: Send,
    S::Error: Send,
{
    type Response = http::Response<Body>;
    type Error = S::Error;
    type Future = Answer<S::Error>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        match self.gate.admit(&request) {
            Ok(Admitted { caller, peer, method, place, opening }) => {
                let gate = self.gate.clone();
                // The one that was ready is taken, and a clone of it stays.
                let waiting = self.inner.clone();
                let mut inner = mem::replace(&mut self.inner, waiting);
                Box::pin(async move {
                    let request = gate.prepare(request, (caller, &peer), method.kind).await;
                    let mut answer = inner.call(request).await?;
                    drop(opening);
                    complete(answer.headers_mut());
                    Ok(gate.answers.watch((method.name, &peer), answer, place))
                })
            }
            Err(status) => Box::pin(std::future::ready(Ok(status.into_http()))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::role::Role;
    use crate::access::rules::Rules;

    #[test]
    fn a_path_in_a_refusal_is_short_and_has_no_control_characters() {
        assert_eq!(shown("/taxel.v1.SkinService/Tare"), "taxel.v1.SkinService/Tare");
        assert_eq!(shown("/a\u{1b}[2J\n"), "a\\u{1b}[2J\\n");
        assert_eq!(shown(&format!("/{}", "x".repeat(10_000))).len(), NAME_CHARS_MAX);
    }

    #[test]
    fn who_is_denied_is_told_what_would_give_the_role() {
        let tare = method("/taxel.v1.SkinService/Tare").unwrap();
        let origin = Arc::new(Origin::of_tcp(([127, 0, 0, 1], 4000).into()));
        let denied_as = |name: Option<&str>, by_token| {
            let (origin, name, role) = (Arc::clone(&origin), name.map(Arc::from), Some(Role::Observer));
            denied(&Caller { origin, name, by_token, role }, tare)
        };
        let by_token = denied_as(Some("bench"), true);
        assert_eq!(by_token.code(), Code::PermissionDenied);
        assert!(by_token.message().contains("the token file gives each token its role"), "{by_token:?}");
        assert!(by_token.message().contains("needs the role operator; token bench over"), "{by_token:?}");
        let nobody = denied_as(None, false);
        assert_eq!(nobody.code(), Code::Unauthenticated);
        assert!(nobody.message().contains("show a token"), "{nobody:?}");
    }

    /// Lets nobody do anything.
    fn gate(refusals: &Arc<Refusals>) -> Gate {
        let limits = Limits::default();
        let ledgers = (Shares::new(&limits), Arc::clone(refusals));
        let answers = Answers::new(limits.unread, Arc::clone(refusals));
        Gate::new(Access::new(Rules::default()), ledgers, answers, &limits)
    }

    fn peer() -> Peer {
        Peer { origin: Arc::new(Origin::of_tcp(([127, 0, 0, 1], 4000).into())), ward: None }
    }

    /// Twice, because the first is a line at once and those that follow are counted.
    #[tokio::test]
    async fn the_log_is_told_what_was_refused_to_whom() {
        let refusals = Arc::new(Refusals::default());
        let (gate, peer) = (gate(&refusals), peer());
        let (tare, nothing) = ("/taxel.v1.SkinService/Tare", http::HeaderMap::new());
        for _ in 0..2 {
            gate.permits(&peer, tare, &nothing).unwrap_err();
        }
        let mut request = http::Request::builder().uri(tare).body(Body::empty()).unwrap();
        request.extensions_mut().insert(peer);
        assert!(gate.admit(&request).is_err());
        let lines = refusals.take();
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert!(
            lines[0].starts_with("2 more like the last") && lines[0].contains("SkinService/Tare from "),
            "{lines:?}"
        );
    }

    #[test]
    fn a_credential_that_is_there_twice_is_none() {
        let gate = gate(&Arc::default());
        let mut headers = http::HeaderMap::new();
        for token in ["Bearer a", "Bearer b"] {
            headers.append(http::header::AUTHORIZATION, token.parse().unwrap());
        }
        let refused = gate.permits(&peer(), "/taxel.v1.SkinService/GetSkin", &headers).unwrap_err();
        assert_eq!(refused.code(), Code::Unauthenticated);
        assert!(refused.message().contains("`authorization` is there twice"), "{refused:?}");
    }

    /// A robot's gateway may push nothing for minutes and go on.
    #[test]
    fn streams_of_requests_may_pause() {
        let may_pause = |path: &str| !method(path).unwrap().kind.has_one_request();
        assert!(may_pause("/taxel.v1.IngestService/PushScans"));
        assert!(may_pause("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo"));
        assert!(!may_pause("/taxel.v1.SkinService/Tare") && !may_pause("/taxel.v1.ForceService/StreamForce"));
    }
}
