//! Clients of a running daemon, as subcommands: what an operator does, without a line of gRPC.
//!
//! Every command reads and writes the same messages as any other client (`proto/taxel/v1`); `--json` prints them.
//! Exit codes: 0 done and good; 1 no daemon, a lost connection, a file; 2 a wrong command line; 3 the daemon said no, or
//! there is no good force.

mod ask;
mod audit;
mod calibrate;
mod connect;
mod events;
mod failure;
mod health;
mod json;
mod load;
mod model_set;
mod models;
mod places;
mod recalibrate;
mod sessions;
mod table;
mod tare;
mod watch;

use std::process::ExitCode;

use failure::Failure;
use taxel_files::say::error_line;

/// The commands that ask a running daemon.
#[derive(Debug, clap::Subcommand)]
pub enum ClientCommand {
    /// A calibration in the vacuum bag, from the zero to the models in use.
    Calibrate(calibrate::CalibrateArgs),
    /// The force as it comes, with its uncertainty, age and state.
    Watch(watch::WatchArgs),
    /// Takes the zero of the unloaded skin.
    ///
    /// Nothing may touch the skin; the daemon refuses unless the counts show an unloaded skin.
    #[command(
        after_help = "Examples:\n  taxeld tare\n  taxeld tare --confirmed-by Ada   # you confirm that nothing touches the skin"
    )]
    Tare(tare::UnloadedArgs),
    /// Configures the boards anew, which then take their own zero.
    ///
    /// Nothing may touch the skin; while there is a force the daemon refuses.
    #[command(
        after_help = "Examples:\n  taxeld bring-up\n  taxeld bring-up --confirmed-by Ada   # you confirm that nothing touches the skin"
    )]
    BringUp(tare::UnloadedArgs),
    /// Compares the force with a known mass on the skin.
    Load(load::LoadArgs),
    /// What known loads correct of the models in use, without the bag.
    Recalibrate(recalibrate::RecalibrateArgs),
    /// Buses, boards, zeros and taxels; exit code 3 if something is wrong.
    #[command(alias = "status")]
    Health(health::HealthArgs),
    /// Model sets: list, show, use, export, import, delete.
    Models(models::ModelsArgs),
    /// Calibration sessions: list, show, end, export, refit, delete.
    Sessions(sessions::SessionsArgs),
    /// Who changed what, from the audit log.
    Audit(audit::AuditArgs),
    /// What happened since the daemon's start: zeros, faults, activations, sessions, buses.
    Events(events::EventsArgs),
}

/// Runs a command, which is typed as `name`, and gives the programme's exit code; what went wrong is said on standard error.
pub fn run(command: ClientCommand, name: &str) -> ExitCode {
    let outcome = match crate::runtime::runtime() {
        Ok(runtime) => runtime.block_on(one(command)),
        Err(error) => Err(Failure::from(error)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            error_line(format_args!("taxeld: {failure}"));
            failure.help_for(name).into_iter().for_each(|help| error_line(format_args!("help: {help}")));
            failure.exit_code()
        }
    }
}

async fn one(command: ClientCommand) -> failure::Outcome {
    match command {
        ClientCommand::Calibrate(args) => calibrate::calibrate(args).await,
        ClientCommand::Watch(args) => watch::watch(args).await,
        ClientCommand::Tare(args) => tare::tare(args).await,
        ClientCommand::BringUp(args) => tare::bring_up(args).await,
        ClientCommand::Load(args) => load::load(args).await,
        ClientCommand::Recalibrate(args) => recalibrate::recalibrate(args).await,
        ClientCommand::Health(args) => health::health(args).await,
        ClientCommand::Models(args) => models::models(args).await,
        ClientCommand::Sessions(args) => sessions::sessions(args).await,
        ClientCommand::Audit(args) => audit::audit(args).await,
        ClientCommand::Events(args) => events::events(args).await,
    }
}
