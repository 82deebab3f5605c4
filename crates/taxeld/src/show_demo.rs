//! What `taxeld demo` shows: the procedure's course, its error table, and then the live service.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use taxel_can::ClockReading;
use taxel_client::Address;
use taxel_engine::command::Command;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Outputs;
use taxel_sim::STANDARD_GRAVITY;
use taxel_skin::{BusIndex, Geometry};

use crate::config::{self, Config, Door, Doors, PageSection, Scene, SharedMemorySection};
use crate::demo::{Contact, FINGERS_N, MASSES_KG, Outcome, Weighing, mean, procedure};
use crate::run::Daemon;
use crate::sim_bus::SimBus;

/// Where the service is, unless another has the port.
const USUAL: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 50_051);

/// What can be asked of the demo.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld demo                         # then, in another terminal: taxeld watch\n  taxeld demo --bare --listen 127.0.0.1:50052\n  taxeld demo --once --seed 2\n  taxeld demo --device                # calibrates itself by a simulated pump"
)]
pub struct DemoArgs {
    /// End after the table instead of serving the simulated skin live.
    #[arg(long)]
    once: bool,
    /// Serve the skin at once, without the table and without models: it waits to be calibrated.
    #[arg(long, conflicts_with = "once")]
    bare: bool,
    /// Serve the skin without models, and calibrate it by a simulated pump, hands off.
    #[arg(long, conflicts_with = "once")]
    device: bool,
    /// Where the live skin is served; without it another port is taken if the usual one is not free.
    #[arg(long, value_name = "ADDRESS", conflicts_with = "once")]
    listen: Option<SocketAddr>,
    /// The folder of the force in shared memory, for controllers of this machine. It has to be on a tmpfs, as /dev/shm is [default: /dev/shm/taxeld, if it is free].
    #[arg(long, value_name = "DIR", conflicts_with = "once")]
    shared_memory: Option<PathBuf>,
    /// Which simulated skin.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seed: u64,
}

/// Runs the demo.
///
/// # Errors
/// If a calibration does not come to its end, or the service cannot start.
pub fn demo(args: &DemoArgs) -> anyhow::Result<()> {
    let (mut config, scene) = scene()?;
    let plan = Arc::new(scene.plan.clone());
    let mut memory = SharedMemorySection::default();
    if let Some(path) = &args.shared_memory {
        memory.path = std::path::absolute(path)?;
    }
    config.shared_memory = Some(memory);
    say!("A simulated forearm in a vacuum bag: 230 taxels on 23 modules, real frames, no hardware.");
    let outcome = if args.bare || args.device { None } else { Some(procedure(&plan, args.seed)?) };
    if let Some(outcome) = &outcome {
        print_calibration(outcome);
        print_table(&outcome.weighings);
    }
    if args.once {
        return Ok(());
    }
    // The live daemon does not know the session that they are of.
    let made = |outcome: Outcome| {
        let created_wall_ns = ClockReading::now().wall_ns;
        ModelSet { created_wall_ns, session: None, ..ModelSet::clone(&outcome.models) }
    };
    let models = outcome.map(made);
    let runtime = crate::runtime::runtime()?;
    runtime.block_on(serve_live(args, config, scene, models))
}

/// The configuration of the simulated forearm.
fn scene() -> anyhow::Result<(Config, Scene)> {
    let path = Path::new("demo_config.toml");
    let (config, mut scene) = config::examine_text(path, include_str!("demo_config.toml"))?;
    let (skin, _) = crate::demo::skin(1)?; // all seeds have one shape
    if let Some(patch) = scene.plan.patches.first_mut() {
        // The simulator writes its positions as the robots' files are written; they are read as any other.
        patch.geometry = Some(Geometry::parse(&skin.positions_file(), &patch.patch)?);
        patch.outputs = Outputs { resultant: true, moment: true, contacts: true, fill: true, place: true };
    }
    Ok((config, scene))
}

fn print_calibration(Outcome { session, models, .. }: &Outcome) {
    let usable = models.taxels.iter().filter(|model| model.is_usable()).count();
    let (kpa, scans, refused) = (models.pressure_max_kpa, session.accepted, crate::values::refusals_of(session));
    let calibrated = format!("{usable} of {} taxels calibrated", models.taxels.len());
    say!("ramp to {kpa:.0} kPa, {scans} scans entered, refused: {refused}; {calibrated}");
}

