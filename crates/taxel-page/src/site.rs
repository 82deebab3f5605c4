//! What each path answers.

use std::sync::Arc;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Extension, Request, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, Method as Verb, StatusCode, Uri};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use http_body_util::{BodyExt, LengthLimitError, Limited};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::{ErrorReason, PatchRequest};
use taxel_rpc::{Answer, SharedServices};
use tokio::sync::Semaphore;
use tonic::{Code, Status};

use crate::answer::{JSON, hardened, json_of, refusal, refusal_as, wrong_method};
use crate::assets;
use crate::call::{Caller, Client, streaming, unary};
use crate::events::{Source, events};
use crate::history::History;
use crate::limits::Limits;
use crate::methods::{Method, Methods};
use crate::metrics::{self, OPEN_METRICS};
use crate::origin::{check_host, check_origin};

/// Streams that one answer may carry.
const STREAMS_PER_ANSWER: usize = 8;

/// Largest request body, in bytes: a request is a few names and numbers.
const BODY_BYTES_MAX: usize = 64 << 10;

/// Largest body of a request that carries a model set: 16 MiB of MODELS.json, its quotes and line ends escaped.
const MODELS_BYTES_MAX: usize = 17 << 20;

/// One page, shared by all its connections.
pub(crate) struct Site {
    services: SharedServices,
    history: Arc<History>,
    methods: Methods,
    /// Names beside localhost that it answers to.
    names: Vec<String>,
    limits: Limits,
    streams: Arc<Semaphore>,
}

type Shared = State<Arc<Site>>;

/// What a site answers by path. Whatever is no path of its own is a call.
pub(crate) fn router(site: Site) -> Router {
    let site = Arc::new(site);
    let mut router = Router::new();
    for &(path, kind, content) in assets::FILES {
        router = router.route(path, get(move || async move { ([(CONTENT_TYPE, kind)], content) }));
    }
    router = router.route("/metrics", get(metrics)).route("/streams", get(streams)).route("/history", get(history));
    router = router.fallback(call);
    router.layer(from_fn_with_state(Arc::clone(&site), guard)).with_state(site)
}

/// Before all paths: who may ask, and what every answer has. The connection is busy until the answer is out.
async fn guard(State(site): Shared, Extension(client): Extension<Client>, request: Request, next: Next) -> Response {
    let busy = client.seat.begin();
    let (uri, headers) = (request.uri(), request.headers());
    // A link from elsewhere may open the page itself: it shows nothing before its own scripts ask.
    let is_file = assets::FILES.iter().any(|(path, ..)| *path == uri.path());
    let allowed =
        check_host(uri, headers, &site.names).and_then(|()| if is_file { Ok(()) } else { check_origin(headers) });
    let response = match allowed {
        Ok(()) => next.run(request).await,
        Err(status) => refusal(&status),
    };
    hardened(response).map(|body| Body::new(Answer::of(busy, body)))
}

async fn metrics(State(site): Shared, Extension(client): Extension<Client>, headers: HeaderMap) -> Response {
    match metrics::text(&site.services, &Caller::new(&client, &headers)).await {
        Ok(text) => ([(CONTENT_TYPE, OPEN_METRICS)], text).into_response(),
        Err(status) => refusal(&status),
    }
}

async fn streams(State(site): Shared, Extension(client): Extension<Client>, uri: Uri, headers: HeaderMap) -> Response {
    let caller = Caller::new(&client, &headers);
    let answer = match calls_of(uri.query().unwrap_or_default()) {
        Ok(calls) => site.streams(calls, &caller).await,
        Err(status) => Err(status),
    };
    answer.unwrap_or_else(|status| refusal(&status))
}

async fn history(State(site): Shared, Extension(client): Extension<Client>, uri: Uri, headers: HeaderMap) -> Response {
    let caller = Caller::new(&client, &headers);
    site.history(uri.query().unwrap_or_default(), &caller).await.unwrap_or_else(|status| refusal(&status))
}

/// A call by its path.
async fn call(State(site): Shared, Extension(client): Extension<Client>, request: Request) -> Response {
    let caller = Caller::new(&client, request.headers());
    site.call(request, &caller).await.unwrap_or_else(|status| refusal(&status))
}

impl Site {
    /// The site over these services.
    pub(crate) fn new(
        services: SharedServices,
        history: Arc<History>,
        names: Vec<String>,
        limits: Limits,
    ) -> Result<Self, prost_reflect::DescriptorError> {
        let streams = Arc::new(Semaphore::new(limits.streams));
        Ok(Self { services, history, methods: Methods::new()?, names, limits, streams })
    }

