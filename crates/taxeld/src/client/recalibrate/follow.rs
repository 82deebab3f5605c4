//! Known loads from a force sensor: wherever it holds still the daemon reads the skin, and only if both hold still.
//!
//! The sensor's own clock is not looked at: while nothing moves a lag changes nothing.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_proto::v1::record_load_request::Load as Known;
use taxel_proto::v1::{Load, RecordLoadRequest};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tonic::Status;

use super::reference::{Lines, Reference, Steady};
use crate::client::connect::Daemon;
use crate::client::failure::{Failure, Outcome};

/// After a load that the daemon did not take, so long is waited before it is asked again.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// What is read at once, and how many of these may wait: a sensor of 10 kHz writes as much in a tenth of a second.
const CHUNK_BYTES: usize = 4096;
const CHUNKS_MAX: usize = 8;
/// So many loads in a row that do not count, and something has to be mended first.
const WRONG_MAX: u8 = 5;
/// The sensor's mean may differ so much from that of when the reading began, as a share.
const MOVED_SHARE_MAX: f64 = 0.02;

/// What is wanted of a force sensor.
#[derive(Debug, clap::Args)]
pub struct FollowArgs {
    /// With --reference: how many loads to read, each at another place.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(5..=100))]
    points: u8,
    /// With --reference: standard uncertainty of the sensor as a share of its force, 0 to 0.5.
    #[arg(long, value_name = "SHARE", default_value_t = 0.01)]
    uncertainty: f64,
    /// With --reference: who presses.
    #[arg(long, value_name = "NAME", default_value = "")]
    by: String,
}

/// Reads known loads while the sensor's lines come; their numbers.
///
/// # Errors
/// A line that is no force, a sensor that ends before there are enough loads, or no daemon.
pub async fn follow(daemon: &Daemon, path: &Path, args: &FollowArgs, quiet: bool) -> Outcome<Vec<u64>> {
    let (mut source, mut lines) = (bytes_of(path)?, Lines::default());
    let mut loads = Loads { quiet, ..Loads::new(daemon, args) };
    while loads.numbers.len() < usize::from(args.points) {
        tokio::select! {
            interrupted = tokio::signal::ctrl_c() => {
                interrupted?;
                return Err(loads.ended("interrupted"));
            }
            read = source.recv() => {
                let Some(bytes) = read else { return Err(loads.ended("the reference ended")) };
                let bytes = bytes.with_context(|| path.display().to_string())?;
                let forces = lines.take(&bytes).map_err(Failure::refused)?;
                forces.into_iter().for_each(|force_n| loads.on_value(Instant::now(), force_n));
            }
            answer = answer_of(&mut loads.reading) => loads.on_answer(Instant::now(), answer)?,
        }
    }
    Ok(loads.numbers)
}

/// What comes from a file or the standard input. A thread of its own reads it: a sensor that falls silent must not keep
/// the programme from ending.
fn bytes_of(path: &Path) -> io::Result<mpsc::Receiver<io::Result<Vec<u8>>>> {
    let (tell, told) = mpsc::channel(CHUNKS_MAX);
    let path = path.to_owned();
    let read = move || {
        let source: io::Result<Box<dyn Read>> = match crate::files::is_standard(&path) {
            true => Ok(Box::new(io::stdin())),
            false => File::open(&path).map(|file| Box::new(file) as Box<dyn Read>),
        };
        let mut source = match source {
            Ok(source) => source,
            Err(error) => return drop(tell.blocking_send(Err(error))),
        };
        loop {
            let mut bytes = vec![0; CHUNK_BYTES];
            let chunk = match source.read(&mut bytes) {
                Ok(0) => return,
                Ok(length) => {
                    bytes.truncate(length);
                    Ok(bytes)
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => Err(error),
            };
            let last = chunk.is_err();
            if tell.blocking_send(chunk).is_err() || last {
                return; // nobody listens any more
            }
        }
    };
    std::thread::Builder::new().name("reference".to_owned()).spawn(read)?;
    Ok(told)
}

/// A load being read.
struct Reading {
    steady: Steady,
    answer: JoinHandle<Result<Load, Status>>,
}

/// The answer of the daemon, if it was asked; else never.
async fn answer_of(reading: &mut Option<Reading>) -> Result<Load, Status> {
    match reading {
        Some(reading) => {
            let answer = (&mut reading.answer).await;
            answer.unwrap_or_else(|lost| Err(Status::internal(format!("the call was lost: {lost}"))))
        }
        None => std::future::pending().await,
    }
}

struct Loads<'a> {
    daemon: &'a Daemon,
    args: &'a FollowArgs,
    quiet: bool,
    reference: Reference,
    reading: Option<Reading>,
    not_before: Instant,
    /// A load that does not count, and why: the next one takes its place.
    wrong: Option<(u64, String)>,
    /// How many there were in a row.
    wrong_in_a_row: u8,
    numbers: Vec<u64>,
}