fn print_table(weighings: &[Weighing]) {
    say!();
    say!("load            force N   measured N (mean)   standard uncertainty N   mean error   mean |error|");
    let of = |contact: Contact| weighings.iter().filter(move |w| w.contact == contact);
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
            "{name}: mean absolute force error {error:.1} % over {count} weighings; truth within 2 standard uncertainties: \
             {covered}"
        );
    }
    say!("(the paper reports about 12 % for masses on the real forearm)");
}

/// The same skin live: an operator can calibrate it, a controller can subscribe.
async fn serve_live(
    args: &DemoArgs,
    mut config: Config,
    mut scene: Scene,
    models: Option<ModelSet>,
) -> anyhow::Result<()> {
    let listen = address(args.listen)?;
    // The port is kept from here on: of several demos that start at one moment each has its own.
    let bound = crate::page::bind_some(PageSection::default().listen).context("a port for the page")?;
    let page = bound.local_addr()?;
    config.page = Some(PageSection { listen: page, bound: Some(Arc::new(bound)), ..PageSection::default() });
    // A user of the simulated skin may do everything with it.
    scene.doors = Doors { doors: vec![Door::Tcp(listen)], group: None, rules: None, tokens: None };
    let mut daemon = Daemon::start(&config, scene, None).await?;
    let calibrated = models.is_some();
    if let Some(models) = models {
        // Before the boards are configured: the zero is judged by them.
        let (patch, model_set) = (models.patch.clone(), models.id.clone());
        ask(&daemon, Command::Import { model_set: Arc::new(models), insist: false }).await?;
        ask(&daemon, Command::Activate { patch, model_set, expected: None }).await?;
    }
    let (pump, commands) = args.device.then(crate::sim_drive::start).transpose()?.unzip();
    let (bus, handle) = (BusIndex(0), daemon.handle.clone());
    daemon.add_bus(bus, SimBus::new(args.seed, (&daemon.plan, bus), handle, commands)?);
    if calibrated {
        // Its mass is not there yet.
        let confirmed_by = Some("taxeld demo".to_owned());
        ask(&daemon, Command::BringUp { patch: String::new(), confirmed_by }).await?;
    }
    let what = if calibrated { "calibrated and live" } else { "live, not calibrated yet," };
    say!();
    say!("The skin is now {what} on {listen}.");
    say!("Its page, from which to calibrate and check it: http://{page}/");
    if let Some(section) = &config.shared_memory {
        say!("In shared memory, unless `taxeld health` says why not: {}", section.path.join("left_forearm").display());
    }
    // Without it the commands would reach the daemon of the robot, if one runs.
    let address = format!("http://{listen}");
    let is_usual = Address::local().to_string() == address;
    let export = if is_usual { String::new() } else { format!(", after export TAXELD_SERVER={address}") };
    say!("In another terminal{export}:\n{COMMANDS}");
    if let Some(pump) = pump {
        calibrate(listen, pump)?;
    }
    daemon.until_the_end(Ok(())).await
}

/// What can be tried, in an order that works also where nothing is calibrated yet.
const COMMANDS: &str = "  taxeld health     buses, boards, zeros and taxels
  taxeld calibrate  a calibration of your own (about 40 s; the pump starts by itself)
  taxeld watch      the force; half a kilogram (4.90 N) lies on it for five seconds out of ten
  taxeld load 0.5   compares the force with that mass while it lies there
Ctrl-C ends it.";

/// As an operator would in another terminal.
fn calibrate(daemon: SocketAddr, pump: SocketAddr) -> anyhow::Result<()> {
    let words = ["calibrate", "--yes", "--device", "micro", "--at"].map(str::to_owned).into_iter();
    let words: Vec<_> = words.chain([format!("tcp:{pump}"), "--server".into(), format!("http://{daemon}")]).collect();
    say!();
    say!("$ taxeld {}", words.join(" "));
    std::process::Command::new(std::env::current_exe()?).args(words).spawn().context("taxeld calibrate")?;
    Ok(())
}

async fn ask(daemon: &Daemon, command: Command) -> anyhow::Result<()> {
    let reply = daemon.handle.ask(command).await.context("the engine has stopped")?;
    reply.map(drop).map_err(|rejection| anyhow::anyhow!("{rejection}"))
}

/// The address to listen on: the one asked for, or the usual one, or one with another port if that is taken.
fn address(asked: Option<SocketAddr>) -> anyhow::Result<SocketAddr> {
    let bound = match asked {
        Some(asked) => TcpListener::bind(asked).with_context(|| format!("--listen {asked}"))?,
        None => crate::page::bind_some(USUAL)?,
    };
    Ok(bound.local_addr()?)
}