    /// The forces of the last ten minutes of `patch=P`. Who may read the force now may read those.
    async fn history(&self, query: &str, caller: &Caller) -> Result<Response, Status> {
        let patch = form_urlencoded::parse(query.as_bytes()).find(|(name, _)| name == "patch");
        let request = PatchRequest { patch: patch.map(|(_, patch)| patch.into_owned()).unwrap_or_default() };
        let mut force = ForceServiceClient::new(self.services.clone());
        let patch = force.get_force(caller.request(request)).await?.into_inner().patch;
        Ok(json_of(&self.history.of(&patch)))
    }

    async fn call(&self, request: Request, caller: &Caller) -> Result<Response, Status> {
        let method = self.methods.find(request.uri().path().strip_prefix('/').unwrap_or_default())?;
        match (request.method(), method.streams()) {
            (&Verb::GET, true) => {
                let query = request.uri().query().unwrap_or_default();
                let fields = form_urlencoded::parse(query.as_bytes()).into_owned().collect();
                self.streams(vec![(method.path(), fields)], caller).await
            }
            (_, true) => Ok(wrong_method("GET", "this call streams: its fields go into the query of a GET")),
            (&Verb::POST, false) => self.unary(&method, request, caller).await,
            (_, false) => Ok(wrong_method("POST", "this call takes the JSON of its request by POST")),
        }
    }

    async fn unary(&self, method: &Method, request: Request, caller: &Caller) -> Result<Response, Status> {
        // A form of another site cannot send this type without asking first.
        let kind = request.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
        if !kind.split(';').next().is_some_and(|kind| kind.trim().eq_ignore_ascii_case(JSON)) {
            let wrong = Refusal::unreadable("expected the header Content-Type: application/json").into();
            return Ok(refusal_as(StatusCode::UNSUPPORTED_MEDIA_TYPE, &wrong));
        }
        let limit = if method.takes_models() { MODELS_BYTES_MAX } else { BODY_BYTES_MAX };
        let body = match self.body(request.into_body(), limit).await {
            Ok(body) => body,
            Err(refused) => return Ok(refused),
        };
        let message = method.request(&body)?;
        drop(body);
        Ok(json_of(&unary(&self.services, method, caller.request(message)).await?))
    }

    /// The body of a request, or why there is none.
    async fn body(&self, body: Body, limit: usize) -> Result<Bytes, Response> {
        let (http, status) = match tokio::time::timeout(self.limits.body, Limited::new(body, limit).collect()).await {
            Ok(Ok(body)) => return Ok(body.to_bytes()),
            Ok(Err(error)) if error.is::<LengthLimitError>() => {
                let why = format!("the body is longer than {limit} bytes");
                let long = Refusal::new(Code::OutOfRange, ErrorReason::FieldInvalid, why);
                (StatusCode::PAYLOAD_TOO_LARGE, long)
            }
            Ok(Err(error)) => (StatusCode::BAD_REQUEST, Refusal::unreadable(format!("the body did not come: {error}"))),
            Err(_) => {
                let why = format!("the body took longer than {:?}", self.limits.body);
                let slow = Refusal::new(Code::DeadlineExceeded, ErrorReason::FieldInvalid, why);
                (StatusCode::REQUEST_TIMEOUT, slow)
            }
        };
        Err(refusal_as(http, &status.into()))
    }

    /// The answer that carries the streams of these calls. All are begun before it is sent, so that a refusal of any is
    /// the answer.
    async fn streams(&self, calls: Vec<Call>, caller: &Caller) -> Result<Response, Status> {
        if calls.is_empty() || calls.len() > STREAMS_PER_ANSWER {
            let why = format!("{} calls: expected 1 to {STREAMS_PER_ANSWER}", calls.len());
            return Err(Refusal::unreadable(why).into());
        }
        let mut sources = Vec::new();
        for (call, fields) in calls {
            let method = self.methods.find(&call)?;
            if !method.streams() {
                return Err(Refusal::unreadable(format!("`{call}` does not stream: POST to it")).into());
            }
            let message = method.request_of(&fields)?;
            let place = Arc::clone(&self.streams).try_acquire_owned().map_err(|_| {
                let why = format!("{} streams are open over HTTP, which is the limit", self.limits.streams);
                Refusal::exhausted(ErrorReason::DaemonBusy, why)
            })?;
            let messages = streaming(&self.services, &method, caller.request(message)).await?;
            sources.push(Source { call, messages, _place: place });
        }
        Ok(events(sources, self.limits.comment))
    }
}

/// A call and the fields of its request.
type Call = (String, Vec<(String, String)>);

/// `call=A/B&rateHz=1&call=C/D`: the fields after a call are its own.
fn calls_of(query: &str) -> Result<Vec<Call>, Status> {
    let mut calls: Vec<Call> = Vec::new();
    for (name, value) in form_urlencoded::parse(query.as_bytes()).into_owned() {
        match calls.last_mut() {
            _ if name == "call" => calls.push((value, Vec::new())),
            Some((_, fields)) => fields.push((name, value)),
            None => return Err(Refusal::unreadable("the query begins with call=taxel.v1.Service/Method").into()),
        }
    }
    Ok(calls)
}
