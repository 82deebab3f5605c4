//! taxeld: the daemon that gives robots a sense of force.

#[macro_use]
mod say;

mod apply;
mod bus;
mod check;
mod clock;
mod config;
#[cfg(feature = "sim")]
mod demo;
mod driver;
mod fit;
mod force_file;
mod judge;
mod offline;
#[cfg(feature = "report")]
mod paper;
#[cfg(feature = "sim")]
mod picture;
mod queues;
mod recording;
mod replay;
#[cfg(feature = "report")]
mod report;
mod run;
#[cfg(feature = "sim")]
mod show_demo;
#[cfg(feature = "sim")]
mod sim_bus;
mod soundness;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use config::{Config, Scene};

/// Calibrates robot skin in a vacuum bag and streams its force.
///
/// Start with `taxeld demo`: no hardware, no configuration. README.md has the whole procedure.
#[derive(Debug, Parser)]
#[command(name = "taxeld", version)]
struct Cli {
    #[command(subcommand)]
    command: Subcommands,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    /// The whole procedure on a simulated forearm: calibration, masses, error table; then serves it live.
    #[cfg(feature = "sim")]
    Demo(show_demo::DemoArgs),
    /// The daemon.
    Run {
        /// Configuration; deploy/taxeld.toml is a complete example.
        #[arg(long)]
        config: PathBuf,
    },
    /// Validates a configuration and prints what it resolves to and what it leaves out.
    Check {
        /// Configuration.
        #[arg(long)]
        config: PathBuf,
    },
    /// A candump log, plain or .gz, through the same engine.
    Replay(ReplayArgs),
    /// Fits models to a recording and writes MODELS.json.
    Fit(fit::FitArgs),
    /// Turns the counts of a recording into pressures.
    Apply(apply::ApplyArgs),
    /// Error against run time, the stability table and what a scene costs, as one page with its data.
    #[cfg(feature = "report")]
    Report(report::ReportArgs),
    /// Every figure and table of the paper that data can draw: of the simulator, a recording, a log or a session.
    #[cfg(feature = "report")]
    Paper(paper::PaperArgs),
    /// Compares a recording's pressure with what models say of its counts.
    #[command(hide = true)]
    Judge(judge::JudgeArgs),
}

#[derive(Debug, clap::Args)]
struct ReplayArgs {
    /// The log, as candump -l writes it.
    log: PathBuf,
    /// Configuration; the buses' interfaces name those of the log.
    #[arg(long)]
    config: PathBuf,
    /// Times as fast as the log was written, with the service up. Without it: as fast as it can be read, no service.
    #[arg(long, value_name = "X", value_parser = parse_speed)]
    speed: Option<f64>,
    /// Take a calibration from the log, up to this pressure or the configured target. Only without --speed.
    #[arg(long, value_name = "KPA", num_args = 0..=1, conflicts_with = "speed")]
    calibrate: Option<Option<f64>>,
    /// Write the models of the calibration here.
    #[arg(long, value_name = "MODELS.json", requires = "calibrate")]
    out: Option<PathBuf>,
    /// Use these models from the first frame on. Only without --speed.
    #[arg(long, value_name = "MODELS.json", conflicts_with_all = ["speed", "calibrate"])]
    models: Option<PathBuf>,
    /// Write the force of each scan here: time, state, newtons, uncertainty. Only without --speed.
    #[arg(long, value_name = "FORCE.csv", conflicts_with = "speed")]
    force: Option<PathBuf>,
}

fn parse_speed(text: &str) -> Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|s| *s >= 0.01 && *s <= 1e6);
    speed.ok_or_else(|| "expected a factor of 0.01 to 1000000".to_owned())
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into()))
        .with_writer(std::io::stderr)
        .init();
    match dispatch(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("taxeld: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn dispatch(command: Subcommands) -> anyhow::Result<()> {
    match command {
        #[cfg(feature = "sim")]
        Subcommands::Demo(args) => show_demo::demo(&args),
        Subcommands::Run { config } => {
            let (config, scene) = load(&config)?;
            run::runtime()?.block_on(run::run(config, scene))
        }
        Subcommands::Check { config } => {
            let (config, scene) = load(&config)?;
            check::print(&config, &scene);
            Ok(())
        }
        Subcommands::Replay(args) => {
            let (config, scene) = load(&args.config)?;
            let ReplayArgs { log, speed, calibrate, out, models, force, .. } = args;
            replay::replay(replay::Request { log, speed, calibrate, out, models, force }, config, scene)
        }
        Subcommands::Fit(args) => fit::fit(&args),
        Subcommands::Apply(args) => apply::apply(&args),
        #[cfg(feature = "report")]
        Subcommands::Report(args) => report::report(args),
        #[cfg(feature = "report")]
        Subcommands::Paper(args) => paper::paper(&args),
        Subcommands::Judge(args) => judge::judge(&args),
    }
}

fn load(path: &Path) -> anyhow::Result<(Config, Scene)> {
    let config = config::load(path)?;
    let scene = config::resolve(&config, path)?;
    Ok((config, scene))
}
