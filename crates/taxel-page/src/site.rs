//! What each path answers.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use http_body_util::{BodyExt, LengthLimitError, Limited};
use hyper::body::{Body as _, Bytes, Incoming};
use hyper::header::CONTENT_TYPE;
use hyper::{Method as Verb, Request, Response, StatusCode};
use prost_reflect::DynamicMessage;
use taxel_proto::code_name;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::{Code, Status};

use crate::answer::{Body, JSON, closing, hardened, json_bytes, json_of, refusal, refusal_as};
use crate::answer::{whole, with_place, wrong_method};
use crate::assets;
use crate::call::{Caller, Permits, Services, begin};
use crate::events::{Source, events};
use crate::large_answers::LargeAnswers;
use crate::limits::Limits;
use crate::methods::{Method, Methods};
use crate::metrics::{Metrics, OPEN_METRICS};
use crate::origin::{check_host, check_origin};
use crate::places::{Place, Served};

/// What a site serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shows {
    /// The page, and the service as JSON.
    Page,
    /// The metrics at `/metrics`.
    Metrics,
    /// Both.
    All,
}

/// One page, shared by all its connections.
pub(crate) struct Site {
    services: Services,
    permits: Permits,
    shows: Shows,
    metrics: Metrics,
    methods: Methods,
    /// Names beside localhost that it answers to.
    names: Vec<String>,
    limits: Limits,
    streams: Arc<Semaphore>,
    large_bodies: Arc<Semaphore>,
    large_answers: LargeAnswers,
}

impl Site {
    /// The site over these services.
    pub(crate) fn new(
        (services, permits): (Services, Permits),
        shows: Shows,
        names: Vec<String>,
        limits: Limits,
    ) -> Result<Self, prost_reflect::DescriptorError> {
        let streams = Arc::new(Semaphore::new(limits.streams));
        let large_bodies = Arc::new(Semaphore::new(limits.large_bodies));
        let large_answers = LargeAnswers::new(limits.large_answers, limits.large_answer);
        let (metrics, methods) = (Metrics::new(), Methods::new()?);
        Ok(Self { services, permits, shows, metrics, methods, names, limits, streams, large_bodies, large_answers })
    }

    /// Answers one request.
    pub(crate) async fn answer(
        &self,
        mut request: Request<Incoming>,
        address: SocketAddr,
        place: Arc<Place>,
    ) -> Response<Body> {
        let head = *request.method() == Verb::HEAD;
        if request.body().is_end_stream() {
            place.serve();
        }
        request.extensions_mut().insert(Arc::clone(&place)); // whoever reads the body knows when it is there
        let mut response = hardened(self.route(request, address).await.unwrap_or_else(|status| refusal(&status)));
        if head {
            *response.body_mut() = http_body_util::Empty::new().boxed_unsync();
        }
        response.map(|body| Served { body, place }.boxed_unsync())
    }

    async fn route(&self, request: Request<Incoming>, address: SocketAddr) -> Result<Response<Body>, Status> {
        check_host(request.uri(), request.headers(), &self.names)?;
        let reads = matches!(*request.method(), Verb::GET | Verb::HEAD);
        let path = request.uri().path();
        if path == "/metrics" && self.shows != Shows::Page {
            check_origin(request.headers())?;
            let caller = Caller::new(address, request.headers());
            let text = self.metrics.text(&self.services, &caller);
            return if reads {
                Ok(whole(StatusCode::OK, OPEN_METRICS, text.await?))
            } else {
                Ok(wrong_method("GET", "the metrics are only read"))
            };
        }
        if self.shows == Shows::Metrics {
            return Err(Refusal::not_found(ErrorReason::PathUnknown, "the metrics are at /metrics").into());
        }
        // A link from elsewhere may open the page itself: it shows nothing before its own scripts ask.
        if let Some(file) = assets::find(path) {
            return Ok(if reads { file } else { wrong_method("GET, HEAD", "a file is only read") });
        }
        check_origin(request.headers())?;
        let caller = Caller::new(address, request.headers());
        match path {
            "/methods" if reads => Ok(json_of(&self.methods.list())),
            "/streams" if *request.method() == Verb::GET => {
                self.streams(calls_of(request.uri().query().unwrap_or_default())?, &caller).await
            }
            "/methods" | "/streams" => Ok(wrong_method("GET", "this is only read")),
            _ => self.call(request, &caller).await,
        }
    }

    /// A call by its path.
    async fn call(&self, request: Request<Incoming>, caller: &Caller) -> Result<Response<Body>, Status> {
        let method = self.methods.find(request.uri().path().strip_prefix('/').unwrap_or_default())?;
        let wanted = if method.streams() { Verb::GET } else { Verb::POST };
        match *request.method() {
            Verb::GET if method.streams() => {
                let query = request.uri().query().unwrap_or_default();
                let fields = form_urlencoded::parse(query.as_bytes()).into_owned().collect();
                self.streams(vec![(method.path(), fields)], caller).await
            }
            Verb::POST if !method.streams() => self.unary(&method, request, caller).await,
            _ if wanted == Verb::GET => {
                Ok(wrong_method("GET", "this call streams: its fields go into the query of a GET"))
            }
            _ => Ok(wrong_method("POST", "this call takes the JSON of its request by POST")),
        }
    }

