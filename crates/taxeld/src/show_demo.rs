//! What `taxeld demo` shows: the procedure's course, its error table, and then the live service.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use indicatif::ProgressBar;
use taxel_engine::plan::{Outputs, Plan};
use taxel_sim::Skin;
use taxel_skin::{BusIndex, Geometry};
use tokio::net::TcpListener;

use crate::clock::RunClock;
use crate::config::{self, Config, Scene};
use crate::demo::{MASSES_KG, Outcome, mean, procedure};
use crate::picture;
use crate::run::{Daemon, StoreAt};
use crate::sim_bus::SimBus;

/// What can be asked of the demo.
#[derive(Debug, clap::Args)]
pub struct DemoArgs {
    /// End after the table instead of serving the simulated skin live.
    #[arg(long)]
    once: bool,
    /// Which simulated skin.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seed: u64,
    /// Calibrate and weigh so many skins, with seeds from --seed on.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    skins: u64,
    /// Leave the area of excluded taxels out of the force, as the paper does.
    #[arg(long)]
    no_fill: bool,
    /// Draw measured against true force as a picture.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Runs the demo.
///
/// # Errors
/// If a calibration does not come to its end, or the service cannot start.
pub fn demo(args: &DemoArgs) -> anyhow::Result<()> {
    let (config, scene) = scene(!args.no_fill)?;
    let plan = Arc::new(scene.plan.clone());
    say!("A simulated forearm in a vacuum bag: 230 taxels on 23 modules, real frames, no hardware.");
    let outcomes = procedures(args, &plan)?;
    print_table(args, &outcomes);
    if let Some(path) = &args.svg {
        let weighings: Vec<_> = outcomes.iter().flat_map(|o| &o.weighings).collect();
        let picture = picture::svg(&weighings, outcomes.len(), !args.no_fill);
        std::fs::write(path, picture).with_context(|| format!("writing {}", path.display()))?;
    }
    if args.once {
        return Ok(());
    }
    let runtime = crate::run::runtime()?;
    runtime.block_on(serve_live(args.seed, config, scene))
}

/// The configuration of the simulated forearm.
fn scene(fill: bool) -> anyhow::Result<(Config, Scene)> {
    let path = Path::new("demo_config.toml");
    let config = config::parse(path, include_str!("demo_config.toml"))?;
    let mut scene = config::resolve(&config, path)?;
    let skin = Skin::forearm()?;
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
    say!("mass kg   force N   measured N (mean)   standard uncertainty N   mean error   mean |error|");
    for kilogram in MASSES_KG {
        let rows: Vec<_> = outcomes.iter().flat_map(|o| &o.weighings).filter(|w| w.kilogram == kilogram).collect();
        let over = |value: &dyn Fn(&crate::demo::Weighing) -> f64| mean(rows.iter().map(|w| value(w)));
        say!(
            "{kilogram:7.1}   {:7.2}   {:17.2}   {:22.2}   {:+8.1} %   {:10.1} %",
            over(&|w| w.true_n),
            over(&|w| w.measured_n),
            over(&|w| w.sigma_n),
            100.0 * over(&|w| w.error()),
            100.0 * over(&|w| w.error().abs()),
        );
    }
    let all = || outcomes.iter().flat_map(|o| &o.weighings);
    let covered = all().filter(|w| (w.measured_n - w.true_n).abs() <= 2.0 * w.sigma_n).count();
    say!();
    say!(
        "mean absolute force error: {:.1} % over {} weighings on {} skin(s); truth within 2 standard uncertainties: {covered}",
        100.0 * mean(outcomes.iter().map(Outcome::mean_error)),
        all().count(),
        outcomes.len(),
    );
    let what = if args.no_fill { "excluded taxels left out" } else { "excluded taxels filled from their neighbours" };
    say!("({what}; the paper reports about 12 % on the real forearm)");
}

/// The same skin live: an operator can calibrate it, a controller can subscribe.
async fn serve_live(seed: u64, mut config: Config, scene: Scene) -> anyhow::Result<()> {
    if TcpListener::bind(config.service.listen).await.is_err() {
        config.service.listen.set_port(0);
        config.service.listen = TcpListener::bind(config.service.listen).await?.local_addr()?;
    }
    let listen = config.service.listen;
    let mut daemon = Daemon::start(&config, scene, StoreAt::Memory, RunClock::Live).await?;
    let bus = SimBus::new(seed, daemon.session())?;
    daemon.add_bus(BusIndex(0), bus);
    say!();
    say!("The same skin is now live on {listen}. In another terminal, calibrate it (about 40 s) and read its force:");
    say!("  grpcurl -plaintext {listen} taxel.v1.CalibrationService/StartSession");
    say!("  grpcurl -plaintext -d '{{\"session\": 1}}' {listen} taxel.v1.CalibrationService/WatchSession");
    say!("  grpcurl -plaintext -d '{{\"modelSet\": \"m-...\"}}' {listen} taxel.v1.ModelService/ActivateModelSet");
    say!("  grpcurl -plaintext {listen} taxel.v1.SkinService/Tare");
    say!("  grpcurl -plaintext {listen} taxel.v1.ForceService/StreamForce");
    say!("Half a kilogram lies on the skin for five seconds out of ten. Ctrl-C ends it.");
    daemon.until_the_end().await
}
