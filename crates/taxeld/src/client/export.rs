//! `taxeld sessions export`: what a session gathered, as a table.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::Context;
use taxel_engine::calibration::export::sample_row;
use taxel_proto::v1::{SessionRequest, SessionSample};

use super::connect::Server;
use super::failure::{Failure, Outcome};
use crate::files;
use crate::output::{Output, quiet_end};

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
    let daemon = args.server.connect().await?;
    let request = SessionRequest { session: args.session };
    let mut blocks = daemon.calibration().export_samples(request).await?.into_inner();
    let mut next = blocks.message().await?.filter(|block| block.samples_in_all > 0);
    let first = next.as_ref().and_then(|block| Some((block.samples_in_all, block.samples.first()?.monotonic_ns)));
    let Some((in_all, first_ns)) = first else {
        return Err(Failure::refused(format!("session {} has no samples", args.session)));
    };
    let mut file = Output::create(&args.out).with_context(|| args.out.display().to_string())?;
    let mut written = 0;
    while let Some(block) = next {
        let rows = block.samples.iter().map(|sample| row_of(sample, first_ns));
        let text = std::iter::once(block.table_head).chain(rows).collect::<String>();
        if let Err(error) = file.write_all(text.as_bytes()) {
            return Ok(quiet_end(&args.out, Err(error))?);
        }
        written += block.samples.len() as u64;
        next = blocks.message().await?;
    }
    if written != in_all {
        return Err(Failure::Broken(anyhow::anyhow!("{written} of {in_all} samples came")));
    }
    quiet_end(&args.out, file.finish())?;
    if !files::is_standard(&args.out) {
        say!("{written} scans of session {}: {}", args.session, args.out.display());
    }
    Ok(())
}

fn row_of(sample: &SessionSample, first_ns: i64) -> String {
    let since_ns = sample.monotonic_ns.saturating_sub(first_ns);
    sample_row(since_ns, sample.pressure_kpa, sample.counts.iter().copied(), sample.ramp)
}
