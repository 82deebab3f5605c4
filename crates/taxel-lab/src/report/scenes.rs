//! Section `scenes`: what a daemon costs that has everything switched on, against one with the shipped defaults, on the same
//! simulated traffic. The daemons run as processes and are read as clients read them.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use taxel_client::{Address, Line, Options};
use taxel_engine::calibration::fit::{FitRecipe, OneByOne, fit};
use taxel_engine::model_set::ModelSet;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use taxel_proto::v1::{ActivateModelSetRequest, ForceState, ImportModelSetRequest, StreamRequest, TareRequest};
use taxel_sim::Skin;
use taxel_store::models_json;
use tempfile::TempDir;
use tokio::time::timeout;

use super::args::ReportArgs;
use crate::document::{Aim, Section, Table, row};
use crate::forearm::{Forearm, recording};
use crate::numbers::digits;

/// A daemon that does not answer by then has failed.
const PATIENCE: Duration = Duration::from_secs(30);

/// Of the forearm, calibrated, with every output.
const MEMORY_AIM_MIB: f64 = 30.0;

/// The thread that plays the bus: none of the daemon's own time.
const SIMULATOR_THREAD: &str = "sim-bus";

/// Of the patch: nothing but the total force, and everything.
const LEAN: &str = "";
const FULL: &str = "geometry = \"positions.txt\"\noutputs = [\"resultant\", \"moment\", \"contacts\", \"fill\"]\n\
    gauge = { id = 0x3A1, signal = \"0|32@1-\", unit = \"Pa\" }\n";

