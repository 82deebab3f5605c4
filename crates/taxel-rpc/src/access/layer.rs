//! Before all services: who calls, whether the table lets that one through, and whether there is room.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http;
use axum::middleware::Next;
use axum::response::Response;
use taxel_proto::refusal::{Refusal, complete};
use taxel_proto::v1::ErrorReason;
use tonic::transport::server::TcpConnectInfo;
use tonic::{Code, Status};

use crate::access::origin::Origin;
use crate::access::rules::{Access, Caller};
use crate::access::table::{Method, method};
use crate::connection::{Answer, Peer};
use crate::limits::{Place, Shares};
use crate::refusals::Refusals;
use crate::status::left_open;

/// Longest method name that an answer repeats, in characters.
const NAME_CHARS_MAX: usize = 100;

/// A long call whose request does not come whole, or whose answer nobody makes, gives its place back after this time.
const LONG_CALL_MAX: Duration = Duration::from_secs(120);

/// What stands before the services. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Gate {
    access: Access,
    shares: Arc<Shares>,
    refusals: Arc<Refusals>,
}

/// What a call was let through with.
type Admitted = (Caller, Peer, Option<Arc<Place>>);

impl Gate {
    pub(crate) const fn new(access: Access, shares: Arc<Shares>, refusals: Arc<Refusals>) -> Self {
        Self { access, shares, refusals }
    }

    fn admit(&self, request: &Request) -> Result<Admitted, Status> {
        let extensions = request.extensions();
        // Who calls within this process says for whom; a connection of ours always says itself who it is.
        let for_whom = || Some(Peer::of_tcp(extensions.get::<TcpConnectInfo>()?.remote_addr()?));
        let no_origin = || Refusal::fault("the connection has no origin, which is a fault of this program");
        let peer = extensions.get::<Peer>().cloned().or_else(for_whom).ok_or_else(no_origin)?;
        let path = request.uri().path();
        let admitted = self.permitted(&peer.origin, path, request.headers()).and_then(|(caller, method)| {
            let place = method.takes.map(|what| self.shares.place(what, &caller)).transpose()?;
            Ok((caller, peer.clone(), place))
        });
        admitted.inspect_err(|status| {
            let origin = &peer.origin;
            self.refusals.tell((&status.code().to_string(), &origin.key()), || {
                format!("a call was refused: {} from {}: {}", shown(path), origin.place(), status.message())
            });
        })
    }

    /// Who calls what, if its role is enough for it.
    fn permitted(
        &self,
        origin: &Arc<Origin>,
        path: &str,
        headers: &http::HeaderMap,
    ) -> Result<(Caller, Method), Status> {
        let mut credentials = headers.get_all(http::header::AUTHORIZATION).iter();
        let credential = credentials.next().map(http::HeaderValue::as_bytes);
        if credentials.next().is_some() {
            return Err(Refusal::unauthenticated("the metadata `authorization` is there twice").into());
        }
        let caller = self.access.rules().caller(origin, credential)?;
        let method = method(path).ok_or_else(|| {
            Refusal::new(Code::Unimplemented, ErrorReason::MethodUnknown, format!("there is no method {}", shown(path)))
        })?;
        may(&caller, method)?;
        Ok((caller, method))
    }
}

/// Whether this caller may call this method.
///
/// # Errors
/// What the call is refused with.
pub(crate) fn may(caller: &Caller, method: Method) -> Result<(), Status> {
    if caller.role < Some(method.role) { Err(denied(caller, method)) } else { Ok(()) }
}

/// Why this caller may not call this method, and how to get there.
fn denied(caller: &Caller, method: Method) -> Status {
    let has = caller.role.map_or("no role", |role| role.name());
    let (needed, name) = (method.role, method.name);
    let how = match &*caller.origin {
        _ if caller.by_token => "the token file gives each token its role",
        Origin::Unix(..) => "an entry of [access] for your account or one of its groups, or a token, gives it",
        Origin::Loopback(_) => {
            "show a token (metadata `authorization: Bearer TOKEN`), or come over the Unix socket with an account that \
             [access] names"
        }
        Origin::Insecure(_) => "come over TLS with a client certificate that [access] names",
        Origin::Tls(..) => "an entry of [access] for a name of your certificate, or a token, gives it",
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

/// Stands before all services. Who calls them without a socket gives the client's address as [`TcpConnectInfo`] and its
/// `authorization`, and is judged as if the client had come over TCP without TLS.
pub(crate) async fn guard(State(gate): State<Gate>, mut request: Request, next: Next) -> Response {
    let (caller, peer, place) = match gate.admit(&request) {
        Ok(admitted) => admitted,
        Err(status) => return status.into_http(),
    };
    let call = peer.seat.as_ref().map(|seat| seat.begin());
    let is_long = place.as_ref().is_some_and(|place| place.is_long());
    request.extensions_mut().insert(caller);
    let answer = async move {
        let mut answer = next.run(request).await;
        complete(answer.headers_mut());
        answer.map(|body| Body::new(Answer::new(body, call, place)))
    };
    if is_long { to_its_end(answer).await } else { answer.await }
}

/// A long call goes on when its caller has gone, and holds its place meanwhile: so calls that are given up do not pile up in
/// the store or among the fits.
async fn to_its_end(answer: impl Future<Output = Response> + Send + 'static) -> Response {
    let refusal = match tokio::spawn(tokio::time::timeout(LONG_CALL_MAX, answer)).await {
        Ok(Ok(answer)) => return answer,
        Ok(Err(late)) => left_open(Code::DeadlineExceeded, late),
        Err(lost) => Refusal::fault(format!("the work for this call was lost: {lost}")),
    };
    Status::from(refusal).into_http()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::rules::Rules;
    use crate::access::table::Role;
    use crate::limits::Limits;

    #[test]
    fn who_is_denied_is_told_what_would_give_the_role() {
        let tare = method("/taxel.v1.SkinService/Tare").unwrap();
        let origin = Arc::new(Origin::of_tcp(([127, 0, 0, 1], 4000).into()));
        let denied_as = |name: Option<&str>, by_token| {
            let (origin, name, role) = (Arc::clone(&origin), name.map(Arc::from), Some(Role::Observer));
            denied(&Caller { origin, name, by_token, role, said: String::new() }, tare)
        };
        let by_token = denied_as(Some("bench"), true);
        assert_eq!(by_token.code(), Code::PermissionDenied);
        assert!(by_token.message().contains("the token file gives each token its role"), "{by_token:?}");
        assert!(by_token.message().contains("needs the role operator; token bench over"), "{by_token:?}");
        let nobody = denied_as(None, false);
        assert_eq!(nobody.code(), Code::Unauthenticated);
        assert!(nobody.message().contains("show a token"), "{nobody:?}");
    }

    #[test]
    fn a_credential_that_is_there_twice_is_none() {
        let gate = Gate::new(Access::new(Rules::open()), Arc::new(Shares::new(Limits::default())), Arc::default());
        let mut request = Request::builder().uri("/taxel.v1.SkinService/Tare").body(Body::empty()).unwrap();
        request.extensions_mut().insert(Peer::of_tcp(([127, 0, 0, 1], 4000).into()));
        for token in ["Bearer a", "Bearer b"] {
            request.headers_mut().append(http::header::AUTHORIZATION, token.parse().unwrap());
        }
        let refused = gate.admit(&request).err().unwrap();
        assert_eq!(refused.code(), Code::Unauthenticated);
        assert!(refused.message().contains("`authorization` is there twice"), "{refused:?}");
    }
}
