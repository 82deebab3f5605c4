//! taxeld: the daemon that gives robots a sense of force.

#[macro_use]
extern crate taxel_files;

mod audit;
mod backend;
mod bus;
mod check;
mod client;
mod config;
#[cfg(feature = "sim")]
mod demo;
mod doors;
mod driver;
mod force_file;
mod help;
mod logs;
mod offline;
mod open_log;
mod page;
mod queues;
mod record;
mod reload;
mod replay;
mod rig;
mod run;
mod runtime;
mod scan;
mod setup;
mod shared_memory;
#[cfg(feature = "sim")]
mod show_demo;
#[cfg(feature = "sim")]
mod sim_bus;
#[cfg(feature = "sim")]
mod sim_drive;
mod systemd;
mod tasks;
mod upkeep;
mod values;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use config::CONFIG_FILE;

/// Calibrates robot skin in a vacuum bag and streams its force. Start with `taxeld demo`: it needs no hardware.
#[derive(Debug, Parser)]
#[command(name = "taxeld", version)]
struct Cli {
    /// What a line of the log on standard error looks like. RUST_LOG says what is logged, for example "warn",
    /// "taxel_rpc=debug,info"; without it "info".
    #[arg(long, global = true, value_enum, default_value_t)]
    log_format: logs::LogFormat,
    #[command(subcommand)]
    command: Subcommands,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    /// The whole procedure on a simulated forearm, then serves it live.
    #[cfg(feature = "sim")]
    Demo(show_demo::DemoArgs),
    /// The daemon.
    #[command(after_help = "Examples:\n  taxeld run\n  taxeld run --config palm.toml")]
    Run {
        /// Configuration; deploy/taxeld.toml is a complete example.
        #[arg(long, default_value = CONFIG_FILE)]
        config: PathBuf,
    },
    /// Validates a configuration or a drive's profile: what it resolves to, and what it leaves out.
    #[command(
        after_help = "Examples:\n  taxeld check\n  taxeld check --config palm.toml\n  taxeld check --device board.toml\n  taxeld check --store /var/lib/taxeld/taxeld.db"
    )]
    Check {
        /// Configuration.
        #[arg(long, default_value = CONFIG_FILE)]
        config: PathBuf,
        /// Check this profile of a drive instead, without the drive: a file as in deploy/rigs, or the name of one that comes with taxeld.
        #[arg(long, value_name = "FILE", conflicts_with = "config")]
        device: Option<String>,
        /// Look at this store instead, an SQLite file that no daemon has open: what it holds, and what of it is damaged or lost.
        #[arg(long, value_name = "FILE", conflicts_with_all = ["config", "device"])]
        store: Option<PathBuf>,
    },
    /// A candump log, plain or .gz, or a recording (MCAP), through the same engine.
    Replay(replay::ReplayArgs),
    /// A configuration from the robot's own files.
    Setup(setup::SetupArgs),
    /// What is on a bus, or in a log: boards, modules, faults, the gauge.
    Scan(scan::ScanArgs),
    #[command(flatten)]
    Client(client::ClientCommand),
    /// Completions of this command line for a shell, on the standard output.
    #[command(hide = true)]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Manual pages of this command line, a file a command.
    #[command(hide = true)]
    Man {
        /// The folder that they are written to.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

fn main() -> ExitCode {
    let matches = help::grouped(Cli::command()).get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let is_daemon = matches!(cli.command, Subcommands::Run { .. });
    let mut log = logs::start(cli.log_format, is_daemon);
    let done = match cli.command {
        Subcommands::Client(command) => return client::run(command, matches.subcommand_name().unwrap_or_default()),
        Subcommands::Completions { shell } => help::completions(Cli::command(), shell),
        Subcommands::Man { out } => help::man(Cli::command(), &out),
        #[cfg(feature = "sim")]
        Subcommands::Demo(args) => show_demo::demo(&args),
        Subcommands::Run { config } => run::run(config),
        Subcommands::Check { store: Some(store), .. } => check::store(&store),
        Subcommands::Check { device: Some(device), .. } => check::device(&device),
        Subcommands::Check { config, .. } => check::check(&config),
        Subcommands::Replay(args) => replay::replay(args),
        Subcommands::Setup(args) => setup::setup(&args),
        Subcommands::Scan(args) => scan::scan(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let why = format!("{error:#}");
            // A reader of the log as JSON gets its last line in that form, too.
            if cli.log_format == logs::LogFormat::Json && tracing::enabled!(tracing::Level::ERROR) {
                tracing::error!("{why}");
            } else {
                log.failure(&why);
            }
            ExitCode::FAILURE
        }
    }
}
