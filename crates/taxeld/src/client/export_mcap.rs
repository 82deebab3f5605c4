//! A session as MCAP: the session, the zeros of its ramps, and its samples, as the service sends them.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use anyhow::Context;
use prost::Message;
use taxel_mcap::{McapFile, Topic};
use taxel_proto::v1::{GetSessionRequest, SampleBlock};
use tonic::Streaming;

use super::connect::Daemon;
use super::failure::{Failure, Outcome};
use super::zeros::write_zeros;
use crate::files;

const SESSION: usize = 0;
const ZEROS: usize = 1;
const SAMPLES: usize = 2;

/// Writes the file. Gives how many samples it has, and how many there are; a session without any leaves no file.
pub async fn mcap(
    daemon: &Daemon,
    session: u64,
    out: &Path,
    zeros: Option<&Path>,
    mut blocks: Streaming<SampleBlock>,
) -> Outcome<(u64, u64)> {
    if files::is_standard(out) {
        return Err(Failure::from(anyhow::anyhow!("MCAP goes to a file: name one with --out")));
    }
    let about = daemon.calibration().get_session(GetSessionRequest { session }).await?.into_inner();
    let started = about.started.unwrap_or_default();
    let started_ns = started.seconds.saturating_mul(1_000_000_000).saturating_add(i64::from(started.nanos));
    // Samples are on the daemon's own clock: their labels begin with the session's.
    let mut first_ns = None;
    let mut label = |monotonic_ns: i64| {
        let since = monotonic_ns.saturating_sub(*first_ns.get_or_insert(monotonic_ns));
        u64::try_from(started_ns.saturating_add(since)).unwrap_or(0)
    };
    let mut file: Option<McapFile> = None;
    let (mut written, mut in_all) = (0_u64, 0);
    while let Some(block) = blocks.message().await? {
        in_all = block.samples_in_all;
        write_zeros(zeros, &block.ramps)?;
        let file = match &mut file {
            Some(file) => file,
            None if in_all == 0 => continue,
            None => {
                let mut new = begin(out)?;
                let words = |fault: taxel_mcap::McapFault| anyhow::anyhow!("{}: {}", out.display(), fault.words());
                new.write(SESSION, u64::try_from(started_ns).unwrap_or(0), &about.encode_to_vec()).map_err(words)?;
                file.insert(new)
            }
        };
        let words = |fault: taxel_mcap::McapFault| anyhow::anyhow!("{}: {}", out.display(), fault.words());
        for ramp in &block.ramps {
            file.write(ZEROS, u64::try_from(started_ns).unwrap_or(0), &ramp.encode_to_vec()).map_err(words)?;
        }
        for sample in &block.samples {
            file.write(SAMPLES, label(sample.monotonic_ns), &sample.encode_to_vec()).map_err(words)?;
            written += 1;
        }
    }
    if let Some(file) = file {
        file.finish().map_err(|fault| anyhow::anyhow!("{}: {}", out.display(), fault.words()))?;
    }
    Ok((written, in_all))
}

fn begin(out: &Path) -> anyhow::Result<McapFile> {
    let file = File::create(out).with_context(|| out.display().to_string())?;
    let topic = |name: &str, message| Topic { name: format!("/taxeld/session{name}"), message };
    let topics = [topic("", "Session"), topic("/zeros", "RampZero"), topic("/samples", "SessionSample")];
    let about = BTreeMap::from([("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
    McapFile::begin(Box::new(file), &topics, about)
        .map_err(|fault| anyhow::anyhow!("{}: {}", out.display(), fault.words()))
}
