//! `taxel-bridge`: robot skin in ROS 2, in fleets and on ports of YARP.

use std::path::PathBuf;

use clap::{Parser, Subcommand};
use taxel_bridge::config::Config;
use taxel_bridge::fleet::watch::{self, FleetArgs};
use taxel_bridge::run;
use taxel_bridge::yarp::publish::Ports;
use tracing_subscriber::EnvFilter;

/// The force of robot skin, from a running taxeld to ROS 2, to fleets and to ports of YARP.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Bridges one robot.
    Run(File),
    /// Only says whether a configuration can be used.
    Check(File),
    /// Shows all robots of a router.
    Fleet(FleetArgs),
}

#[derive(Debug, clap::Args)]
struct File {
    /// What is bridged, and where to.
    #[arg(long, value_name = "FILE", default_value = "/etc/taxeld/taxel-bridge.toml")]
    config: PathBuf,
}

/// Middlewares tell of every peer that comes or goes. What `ros2_client` thinks of ROS_DISTRO matters to releases before iron.
const LOGGED: &str = "info,zenoh=error,rustdds=error,ros2_client=error,ros2_client::distributions=off";

/// Zenoh needs a runtime with threads; one thread of ours is enough beside its own.
#[tokio::main(flavor = "multi_thread", worker_threads = 1)]
async fn main() -> anyhow::Result<()> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(LOGGED));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    // A task of its own: Zenoh blocks the thread for moments when a session is opened (1.10.2), and on the main thread that
    // swallows the wake-up of a timer that goes off meanwhile, so that what waits for it waits for ever.
    tokio::spawn(command(Arguments::parse().command)).await?
}

async fn command(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Run(File { config }) => run::run(Config::read(&config)?).await,
        Command::Check(File { config }) => {
            let config = Config::read(&config)?;
            taxel_bridge::link::configuration(&config.zenoh)?;
            taxel_bridge::daemon::Daemon::new(&config.daemon)?;
            config.yarp.as_ref().map(Ports::of).transpose()?;
            eprintln!("{}: {} patch(es) can be bridged", config.robot, config.patches.len());
            Ok(())
        }
        Command::Fleet(args) => watch::watch(args).await,
    }
}
