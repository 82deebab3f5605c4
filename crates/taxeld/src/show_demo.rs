//! What `taxeld demo` shows: the procedure's course, its error table, and then the live service.

use std::io::IsTerminal;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use indicatif::ProgressBar;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{Outputs, Plan};
use taxel_rpc::Rules;
use taxel_sim::STANDARD_GRAVITY;
use taxel_skin::{BusIndex, Geometry};
use taxel_store::models_json;

use crate::clock::RunClock;
use crate::config::{self, Config, Door, Doors, Scene, SharedMemorySection};
use crate::config::{MetricsSection, PageSection};
use crate::demo::{Contact, FINGERS_N, MASSES_KG, Outcome, Weighing, mean, procedure};
use crate::run::Daemon;
use crate::shared_memory::try_folder;
use crate::store_at::StoreAt;

/// What can be asked of the demo.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld demo                         # then, in another terminal: taxeld watch\n  taxeld demo --bare --listen 127.0.0.1:50052\n  taxeld demo --once --skins 10"
)]
pub struct DemoArgs {
    /// End after the table instead of serving the simulated skin live.
    #[arg(long)]
    once: bool,
    /// Serve the skin at once, without the table and without models: it waits to be calibrated.
    #[arg(long, conflicts_with_all = ["once", "skins"])]
    bare: bool,
    /// Where the live skin is served; without it another port is taken if the usual one is not free.
    #[arg(long, value_name = "ADDRESS", conflicts_with = "once")]
    listen: Option<SocketAddr>,
    /// The folder of the force in shared memory, for controllers of this machine [default: /dev/shm/taxeld, if it is free].
    #[arg(long, value_name = "DIR", conflicts_with = "once")]
    shared_memory: Option<PathBuf>,
    /// Which simulated skin.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seed: u64,
    /// Calibrate and weigh so many skins, with seeds from --seed on.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    skins: u64,
    /// Leave the area of excluded taxels out of the force, as the paper does.
    #[arg(long)]
    no_fill: bool,
}

/// Runs the demo.
///
/// # Errors
/// If a calibration does not come to its end, or the service cannot start.
pub fn demo(args: &DemoArgs) -> anyhow::Result<()> {
    let (config, scene) = scene(!args.no_fill)?;
    let plan = Arc::new(scene.plan.clone());
    if args.shared_memory.is_some() {
        try_folder(&pages_section(args)?)?; // what cannot be had is told before the work, and not after it
    }
    say!("A simulated forearm in a vacuum bag: 230 taxels on 23 modules, real frames, no hardware.");
    let outcomes = if args.bare { Vec::new() } else { procedures(args, &plan)? };
    if !args.bare {
        print_table(args, &outcomes);
    }
    if args.once {
        return Ok(());
    }
    let models = outcomes.first().map(|outcome| of_no_session(&outcome.models));
    let runtime = crate::runtime::runtime()?;
    runtime.block_on(serve_live(args, config, scene, models))
}

/// The models of the table's own session, which the live daemon does not know.
fn of_no_session(models: &ModelSet) -> ModelSet {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let created_wall_ns = i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX);
    models_json::of_no_session(ModelSet { created_wall_ns, ..models.clone() })
}

/// The configuration of the simulated forearm.
fn scene(fill: bool) -> anyhow::Result<(Config, Scene)> {
    let path = Path::new("demo_config.toml");
    let (config, mut scene) = config::examine_text(path, include_str!("demo_config.toml"))?;
    let (skin, _) = crate::demo::skin(1)?; // all seeds have one shape
    if let Some(patch) = scene.plan.patches.first_mut() {
        // The simulator writes its positions as the robots' files are written; they are read as any other.
        patch.geometry = Some(Geometry::parse(&skin.positions_file(), &patch.patch)?);
        patch.outputs = Outputs { resultant: true, moment: true, contacts: true, fill };
    }
    Ok((config, scene))
}

fn procedures(args: &DemoArgs, plan: &Arc<Plan>) -> anyhow::Result<Vec<Outcome>> {
    let bar = if std::io::stderr().is_terminal() { ProgressBar::new(args.skins) } else { ProgressBar::hidden() };
    let mut outcomes = Vec::new();
    for seed in args.seed..args.seed + args.skins {
        let begun = Instant::now();
        let outcome = procedure(plan, seed, &|what| {
            if begun.elapsed() > Duration::from_secs(1) {
                bar.set_message(what.to_owned());
            }
        })?;
        bar.inc(1);
        let usable = outcome.models.taxels.iter().filter(|model| model.is_usable()).count();
        say!(
            "skin {seed}: ramp to {:.0} kPa, {} scans entered, refused: {}; {usable} of {} taxels calibrated ({})",
            outcome.models.pressure_max_kpa,
            outcome.session.accepted,
            crate::replay::refusals(&outcome.session),
            outcome.models.taxels.len(),
            outcome.models.method,
        );
        outcomes.push(outcome);
    }
    bar.finish_and_clear();
    Ok(outcomes)
}

