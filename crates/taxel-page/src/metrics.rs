//! Metrics in the OpenMetrics text format, made at each scrape from what the service answers.
//!
//! Nothing is gathered between scrapes. Names follow the conventions of Prometheus: base units, `_total` for counters, an
//! `_info` for what is text.

use std::sync::atomic::AtomicU64;

use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_rpc::SharedServices;
use tonic::Status;

use crate::call::Caller;

/// The content type of what [`text`] gives.
pub(crate) const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

type Labels = Vec<(&'static str, String)>;
type Gauges = Family<Labels, Gauge<f64, AtomicU64>>;
type Counters = Family<Labels, Counter>;

/// Everything now, as far as `caller` may read it.
pub(crate) async fn text(services: &SharedServices, caller: &Caller) -> Result<String, Status> {
    let mut skin = SkinServiceClient::new(services.clone());
    let health = skin.get_health(caller.request(())).await?.into_inner();
    let mut sheet = Sheet::new();
    daemon(&mut sheet, &health);
    // What an engine that stands still said last is nothing that is so now; what it has counted stays so.
    let runs = health.engine_stalled_s.is_none();
    buses(&mut sheet, &health.buses, runs);
    boards(&mut sheet, &health.boards, runs);
    patches(&mut sheet, &health.patches, runs);
    let mut force = ForceServiceClient::new(services.clone());
    let mut samples = Vec::new();
    for v1::PatchHealth { patch, .. } in &health.patches {
        let request = caller.request(v1::PatchRequest { patch: patch.clone() });
        samples.push(force.get_force(request).await?.into_inner());
    }
    forces(&mut sheet, &samples);
    sheet.text()
}

/// One scrape.
struct Sheet {
    registry: Registry,
}

impl Sheet {
    fn new() -> Self {
        Self { registry: Registry::with_prefix("taxeld") }
    }

    /// A gauge with a value for each of these labels.
    fn gauge(&mut self, name: &str, help: &str, values: impl IntoIterator<Item = (Labels, f64)>) {
        let family = Gauges::default();
        for (labels, value) in values {
            family.get_or_create(&labels).set(value);
        }
        self.registry.register(name, help, family);
    }

    /// A counter, likewise; the format adds `_total` to its name.
    fn counter(&mut self, name: &str, help: &str, values: impl IntoIterator<Item = (Labels, u64)>) {
        let family = Counters::default();
        for (labels, value) in values {
            family.get_or_create(&labels).inc_by(value);
        }
        self.registry.register(name, help, family);
    }

    fn text(&self) -> Result<String, Status> {
        let mut text = String::new();
        encode(&mut text, &self.registry).map_err(|error| Refusal::fault(format!("the metrics: {error}")))?;
        Ok(text)
    }
}

fn flag(is: bool) -> f64 {
    f64::from(u8::from(is))
}

fn daemon(sheet: &mut Sheet, health: &v1::Health) {
    let version = vec![("version", env!("CARGO_PKG_VERSION").to_owned())];
    sheet.gauge("build_info", "Version of the daemon; always 1", [(version, 1.0)]);
    let runs = flag(health.engine_stalled_s.is_none());
    sheet.gauge(
        "engine_running",
        "Whether the engine runs; else buses, boards and zeros are not known",
        [(vec![], runs)],
    );
    sheet.gauge("problems", "Problems that the health names", [(vec![], health.problems.len() as f64)]);
    sheet.gauge("streams", "Streams that are being served", [(vec![], f64::from(health.streams))]);
    sheet.gauge("streams_max", "Streams that can be served at once", [(vec![], f64::from(health.streams_max))]);
}

fn buses(sheet: &mut Sheet, buses: &[v1::BusHealth], runs: bool) {
    let labels = |bus: &v1::BusHealth| vec![("bus", bus.bus.to_string())];
    let now = buses.iter().filter(|_| runs);
    sheet.gauge("bus_up", "Whether frames can come", now.map(|bus| (labels(bus), flag(bus.up))));
    let mut counter = |name: &str, help: &str, value: fn(&v1::BusHealth) -> u64| {
        sheet.counter(name, help, buses.iter().map(|bus| (labels(bus), value(bus))));
    };
    counter("bus_frames", "Frames that were understood", |bus| bus.frames);
    counter("bus_foreign_frames", "Frames that concern nobody here", |bus| bus.foreign);
    counter("bus_malformed_frames", "Frames of this configuration with a content that cannot be", |bus| bus.malformed);
    counter("bus_dropped_frames", "Frames that the kernel lost", |bus| bus.dropped);
}

fn boards(sheet: &mut Sheet, boards: &[v1::BoardHealth], runs: bool) {
    let labels = |board: &v1::BoardHealth| {
        vec![("patch", board.patch.clone()), ("bus", board.bus.to_string()), ("address", board.address.to_string())]
    };
    let mut gauge = |name: &str, help: &str, value: fn(&v1::BoardHealth) -> Option<f64>| {
        let now = boards.iter().filter(|_| runs);
        sheet.gauge(name, help, now.filter_map(|board| Some((labels(board), value(board)?))));
    };
    gauge("board_verified", "Whether its configuration is verified", |board| Some(flag(board.bring_up == "verified")));
    gauge("board_modules_enabled", "Modules that are enabled", |board| Some(board.modules_enabled.into()));
    gauge("board_modules_fresh", "Enabled modules that send", |board| Some(board.modules_fresh.into()));
    gauge("board_temperature_celsius", "Temperature, where the board sends one", |board| board.celsius);
    let mut counter = |name: &str, help: &str, value: fn(&v1::BoardHealth) -> u64| {
        sheet.counter(name, help, boards.iter().map(|board| (labels(board), value(board))));
    };
    counter("board_scans", "Whole modules received", |board| board.scans);
    counter("board_orphan_frames", "Heads without tail and tails without head", |board| board.orphans);
    counter("board_status_errors", "Tails whose status word named a trouble", |board| board.status_errors);
}

fn patches(sheet: &mut Sheet, patches: &[v1::PatchHealth], runs: bool) {
    let labels = |patch: &v1::PatchHealth| vec![("patch", patch.patch.clone())];
    let mut gauge = |name: &str, help: &str, value: fn(&v1::PatchHealth) -> Option<f64>| {
        let now = patches.iter().filter(|_| runs);
        sheet.gauge(name, help, now.filter_map(|patch| Some((labels(patch), value(patch)?))));
    };
    gauge("zero_valid", "Whether live force may rely on the zero", |patch| Some(flag(patch.tare.as_ref()?.valid)));
    gauge("zero_drift_counts", "How far the zero has followed the temperature, median", |patch| {
        Some(patch.tare.as_ref()?.drift_median_counts)
    });
    gauge("faulty_taxels", "Taxels with a fault now", |patch| Some(patch.faulty.len() as f64));
    let epoch = |patch: &v1::PatchHealth| Some((labels(patch), patch.tare.as_ref()?.epoch));
    sheet.counter("zero_changes", "Zeros taken or lost", patches.iter().filter_map(epoch));
}

fn forces(sheet: &mut Sheet, samples: &[v1::ForceSample]) {
    let labels = |sample: &v1::ForceSample| vec![("patch", sample.patch.clone())];
    let mut gauge = |name: &str, help: &str, value: fn(&v1::ForceSample) -> Option<f64>| {
        sheet.gauge(name, help, samples.iter().filter_map(|sample| Some((labels(sample), value(sample)?))));
    };
    gauge("force_newtons", "Total normal force; absent while there is none", |sample| sample.total_n);
    gauge("force_sigma_newtons", "Its standard uncertainty", |sample| sample.total_sigma_n);
    gauge("force_low_newtons", "Lower end of the 95 % interval", |sample| sample.low_n);
    gauge("force_high_newtons", "Upper end; absent where nothing bounds the force above", |sample| sample.high_n);
    gauge("force_undetected_newtons", "Upper bound (95 %) of force that is not detected", |sample| sample.undetected_n);
    gauge("force_simulated", "1 where a simulator or a replay makes the force, and no skin is touched", |sample| {
        Some(flag(sample.simulated))
    });
    gauge("force_age_seconds", "Age of the newest frame in the force", |sample| sample.age_s);
    let samples_sent = samples.iter().map(|sample| (labels(sample), sample.sequence));
    sheet.counter("force_samples", "States of the patch that were published", samples_sent);
    let kinds = |sample: &v1::ForceSample| {
        let of = [
            ("active", sample.active),
            ("excluded", sample.excluded),
            ("stale", sample.stale),
            ("out_of_range", sample.out_of_range),
        ];
        let patch = sample.patch.clone();
        of.map(|(kind, n)| (vec![("patch", patch.clone()), ("kind", kind.to_owned())], f64::from(n)))
    };
    sheet.gauge("taxels", "Taxels by what they are in the force now", samples.iter().flat_map(kinds));
    let states = (1..=5).filter_map(|number| v1::ForceState::try_from(number).ok());
    let is = |state: v1::ForceState, sample: &v1::ForceSample| {
        (vec![("patch", sample.patch.clone()), ("state", word(state))], flag(sample.state() == state))
    };
    let all = states.flat_map(|state| samples.iter().map(move |sample| is(state, sample)));
    sheet.gauge("force_state", "1 for the state that the force is in", all);
    let set = |sample: &v1::ForceSample| {
        (vec![("patch", sample.patch.clone()), ("model_set", sample.model_set.clone())], 1.0)
    };
    let active = samples.iter().filter(|sample| !sample.model_set.is_empty()).map(set);
    sheet.gauge("model_set_info", "The model set in use; always 1", active);
}

/// A state as a label.
fn word(state: v1::ForceState) -> String {
    state.as_str_name().trim_start_matches("FORCE_STATE_").to_ascii_lowercase()
}
