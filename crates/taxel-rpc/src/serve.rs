//! The server: all services on one listener, with limits, until the shutdown and no longer than the drain.

use std::convert::Infallible;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use taxel_proto::v1::audit_service_server::AuditServiceServer;
use taxel_proto::v1::calibration_service_server::CalibrationServiceServer;
use taxel_proto::v1::force_service_server::ForceServiceServer;
use taxel_proto::v1::ingest_service_server::IngestServiceServer;
use taxel_proto::v1::model_service_server::ModelServiceServer;
use taxel_proto::v1::skin_service_server::SkinServiceServer;
use taxel_proto::v1::validation_service_server::ValidationServiceServer;
use thiserror::Error;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use tonic::body::Body;
use tonic::codegen::{Service as Serves, http};
use tonic::server::NamedService;
use tonic::service::Routes;
use tonic::transport::Server;
use tonic_health::server::HealthReporter;
use tower_layer::Layer;

use crate::access::layer::Gate;
use crate::access::rules::Access;
use crate::access::table::IMPORT;
use crate::answers::Answers;
use crate::guard::Guard;
use crate::handle::Handle;
use crate::health::Report;
use crate::limits::Limits;
use crate::listener::{Listener, accept};
use crate::refusals::Refusals;
use crate::service::Service;
use crate::shared::SharedServices;
use crate::shares::Shares;
use crate::turns::Turns;
use crate::unproven::Unproven;
use crate::watchdog::Watchdog;

/// How a server ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drain {
    /// Every call had ended and every connection was closed in time.
    Clean,
    /// Some connections were still open at the deadline and were cut.
    Cut,
}

