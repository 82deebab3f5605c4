//! `taxeld sessions export`: what a session gathered, as a table.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::Context;
use taxel_client::Server;
use taxel_proto::v1::SessionRequest;

use super::connect::Daemon;
use super::failure::Outcome;
use taxel_files::{Output, quiet_end};

/// Which session, and where it goes.
#[derive(Debug, clap::Args)]
pub struct ExportArgs {
    #[command(flatten)]
    server: Server,
    /// Number of the session.
    #[arg(value_name = "SESSION", value_parser = clap::value_parser!(u64).range(1..))]
    session: u64,
    /// Where it goes; `-` is the standard output.
    #[arg(long, value_name = "FILE", default_value = "-")]
    out: PathBuf,
}

/// Writes figures of the session and its zeros, then a row a scan: seconds since the first one, kPa, and a count a taxel.
///
/// # Errors
/// No such session, one without samples, a file that cannot be written, or no daemon.
pub async fn export(args: &ExportArgs) -> Outcome {
    let daemon = Daemon::at(&args.server).await?;
    let request = SessionRequest { session: args.session };
    let mut pieces = daemon.calibration().export_samples(request).await?.into_inner();
    let mut file = Output::create(&args.out).with_context(|| args.out.display().to_string())?;
    while let Some(piece) = pieces.message().await? {
        if let Err(error) = file.write_all(piece.text.as_bytes()) {
            return Ok(quiet_end(&args.out, Err(error))?);
        }
    }
    quiet_end(&args.out, file.finish())?;
    if !taxel_files::is_standard(&args.out) {
        say!("session {}: {}", args.session, args.out.display());
    }
    Ok(())
}