impl<'a> Loads<'a> {
    fn new(daemon: &'a Daemon, args: &'a FollowArgs) -> Self {
        let (reference, numbers) = (Reference::default(), Vec::new());
        let (not_before, wrong) = (Instant::now(), None);
        Self { daemon, args, quiet: false, reference, reading: None, not_before, wrong, wrong_in_a_row: 0, numbers }
    }

    fn on_value(&mut self, now: Instant, force_n: f64) {
        self.reference.take(now, force_n);
        if self.reading.is_some() || now < self.not_before {
            return;
        }
        let Some(steady) = self.reference.new_load(now) else { return };
        let request = RecordLoadRequest {
            patch: self.daemon.patch(),
            load: Some(Known::ForceN(steady.force_n)),
            relative_uncertainty: Some(self.args.uncertainty.hypot(steady.relative_sigma)),
            note: "by a force sensor".to_owned(),
            by: self.args.by.clone(),
            replaces: self.wrong.as_ref().map_or(0, |(number, _)| *number),
        };
        let daemon = self.daemon.clone();
        let call = async move { daemon.validation().record_load(request).await.map(tonic::Response::into_inner) };
        self.reading = Some(Reading { steady, answer: tokio::spawn(call) });
    }

    fn on_answer(&mut self, now: Instant, answer: Result<Load, Status>) -> Outcome {
        let Some(Reading { steady, .. }) = self.reading.take() else { return Ok(()) };
        match answer {
            Ok(load) => {
                self.wrong = None;
                let held = self
                    .reference
                    .steady(now)
                    .filter(|since| (since.force_n - steady.force_n).abs() <= MOVED_SHARE_MAX * steady.force_n);
                if let Some(why) = does_not_count(&load, held.is_some()) {
                    self.tell(&format!("load {}: {why}; the next load replaces it", load.load));
                    self.wrong = Some((load.load, why));
                    self.wrong_in_a_row += 1;
                    self.not_before = now + AGAIN_AFTER;
                    return match self.wrong_in_a_row {
                        WRONG_MAX => Err(self.ended("given up")),
                        _ => Ok(()),
                    };
                }
                self.wrong_in_a_row = 0;
                self.reference.done(steady.force_n);
                self.numbers.push(load.load);
                let (count, of) = (self.numbers.len(), self.args.points);
                let (known, read, off) = (load.force_n, load.read_n, load.error_percent);
                self.tell(&format!(
                    "load {} ({count} of {of}): {known:.2} N by the sensor, {read:.2} N read, {off:+.1} %; now another place",
                    load.load
                ));
                Ok(())
            }
            // The skin moves or is not touched: it may hold still later.
            Err(status) if status.code() == tonic::Code::FailedPrecondition => {
                self.tell(status.message());
                self.not_before = now + AGAIN_AFTER;
                Ok(())
            }
            Err(status) => Err(status.into()),
        }
    }

    fn tell(&self, what: &str) {
        if self.quiet {
            eprintln!("{what}");
        } else {
            say!("{what}");
        }
    }

    /// Why there are fewer loads than wanted, and what is left of them.
    fn ended(&self, why: &str) -> Failure {
        let (count, of) = (self.numbers.len(), self.args.points);
        let wrong = self.wrong.as_ref().map_or_else(String::new, |(number, why)| {
            format!(". Load {number} does not count ({why}): replace it with `taxeld load --replaces {number}`")
        });
        Failure::refused(format!("{why} after {count} of {of} loads that held still{wrong}"))
    }
}

/// Why a load that was read is none to recalibrate by, if it is none; `held` is whether the sensor held still meanwhile.
fn does_not_count(load: &Load, held: bool) -> Option<String> {
    match [&load.outdated_because, &load.left_out_because].into_iter().find(|why| !why.is_empty()) {
        _ if !held => Some("the sensor moved meanwhile".to_owned()),
        why => why.cloned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_counts_that_held_still_under_a_good_force() {
        assert_eq!(does_not_count(&Load::default(), true), None);
        assert!(does_not_count(&Load::default(), false).is_some_and(|why| why.contains("moved")));
        let faulty = Load { left_out_because: "the force had a shortcoming".to_owned(), ..Load::default() };
        assert_eq!(does_not_count(&faulty, true).as_ref(), Some(&faulty.left_out_because));
        let other = Load { outdated_because: "of another model set".to_owned(), ..Load::default() };
        assert_eq!(does_not_count(&other, true).as_ref(), Some(&other.outdated_because));
    }
}