/// Why there is no server.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The compiled-in description of the service is broken.
    #[error("the service descriptors cannot be read")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// A listener cannot be used.
    #[error("a listener cannot be used")]
    Listener(#[from] std::io::Error),
    /// The server itself failed.
    #[error("the gRPC server failed")]
    Server(#[from] tonic::transport::Error),
}

/// Pending resets that a peer may pile up before its connection is closed (the "rapid reset" attack).
const PENDING_RESETS_MAX: usize = 20;

/// Requests that are none, or are beyond [`Limits::calls_per_connection`], before their connection is closed. Each is answered
/// by a reset, which waits in memory for a peer that reads nothing. hyper's own bound is the same; tonic takes it away unless
/// it is given one.
const ERROR_RESETS_MAX: usize = 1024;

/// A cut connection ends as soon as its task runs; a server that takes longer is left behind.
const CUT_MAX: Duration = Duration::from_secs(1);

/// Serves everything on all `listeners` until the shutdown of `handle`, then at most [`Limits::drain`] longer. Each call is
/// let through by `access`.
///
/// # Errors
/// [`ServeError`] if the server cannot be set up or fails; a failing connection or call is not an error of the server.
pub async fn serve(
    handle: Handle,
    listeners: Vec<Listener>,
    access: Access,
    limits: Limits,
) -> Result<Drain, ServeError> {
    serve_and_share(handle, listeners, access, limits, |_| {}).await
}

/// The same, and hands the services to `share` once they are there: whoever has them calls them without a socket, let
/// through by the same rules, checks and limits, from any runtime.
///
/// # Errors
/// As [`serve`].
pub async fn serve_and_share(
    handle: Handle,
    listeners: Vec<Listener>,
    access: Access,
    limits: Limits,
    share: impl FnOnce(SharedServices),
) -> Result<Drain, ServeError> {
    let (wake, woken) = watch::channel(());
    let turns = Turns::begin(handle.patches.iter().map(|feed| (feed.snapshot.clone(), feed.soon.clone())), &woken);
    let shutdown = handle.shutdown.clone();
    let (drain, cut) = (limits.drain, CancellationToken::new());
    let (shares, refusals) = (Shares::new(&limits), Arc::new(Refusals::default()));
    let answers = Answers::new(limits.unread, Arc::clone(&refusals));
    let ledgers = (Arc::clone(&shares), Arc::clone(&refusals));
    let gate = Gate::new(access.clone(), ledgers, Arc::clone(&answers), &limits);
    let guard = Guard {
        access,
        shares: Arc::clone(&shares),
        refusals: Arc::clone(&refusals),
        unproven: Unproven::new(limits.unproven),
        limits: Arc::new(limits.clone()),
        cut: cut.clone(),
    };
    let incoming = accept(listeners, &guard)?;
    let reporter = HealthReporter::new();
    let service = Service::new(handle.clone(), turns, limits.clone(), shares, Arc::clone(&refusals));
    let routes = routes(service, &reporter)?;
    share(SharedServices::new(gate.layer(routes.clone())));
    let server = server(&limits).layer(gate).add_routes(routes);
    let server = server.serve_with_incoming_shutdown(incoming, shutdown.clone().cancelled_owned());
    let overdue = async {
        shutdown.cancelled().await;
        tokio::time::sleep(drain).await;
    };
    let report = Report::begin(handle.clone(), reporter).await;
    let watchdog = Watchdog::new(handle, report, wake);
    tokio::pin!(server);
    tokio::select! {
        served = &mut server => return Ok(served.map(|()| Drain::Clean)?),
        never = watchdog.keep() => match never {},
        never = refusals.keep() => match never {},
        never = answers.keep() => match never {},
        () = overdue => {}
    }
    tracing::warn!("connections were still open {} s after the shutdown began: cut", drain.as_secs_f64());
    cut.cancel();
    tokio::time::timeout(CUT_MAX, server).await.unwrap_or(Ok(()))?;
    Ok(Drain::Cut)
}

fn server(limits: &Limits) -> Server {
    let [of_stream, of_connection] = limits.ahead_bytes;
    Server::builder()
        .initial_stream_window_size(of_stream)
        .initial_connection_window_size(of_connection)
        // Covers a call up to the head of its answer, so that a request that never ends is no place to hide.
        .timeout(limits.command + limits.preface)
        .max_concurrent_streams(limits.calls_per_connection)
        .http2_keepalive_interval(Some(limits.keepalive_interval))
        .http2_keepalive_timeout(Some(limits.keepalive_timeout))
        .http2_max_header_list_size(limits.header_bytes)
        .http2_max_pending_accept_reset_streams(Some(PENDING_RESETS_MAX))
        .http2_max_local_error_reset_streams(Some(ERROR_RESETS_MAX))
}

fn routes(service: Service, reporter: &HealthReporter) -> Result<Routes, ServeError> {
    let (small, large) = (service.limits.request_bytes, service.limits.models_bytes);
    macro_rules! limited {
        ($server:expr, $request_bytes:expr) => {
            $server.max_decoding_message_size($request_bytes).max_encoding_message_size(large)
        };
    }
    let health = tonic_health::server::HealthService::from_health_reporter(reporter.clone());
    // grpcurl up to 1.8.6 knows only v1alpha; a client asks for health by reflection as for any other service.
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(taxel_proto::DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    Ok(Routes::default()
        .add_service(limited!(ForceServiceServer::new(service.clone()), small))
        .add_service(limited!(SkinServiceServer::new(service.clone()), small))
        .add_service(limited!(CalibrationServiceServer::new(service.clone()), small))
        .add_service(limited!(ValidationServiceServer::new(service.clone()), small))
        .add_service(limited!(AuditServiceServer::new(service.clone()), small))
        .add_service(limited!(IngestServiceServer::new(service.clone()), small))
        .add_service(Models {
            usual: limited!(ModelServiceServer::new(service.clone()), small),
            import: limited!(ModelServiceServer::new(service), large),
        })
        .add_service(limited!(tonic_health::pb::health_server::HealthServer::new(health), small))
        .add_service(limited!(reflection().build_v1()?, small))
        .add_service(limited!(reflection().build_v1alpha()?, small))
        .prepare())
}

/// `ModelService`. A limit of requests is a service's; of this one, one method alone takes large ones.
#[derive(Clone)]
struct Models {
    usual: ModelServiceServer<Service>,
    import: ModelServiceServer<Service>,
}

impl NamedService for Models {
    const NAME: &'static str = ModelServiceServer::<Service>::NAME;
}

impl Serves<http::Request<Body>> for Models {
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = <ModelServiceServer<Service> as Serves<http::Request<Body>>>::Future;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        let is_import = request.uri().path().strip_prefix('/') == Some(IMPORT);
        if is_import { self.import.call(request) } else { self.usual.call(request) }
    }
}
