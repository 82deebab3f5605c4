//! `taxeld sessions export`: what a session gathered, as a table or as MCAP.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use taxel_engine::calibration::export::sample_row;
use taxel_proto::v1::{SampleBlock, SessionRequest, SessionSample};
use tonic::Streaming;

use super::connect::Server;
use super::exported::Exported;
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
    /// What is written [default: by the ending of --out, else csv].
    #[arg(long, value_enum)]
    format: Option<Format>,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// A table: figures of the session and its zeros, then seconds since the first scan, kPa, and a count a taxel.
    Csv,
    /// A container of messages: the session, the zeros of its ramps, its samples.
    Mcap,
}

impl ExportArgs {
    fn format(&self) -> Format {
        if self.format.is_none() && self.out.extension().is_some_and(|end| end == "mcap") {
            return Format::Mcap;
        }
        self.format.unwrap_or(Format::Csv)
    }
}

/// Runs it.
///
/// # Errors
/// No such session, one without samples, a file that cannot be written, or no daemon.
pub async fn export(args: &ExportArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let request = SessionRequest { session: args.session };
    let blocks = daemon.calibration().export_samples(request).await?.into_inner();
    let Exported { written, in_all } = match args.format() {
        Format::Csv => csv(&args.out, blocks).await?,
        Format::Mcap => super::export_mcap::mcap(&daemon, args.session, &args.out, blocks).await?,
    };
    if in_all == 0 && written == 0 {
        return Err(Failure::refused(format!("session {} has no samples", args.session)));
    }
    if written != in_all {
        return Err(Failure::Broken(anyhow::anyhow!("{written} of {in_all} samples came")));
    }
    if !files::is_standard(&args.out) {
        say!("{written} scans of session {}: {}", args.session, args.out.display());
    }
    Ok(())
}

/// Writes the table.
async fn csv(out: &Path, mut blocks: Streaming<SampleBlock>) -> Outcome<Exported> {
    let named = || out.display().to_string();
    let mut file: Option<Output> = None;
    let (mut first_ns, mut head, mut done) = (0, String::new(), Exported::default());
    while let Some(block) = blocks.message().await? {
        done.in_all = block.samples_in_all;
        head += &block.table_head;
        for sample in &block.samples {
            let (head, file) = match &mut file {
                Some(file) => (String::new(), file),
                None => {
                    first_ns = sample.monotonic_ns;
                    (std::mem::take(&mut head), file.insert(Output::create(out).with_context(named)?))
                }
            };
            if let Err(error) = file.write_all((head + &row_of(sample, first_ns)).as_bytes()) {
                quiet_end(out, Err(error))?;
                return Ok(Exported { written: done.in_all, in_all: done.in_all }); // who read the standard output had enough
            }
            done.written += 1;
        }
    }
    if let Some(file) = file.filter(|_| done.written == done.in_all) {
        quiet_end(out, file.finish())?;
    }
    Ok(done)
}

fn row_of(sample: &SessionSample, first_ns: i64) -> String {
    sample_row(
        sample.monotonic_ns.saturating_sub(first_ns),
        sample.pressure_kpa,
        sample.counts.iter().copied(),
        sample.ramp,
    )
}
