//! The server: all services on one listener, with limits, until the shutdown and no longer than the drain.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use axum::middleware::from_fn_with_state;
use taxel_proto::v1::audit_service_server::AuditServiceServer;
use taxel_proto::v1::calibration_service_server::CalibrationServiceServer;
use taxel_proto::v1::force_service_server::ForceServiceServer;
use taxel_proto::v1::ingest_service_server::IngestServiceServer;
use taxel_proto::v1::model_service_server::ModelServiceServer;
use taxel_proto::v1::skin_service_server::SkinServiceServer;
use taxel_proto::v1::validation_service_server::ValidationServiceServer;
use tonic::service::Routes;
use tonic_health::server::HealthReporter;

use crate::access::layer::{Gate, guard};
use crate::access::rules::Access;
use crate::backend::Backend;
use crate::connections::Connections;
use crate::handle::Handle;
use crate::health::Report;
use crate::limits::{Limits, Shares};
use crate::listener::{Listener, accept};
use crate::refusals::Refusals;
use crate::service::Service;

/// A connection is closed whose peer has not answered a ping after this time.
const PING_MAX: Duration = Duration::from_secs(5);

/// Pending resets that a peer may pile up before its connection is closed (the "rapid reset" attack).
const PENDING_RESETS_MAX: usize = 20;

/// Calls at once on one connection; the client queues further ones. Well above the streams of one peer, so that one stream
/// too many is refused with its reason and calls beside the streams go on.
const CALLS_PER_CONNECTION: u32 = 256;

/// What a client may send ahead of what is read, on one stream and on one connection, in bytes.
const STREAM_AHEAD_BYTES: u32 = 64 << 10;
const CONNECTION_AHEAD_BYTES: u32 = 256 << 10;

/// Largest block of request headers, in bytes.
const HEADER_BYTES: u32 = 8 << 10;

/// Largest request with a model set, in bytes; of others tonic takes 4 MiB.
const MODELS_BYTES: usize = 16 << 20;

/// A request has to come whole within this time, beside what a command may take.
const REQUEST_MAX: Duration = Duration::from_secs(5);

/// Requests that are none, or are beyond [`CALLS_PER_CONNECTION`], before their connection is closed. Each is answered
/// by a reset, which waits in memory for a peer that reads nothing. hyper's own bound is the same; tonic takes it away unless
/// it is given one.
const ERROR_RESETS_MAX: usize = 1024;

/// The services without a socket, for the page. It gives the client's address as
/// [`TcpConnectInfo`](tonic::transport::server::TcpConnectInfo) and its `authorization`.
pub type SharedServices = Routes;

/// All services, before they are served.
pub struct Server {
    handle: Handle,
    limits: Limits,
    refusals: Arc<Refusals>,
    reporter: HealthReporter,
    routes: Routes,
}

impl Server {
    /// The services over this engine and backend. Each call is let through by `access`.
    ///
    /// # Errors
    /// If the compiled-in description of the service is broken.
    pub fn new(handle: Handle, backend: Arc<dyn Backend>, access: Access, limits: Limits) -> io::Result<Self> {
        let (shares, refusals) = (Arc::new(Shares::new(limits.clone())), Arc::new(Refusals::default()));
        let gate = Gate::new(access.clone(), Arc::clone(&shares), Arc::clone(&refusals));
        let reporter = HealthReporter::new();
        let service = Service { handle: handle.clone(), backend, limits: Arc::new(limits.clone()), shares, access };
        let routes = routes(service, &reporter).map_err(io::Error::other)?;
        let routes = Routes::from(routes.into_axum_router().layer(from_fn_with_state(gate, guard))).prepare();
        Ok(Self { handle, limits, refusals, reporter, routes })
    }

    /// The services without a socket, from any runtime, let through by the same rules and limits.
    #[must_use]
    pub fn shared(&self) -> SharedServices {
        self.routes.clone()
    }

    /// Serves everything on all `listeners` until the shutdown of the handle, then at most [`Limits::drain`] longer.
    ///
    /// # Errors
    /// If the server fails; a failing connection or call is not an error of the server.
    pub async fn serve(self, listeners: Vec<Listener>) -> io::Result<()> {
        let Self { handle, limits, refusals, reporter, routes } = self;
        let shutdown = handle.shutdown.clone();
        let connections = Connections::new(limits.clone(), Arc::clone(&refusals));
        let incoming = accept(listeners, &connections, &refusals)?;
        let server = tonic_server(&limits).add_routes(routes);
        let server = server.serve_with_incoming_shutdown(incoming, shutdown.clone().cancelled_owned());
        let overdue = async {
            shutdown.cancelled().await;
            tokio::time::sleep(limits.drain).await;
        };
        let report = Report::begin(handle, reporter).await;
        tokio::select! {
            served = server => return served.map_err(io::Error::other),
            never = report.keep() => match never {},
            never = connections.keep() => match never {},
            () = overdue => {}
        }
        tracing::warn!("connections were still open {} s after the shutdown began: cut", limits.drain.as_secs_f64());
        connections.end_all();
        Ok(())
    }
}

fn tonic_server(limits: &Limits) -> tonic::transport::Server {
    tonic::transport::Server::builder()
        .initial_stream_window_size(STREAM_AHEAD_BYTES)
        .initial_connection_window_size(CONNECTION_AHEAD_BYTES)
        // Covers a call up to the head of its answer, so that a request that never ends holds nothing for ever.
        .timeout(limits.command + REQUEST_MAX)
        .max_concurrent_streams(CALLS_PER_CONNECTION)
        .http2_keepalive_interval(Some(limits.keepalive_interval))
        .http2_keepalive_timeout(Some(PING_MAX))
        .http2_max_header_list_size(HEADER_BYTES)
        .http2_max_pending_accept_reset_streams(Some(PENDING_RESETS_MAX))
        .http2_max_local_error_reset_streams(Some(ERROR_RESETS_MAX))
}

fn routes(service: Service, reporter: &HealthReporter) -> Result<Routes, tonic_reflection::server::Error> {
    let health = tonic_health::server::HealthService::from_health_reporter(reporter.clone());
    // grpcurl up to 1.8.6 knows only v1alpha; a client asks for health by reflection as for any other service.
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(taxel_proto::DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    Ok(Routes::default()
        .add_service(ForceServiceServer::new(service.clone()))
        .add_service(SkinServiceServer::new(service.clone()))
        .add_service(CalibrationServiceServer::new(service.clone()))
        .add_service(ValidationServiceServer::new(service.clone()))
        .add_service(AuditServiceServer::new(service.clone()))
        .add_service(IngestServiceServer::new(service.clone()))
        .add_service(ModelServiceServer::new(service).max_decoding_message_size(MODELS_BYTES))
        .add_service(tonic_health::pb::health_server::HealthServer::new(health))
        .add_service(reflection().build_v1()?)
        .add_service(reflection().build_v1alpha()?))
}