fn print_table(args: &DemoArgs, outcomes: &[Outcome]) {
    say!();
    say!("load            force N   measured N (mean)   standard uncertainty N   mean error   mean |error|");
    let of = |contact: Contact| outcomes.iter().flat_map(|o| &o.weighings).filter(move |w| w.contact == contact);
    let row = |name: String, newton: f64, contact: Contact| {
        let rows: Vec<_> = of(contact).filter(|w| (w.true_n - newton).abs() < 1e-6).collect();
        let over = |value: &dyn Fn(&Weighing) -> f64| mean(rows.iter().map(|w| value(w)));
        say!(
            "{name:15} {newton:7.2}   {:17.2}   {:22.2}   {:+8.1} %   {:10.1} %",
            over(&|w| w.measured_n),
            over(&|w| w.sigma_n),
            100.0 * over(&|w| w.error()),
            100.0 * over(&|w| w.error().abs()),
        );
    };
    for kilogram in MASSES_KG {
        row(format!("mass {kilogram:.1} kg"), kilogram * STANDARD_GRAVITY, Contact::Mass);
    }
    for newton in FINGERS_N {
        row("finger".to_owned(), newton, Contact::Finger);
    }
    say!();
    for (contact, name) in [(Contact::Mass, "masses"), (Contact::Finger, "fingers")] {
        let count = of(contact).count();
        let covered = of(contact).filter(|w| (w.measured_n - w.true_n).abs() <= 2.0 * w.sigma_n).count();
        let error = 100.0 * mean(of(contact).map(|w| w.error().abs()));
        say!(
            "{name}: mean absolute force error {error:.1} % over {count} weighings on {} skin(s); truth within 2 standard \
             uncertainties: {covered}",
            outcomes.len(),
        );
    }
    let what = if args.no_fill { "excluded taxels left out" } else { "excluded taxels filled from their neighbours" };
    say!("({what}; the paper reports about 12 % for masses on the real forearm)");
}

/// Gives the demo its page, on another port if the usual one is taken. Its address.
///
/// The port is kept from here on: of several demos that start at one moment each has its own.
fn with_page(config: &mut Config) -> anyhow::Result<Option<SocketAddr>> {
    let bound = crate::page::bind_some(PageSection::default().listen).context("a port for the page")?;
    let listen = bound.local_addr()?;
    config.page = Some(PageSection { listen, bound: Some(Arc::new(bound)), ..PageSection::default() });
    config.metrics = Some(MetricsSection::default());
    Ok(Some(listen))
}

/// Gives the demo its page in shared memory, in the folder that was asked for, or in the usual one if it can be had. The
/// folder, if there is one.
fn with_shared_memory(args: &DemoArgs, config: &mut Config) -> anyhow::Result<Option<PathBuf>> {
    let section = pages_section(args)?;
    match try_folder(&section) {
        Ok(()) => {} // the daemon takes it
        Err(error) if args.shared_memory.is_some() => return Err(error),
        Err(error) => {
            say!("*** No force in shared memory: {error:#}");
            return Ok(None);
        }
    }
    let folder = section.path.clone();
    config.shared_memory = Some(section);
    Ok(Some(folder))
}

/// Where the demo's page in shared memory is to be.
fn pages_section(args: &DemoArgs) -> anyhow::Result<SharedMemorySection> {
    let usual = SharedMemorySection::default();
    Ok(match &args.shared_memory {
        Some(path) => SharedMemorySection { path: std::path::absolute(path)?, ..usual },
        None => usual,
    })
}

/// The same skin live: an operator can calibrate it, a controller can subscribe.
async fn serve_live(
    args: &DemoArgs,
    mut config: Config,
    mut scene: Scene,
    models: Option<ModelSet>,
) -> anyhow::Result<()> {
    let usual = SocketAddr::from((Ipv4Addr::LOCALHOST, 50_051));
    let listen = address(args.listen, usual)?;
    let page = with_page(&mut config)?;
    let memory = with_shared_memory(args, &mut config)?;
    // Whoever plays with a simulated skin may do everything with it.
    scene.doors = Doors { doors: vec![Door::Tcp(listen)], rules: Rules::open(), tokens: None, ruled: false };
    let mut daemon = Daemon::start(&config, scene, StoreAt::Memory, RunClock::Live).await?;
    let calibrated = models.is_some();
    if let Some(models) = models {
        daemon.use_models(Arc::new(models)).await?; // in time for the look at the boards, which stream
    }
    daemon.add_sim_bus(BusIndex(0), args.seed)?;
    if calibrated {
        daemon.vouch_for_boards("taxeld demo").await?; // its mass is not there yet
    }
    say!();
    if listen.port() != usual.port() && args.listen.is_none() {
        say!("*** PORT {} IS TAKEN: THIS DEMO LISTENS ON {listen}. Tell the commands below so with", usual.port());
        say!("***   export TAXELD_SERVER=http://{listen}");
    }
    let what = if calibrated { "calibrated and live" } else { "live, and not calibrated yet," };
    say!("The same skin is now {what} on {listen}.");
    if let Some(page) = page {
        say!("Its page, from which to calibrate and check it: http://{page}/");
    }
    if let Some(folder) = memory {
        say!("In shared memory: {}", folder.join("left_forearm").display());
    }
    if args.listen.is_some() && listen != usual {
        say!("In another terminal, after export TAXELD_SERVER=http://{listen}:");
    } else {
        say!("In another terminal:");
    }
    for (command, what) in [
        ("taxeld watch", "its force; half a kilogram (4.90 N) lies on it for five seconds out of ten"),
        ("taxeld load 0.5", "compares the force with that mass while it lies there"),
        ("taxeld calibrate", "a calibration of your own (about 40 s; the pump starts by itself)"),
        ("taxeld health", "buses, boards, zeros and taxels"),
    ] {
        say!("  {command:17} {what}");
    }
    say!("Ctrl-C ends it.");
    daemon.until_the_end().await
}

/// The address to listen on: the one asked for, or the usual one, or one with another port if that is taken.
fn address(asked: Option<SocketAddr>, usual: SocketAddr) -> anyhow::Result<SocketAddr> {
    if let Some(asked) = asked {
        let bound = TcpListener::bind(asked).with_context(|| format!("--listen {asked}"))?;
        return Ok(bound.local_addr()?);
    }
    match TcpListener::bind(usual) {
        Ok(bound) => Ok(bound.local_addr()?),
        Err(_) => Ok(TcpListener::bind((usual.ip(), 0))?.local_addr()?),
    }
}