    async fn unary(
        &self,
        method: &Method,
        request: Request<Incoming>,
        caller: &Caller,
    ) -> Result<Response<Body>, Status> {
        // A form of another site cannot send this type without asking first.
        let kind = request.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
        if !kind.split(';').next().is_some_and(|kind| kind.trim().eq_ignore_ascii_case(JSON)) {
            let wrong = Refusal::unreadable("expected the header Content-Type: application/json").into();
            return Ok(refusal_as(StatusCode::UNSUPPORTED_MEDIA_TYPE, &wrong));
        }
        if let Err(status) = (self.permits)(caller, &format!("/{}", method.path())) {
            self.metrics.called(method.path(), code_name(status.code()), Duration::ZERO);
            return Ok(closing(refusal(&status))); // the body may be on its way
        }
        let (limit, _place) = self.body_limit(method, &request)?;
        if request.body().size_hint().lower() > limit as u64 {
            return Ok(too_large(limit)); // at once: the rest may never come
        }
        let connection = request.extensions().get::<Arc<Place>>().cloned();
        let body = Limited::new(request.into_body(), limit).collect();
        let body: Bytes = match tokio::time::timeout(self.limits.body, body).await {
            Ok(Ok(body)) => body.to_bytes(),
            Ok(Err(error)) if error.is::<LengthLimitError>() => return Ok(too_large(limit)),
            Ok(Err(error)) => return Err(Refusal::unreadable(format!("the body did not come: {error}")).into()),
            Err(_) => {
                let why = format!("the body took longer than {:?}", self.limits.body);
                let slow = Refusal::new(Code::DeadlineExceeded, ErrorReason::BodyRefused, why).into();
                return Ok(closing(refusal_as(StatusCode::REQUEST_TIMEOUT, &slow)));
            }
        };
        connection.iter().for_each(|place| place.serve());
        let message = method.request(&body)?;
        drop(body);
        let begun = Instant::now();
        let answer = match begin(self.services.clone(), method, &message, caller).await {
            Ok(answer) => answer.only().await.and_then(|message| self.answered(&message, connection.as_deref())),
            Err(status) => Err(status),
        };
        let code = answer.as_ref().map_or_else(tonic::Status::code, |_| Code::Ok);
        self.metrics.called(method.path(), code_name(code), begun.elapsed());
        answer
    }

    /// The answer with this message over this connection. A large one needs a place until it is out: what the services held
    /// for it they have given back, and a reader takes as long over it as it likes, until another one needs its place. Only
    /// calls that read have large answers, so that none is refused whose work is done.
    fn answered(&self, message: &DynamicMessage, connection: Option<&Place>) -> Result<Response<Body>, Status> {
        let json = json_bytes(message)?;
        let Limits { large_answer_bytes: small, large_answers: most, .. } = self.limits;
        if json.len() <= small {
            return Ok(whole(StatusCode::OK, JSON, json));
        }
        let cut = connection.map(Place::cut).unwrap_or_default();
        let place = self.large_answers.begin(Instant::now(), cut).ok_or_else(|| {
            let why =
                format!("{most} answers of more than {small} bytes are on their way over HTTP, which is the limit");
            Refusal::exhausted(ErrorReason::NoPlace, why + ": read them to their ends, or try again later")
        })?;
        Ok(whole(StatusCode::OK, JSON, with_place(json, place)))
    }

    /// How long the body may be, with the place that a large one takes.
    fn body_limit(
        &self,
        method: &Method,
        request: &Request<Incoming>,
    ) -> Result<(usize, Option<OwnedSemaphorePermit>), Status> {
        let small = self.limits.body_bytes;
        let told = request.body().size_hint().exact();
        if !method.takes_models() || told.is_some_and(|bytes| bytes <= small as u64) {
            return Ok((small, None));
        }
        let place = Arc::clone(&self.large_bodies).try_acquire_owned();
        let place = place.map_err(|_| {
            Refusal::exhausted(ErrorReason::NoPlace, "another model set is being sent: try again later")
        })?;
        Ok((self.limits.models_bytes, Some(place)))
    }

    /// The answer that carries the streams of these calls. All are begun before it is sent, so that a refusal of any is
    /// the answer.
    async fn streams(&self, calls: Vec<Call>, caller: &Caller) -> Result<Response<Body>, Status> {
        let most = self.limits.streams_per_answer;
        if calls.is_empty() || calls.len() > most {
            return Err(Refusal::unreadable(format!("{} calls: expected 1 to {most}", calls.len())).into());
        }
        let mut sources = Vec::new();
        for (path, fields) in calls {
            let method = self.methods.find(&path)?;
            if !method.streams() {
                return Err(Refusal::unreadable(format!("`{path}` does not stream: POST to it")).into());
            }
            let message = method.request_of(&fields)?;
            let place = Arc::clone(&self.streams).try_acquire_owned().map_err(|_| {
                let limit = self.limits.streams;
                let why = format!("{limit} streams are open over HTTP, which is the limit");
                Refusal::exhausted(ErrorReason::NoPlace, why)
            })?;
            let answer = begin(self.services.clone(), &method, &message, caller).await?;
            sources.push(Source { call: path, answer, place });
        }
        Ok(events(sources, self.limits.comment))
    }
}

fn too_large(limit: usize) -> Response<Body> {
    let why = format!("the body is longer than {limit} bytes");
    let long = Refusal::new(Code::OutOfRange, ErrorReason::BodyRefused, why).into();
    closing(refusal_as(StatusCode::PAYLOAD_TOO_LARGE, &long))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_belong_to_the_call_before_them() {
        let calls = calls_of("call=A%2FB&rateHz=30&patch=a+b&call=C/D").unwrap();
        let field = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        let first = ("A/B".to_owned(), vec![field("rateHz", "30"), field("patch", "a b")]);
        assert_eq!(calls, [first, ("C/D".to_owned(), Vec::new())]);
        assert!(calls_of("rateHz=30&call=A/B").is_err());
        assert_eq!(calls_of("").unwrap(), []);
    }
}
