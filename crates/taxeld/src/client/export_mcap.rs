//! A session as MCAP: the session, the zeros of its ramps, and its samples, as the service sends them.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use prost::Message;
use taxel_mcap::{McapFault, McapFile, Topic};
use taxel_proto::v1::{SampleBlock, SessionRequest};
use tonic::Streaming;

use super::connect::Daemon;
use super::exported::Exported;
use super::failure::{Failure, Outcome};
use crate::files;
use crate::output::Output;

const SESSION: usize = 0;
const ZEROS: usize = 1;
const SAMPLES: usize = 2;

/// Writes the file; a session without any samples leaves none.
pub async fn mcap(daemon: &Daemon, session: u64, out: &Path, mut blocks: Streaming<SampleBlock>) -> Outcome<Exported> {
    let named = || out.display().to_string();
    let words = |fault: McapFault| anyhow::anyhow!("{}: {}", named(), fault.words());
    if files::is_standard(out) {
        return Err(Failure::from(anyhow::anyhow!("MCAP goes to a file: name one with --out")));
    }
    let about = daemon.calibration().get_session(SessionRequest { session }).await?.into_inner();
    let started = about.started.unwrap_or_default();
    let started_ns = started.seconds.saturating_mul(1_000_000_000).saturating_add(i64::from(started.nanos));
    // Samples are on the daemon's own clock: their labels begin with the session's.
    let mut first_ns = None;
    let mut label = |monotonic_ns: i64| {
        let since = monotonic_ns.saturating_sub(*first_ns.get_or_insert(monotonic_ns));
        u64::try_from(started_ns.saturating_add(since)).unwrap_or(0)
    };
    let mut file: Option<(Output, McapFile)> = None;
    let mut done = Exported::default();
    while let Some(block) = blocks.message().await? {
        done.in_all = block.samples_in_all;
        let (_, file) = match &mut file {
            Some(file) => file,
            None if done.in_all == 0 => continue,
            None => {
                let output = Output::create(out).with_context(named)?;
                let mut new = begin(&output).map_err(words)?;
                new.write(SESSION, u64::try_from(started_ns).unwrap_or(0), &about.encode_to_vec()).map_err(words)?;
                file.insert((output, new))
            }
        };
        for ramp in &block.ramps {
            file.write(ZEROS, u64::try_from(started_ns).unwrap_or(0), &ramp.encode_to_vec()).map_err(words)?;
        }
        for sample in &block.samples {
            file.write(SAMPLES, label(sample.monotonic_ns), &sample.encode_to_vec()).map_err(words)?;
            done.written += 1;
        }
    }
    if let Some((output, file)) = file.filter(|_| done.written == done.in_all) {
        file.finish().map_err(words)?;
        output.finish().with_context(named)?;
    }
    Ok(done)
}

fn begin(output: &Output) -> Result<McapFile, McapFault> {
    let topic = |name: &str, message| Topic { name: format!("/taxeld/session{name}"), message };
    let topics = [topic("", "Session"), topic("/zeros", "RampZero"), topic("/samples", "SessionSample")];
    let about = BTreeMap::from([("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
    McapFile::begin(Box::new(output.file()?), &topics, about)
}