/// What a daemon took while it was watched: name and value of each figure.
type Observed = [(&'static str, f64); 3];

/// Measures both.
///
/// # Errors
/// A daemon that cannot be started or comes to no force.
pub(super) fn section(args: &ReportArgs) -> anyhow::Result<Section> {
    let taxeld = match &args.taxeld {
        Some(taxeld) => taxeld.clone(),
        None => std::env::current_exe()?.with_file_name("taxeld"),
    };
    let models = models(args.seed)?;
    let window = Duration::from_secs(if args.quick { 3 } else { 20 });
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let observe = |patch: &str| {
        let daemon = Daemon::start(&taxeld, patch, args.seed)?;
        runtime.block_on(daemon.observe(&models, window)).with_context(|| daemon.complaints())
    };
    let (full, lean) = (observe(FULL)?, observe(LEAN)?);
    Ok(self::section_of(full, lean))
}

/// What a daemon on the simulated bus of this seed learns in the bag.
fn models(seed: u64) -> anyhow::Result<String> {
    let mut forearm = Forearm::new(&[], seed)?;
    let rest = forearm.rest();
    let calibration = recording(&forearm.cycle(70.0, 4.0));
    let set = fit(&calibration.as_scans(), &FitRecipe::default(), &OneByOne)?;
    let set = ModelSet { patch: "left_forearm".to_owned(), baseline: rest, ..set };
    Ok(models_json::to_json(&ModelSet { id: models_json::content_id(&set), ..set })?)
}

/// A running daemon in a folder of its own; both are gone when this is dropped.
struct Daemon {
    child: Child,
    folder: TempDir,
}

impl Daemon {
    fn start(taxeld: &Path, patch: &str, seed: u64) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir()?;
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("positions.txt"), Skin::forearm()?.positions_file())?;
        let config = format!(
            "listen = [\"unix:{}\"]\n[store]\npath = \"{}\"\n[[bus]]\nname = \"skin\"\nsource = \"sim\"\nseed = {seed}\n\
             [[patch]]\nname = \"left_forearm\"\nbus = \"skin\"\n{patch}\
             boards = [{{ address = 13, modules = \"0-15\" }}, {{ address = 12, modules = \"0-6\" }}]\n",
            at("socket").display(),
            at("store.db").display(),
        );
        std::fs::write(at("taxeld.toml"), config)?;
        let mut command = Command::new(taxeld);
        command.args(["run", "--config"]).arg(at("taxeld.toml")).env("RUST_LOG", "warn").stdin(Stdio::null());
        command.stdout(Stdio::null()).stderr(std::fs::File::create(at("log"))?);
        let child = command.spawn().with_context(|| format!("starting {}", taxeld.display()))?;
        Ok(Self { child, folder })
    }

    /// What it had to complain about, for an error's text.
    fn complaints(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("log")).unwrap_or_default().trim().to_owned()
    }

    async fn connect(&self) -> anyhow::Result<Line> {
        let address = Address::parse(&format!("unix:{}", self.folder.path().join("socket").display()))?;
        let begun = Instant::now();
        loop {
            match Options::new(address.clone()).connect().await {
                Ok(line) => return Ok(line),
                Err(error) if begun.elapsed() > PATIENCE => bail!("{error}"),
                Err(_) => tokio::time::sleep(Duration::from_millis(20)).await,
            }
        }
    }

    /// Gives it models, waits for a force, and watches one force subscriber for a while.
    async fn observe(&self, models: &str, window: Duration) -> anyhow::Result<Observed> {
        let line = self.connect().await?;
        let mut service = ModelServiceClient::new(line.clone()).max_decoding_message_size(16 << 20);
        let import = ImportModelSetRequest { json: models.to_owned(), insist: true };
        let model_set = service.import_model_set(import).await?.into_inner().model_set;
        let activate = ActivateModelSetRequest { model_set, ..ActivateModelSetRequest::default() };
        service.activate_model_set(activate).await?;
        let confirmed = TareRequest { confirmed_by: "taxel-lab".to_owned(), ..TareRequest::default() };
        SkinServiceClient::new(line.clone()).bring_up(confirmed).await?;
        let request = StreamRequest::default();
        let mut forces = ForceServiceClient::new(line).stream_force(request).await?.into_inner();
        let begun = Instant::now();
        loop {
            let sample = timeout(PATIENCE, forces.message()).await??.context("the stream ended")?;
            if matches!(sample.state(), ForceState::Ok | ForceState::Degraded) {
                break;
            }
            if begun.elapsed() > PATIENCE {
                bail!("no force: {}: {}", sample.state().as_str_name(), sample.reasons.join("; "));
            }
        }
        let (before_s, begun) = (self.used_s()?, Instant::now());
        let (mut scans, mut bytes) = (0.0, 0);
        while begun.elapsed() < window {
            let sample = timeout(PATIENCE, forces.message()).await??.context("the stream ended")?;
            (scans, bytes) = (scans + 1.0, bytes + prost::Message::encoded_len(&sample));
        }
        let status = std::fs::read_to_string(self.process().join("status"))?;
        let memory_kib =
            status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok());
        Ok([
            ("processor time of the daemon, us per scan", 1e6 * (self.used_s()? - before_s) / scans),
            ("bytes to a force subscriber, per s", bytes as f64 / begun.elapsed().as_secs_f64()),
            ("resident memory, MiB", memory_kib.map_or(f64::NAN, |kib: f64| kib / 1024.0)),
        ])
    }

    fn process(&self) -> PathBuf {
        PathBuf::from(format!("/proc/{}", self.child.id()))
    }

    /// Processor time that the process took so far, without its simulated bus, s.
    fn used_s(&self) -> anyhow::Result<f64> {
        let mut used_s = 0.0;
        for task in std::fs::read_dir(self.process().join("task"))? {
            let task = task?.path();
            let read = |name: &str| std::fs::read_to_string(task.join(name)).unwrap_or_default();
            if matches!(read("comm").trim_end(), "" | SIMULATOR_THREAD) {
                continue; // a thread that has just ended is not there any more
            }
            let ns = read("schedstat").split_whitespace().next().and_then(|ns| ns.parse::<f64>().ok());
            used_s += 1e-9 * ns.context("no schedstat in /proc")?;
        }
        Ok(used_s)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // An error means that it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn section_of(full: Observed, lean: Observed) -> Section {
    let rows = full.iter().zip(&lean).map(|((what, full), (_, lean))| row![*what, *full, *lean, full / lean]).collect();
    let [cpu, bytes] = [0, 1].map(|at: usize| digits(full[at].1 / lean[at].1, 3));
    let columns = ["what", "full", "lean (shipped default)", "full / lean"];
    let caption = "The same simulated traffic, one force subscriber that gets each value as it comes.";
    let what = "resident memory for a forearm with every output, MiB";
    Section {
        text: vec![format!(
            "Two daemons on the same simulated forearm. The full one has geometry, gauge and every output, the lean one, the \
             shipped default, the total force. The processor time is that of the daemon's process without the simulator; \
             what the engine alone takes is measured by the example scan_time of taxel-engine, also of ten full buses. The \
             full one takes {cpu} times the processor time of the lean one and sends {bytes} times the bytes."
        )],
        aims: vec![Aim::at_most(what, full[2].1, MEMORY_AIM_MIB)],
        tables: vec![Table::new("scenes-costs", caption, columns, rows)],
        ..Section::default()
    }
}
