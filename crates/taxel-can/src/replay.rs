//! A candump log, plain or gzipped, as a source: at its own pace, faster, or as fast as it can be read.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use flate2::read::MultiGzDecoder;
use taxel_skin::Time;
use taxel_wire::candump::parse_line_bytes;
use taxel_wire::{Frame, TimedFrame};
use tokio::time::{Instant, sleep_until};

use crate::source::{Batch, FrameSource, SendError, SourceError};

/// Frames per batch at the most.
const FRAMES: usize = 512;

/// A line of a log is shorter than 80 characters; anything this long is no log.
const LINE_MAX: usize = 4096;

/// Bad lines that are kept with their reasons.
const TOLD_MAX: usize = 5;

/// How fast a log is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// So many times as fast as it was written; 1 is its own pace.
    Times(f64),
    /// As fast as it can be read.
    Unlimited,
}

/// What of a log could not be used.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReplayReport {
    /// Lines read, without empty ones.
    pub lines: u64,
    /// Frames that came out.
    pub frames: u64,
    /// Frames of other interfaces.
    pub other_interfaces: u64,
    /// Lines that are no frame.
    pub bad_lines: u64,
    /// Frames whose time is before that of the frame before.
    pub backwards: u64,
    /// The first few bad lines: number and reason.
    pub told: Vec<String>,
}

/// Reads a log, synchronously.
pub struct LogReader {
    input: Box<dyn BufRead + Send>,
    interface: Option<String>,
    line: Vec<u8>,
    number: u64,
    last: Option<Time>,
    report: ReplayReport,
}

impl LogReader {
    /// Opens a log, plain or gzipped by its first bytes; only `interface`, if given, is read of it.
    ///
    /// # Errors
    /// [`SourceError::Io`] with the path.
    pub fn open(path: &Path, interface: Option<String>) -> Result<Self, SourceError> {
        let fail = |source| SourceError::Io { what: path.display().to_string(), source };
        let mut file = BufReader::with_capacity(1 << 18, File::open(path).map_err(fail)?);
        let gzipped = file.fill_buf().map_err(fail)?.starts_with(&[0x1F, 0x8B]);
        let input: Box<dyn BufRead + Send> =
            if gzipped { Box::new(BufReader::with_capacity(1 << 18, MultiGzDecoder::new(file))) } else { Box::new(file) };
        let (line, report) = (Vec::with_capacity(128), ReplayReport::default());
        Ok(Self { input, interface, line, number: 0, last: None, report })
    }

    /// Appends up to `max` frames; returns whether there may be more.
    ///
    /// # Errors
    /// [`SourceError::Io`] if the file cannot be read on, with the line.
    pub fn read(&mut self, max: usize, frames: &mut Vec<TimedFrame>) -> Result<bool, SourceError> {
        let enough = frames.len() + max;
        while frames.len() < enough {
            if !self.read_line()? {
                return Ok(false);
            }
            if let Some(frame) = self.parse_line() {
                frames.push(frame);
            }
        }
        Ok(true)
    }

    fn read_line(&mut self) -> Result<bool, SourceError> {
        self.line.clear();
        let mut limited = self.input.by_ref().take(LINE_MAX as u64);
        let read = limited.read_until(b'\n', &mut self.line);
        let number = self.number + 1;
        let read = read.map_err(|source| SourceError::Io { what: format!("line {number}"), source })?;
        self.number = number;
        Ok(read > 0)
    }

    fn parse_line(&mut self) -> Option<TimedFrame> {
        if self.line.iter().all(u8::is_ascii_whitespace) {
            return None;
        }
        self.report.lines += 1;
        match parse_line_bytes(&self.line) {
            Ok(line) if self.interface.as_ref().is_some_and(|wanted| wanted != line.interface) => {
                self.report.other_interfaces += 1;
                None
            }
            Ok(line) => {
                self.report.frames += 1;
                self.report.backwards += u64::from(self.last.is_some_and(|last| line.time < last));
                self.last = Some(line.time);
                Some(TimedFrame { time: line.time, frame: line.frame })
            }
            Err(error) => {
                self.report.bad_lines += 1;
                if self.report.told.len() < TOLD_MAX {
                    self.report.told.push(format!("line {}: {error}", self.number));
                }
                None
            }
        }
    }

    /// What was read so far, and what of it could not be used.
    #[must_use]
    pub const fn report(&self) -> &ReplayReport {
        &self.report
    }
}

/// A log as a source.
pub struct Replay {
    reader: LogReader,
    pace: Pace,
    ahead: Vec<TimedFrame>,
    given: usize,
    more: bool,
    begun: Option<(Time, Instant)>,
}

impl Replay {
    /// A source that reads at the given pace.
    #[must_use]
    pub const fn new(reader: LogReader, pace: Pace) -> Self {
        Self { reader, pace, ahead: Vec::new(), given: 0, more: true, begun: None }
    }

    /// What was read so far, and what of it could not be used.
    #[must_use]
    pub const fn report(&self) -> &ReplayReport {
        self.reader.report()
    }

    /// When a frame is due.
    fn due(&mut self, time: Time) -> Option<Instant> {
        let Pace::Times(speed) = self.pace else { return None };
        let (first, begun) = *self.begun.get_or_insert_with(|| (time, Instant::now()));
        Some(begun + time.since(first).div_f64(speed))
    }
}

impl FrameSource for Replay {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        if self.given >= self.ahead.len() && self.more {
            self.ahead.clear();
            self.given = 0;
            self.more = self.reader.read(FRAMES, &mut self.ahead)?;
        }
        let Some(first) = self.ahead.get(self.given).copied() else {
            batch.end = true;
            return Ok(());
        };
        if let Some(due) = self.due(first.time) {
            sleep_until(due).await;
        }
        let now = Instant::now();
        while let Some(&frame) = self.ahead.get(self.given) {
            if self.due(frame.time).is_some_and(|due| due > now) {
                break;
            }
            batch.frames.push(frame);
            self.given += 1;
        }
        if batch.frames.is_empty() {
            // The runtime's timer woke a moment early: the first frame is due all the same.
            batch.frames.push(first);
            self.given += 1;
        }
        Ok(())
    }

    async fn send(&mut self, _frame: &Frame) -> Result<(), SendError> {
        Err(SendError::ListenOnly)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use taxel_wire::CanId;

    const LOG: &str = "(1600000000.000000) can0 4D0#40F0\n\n(1600000000.010000) can1 4D1#01\nnonsense\n\
                       (1600000000.030000) can0 4D2#02\n(1600000000.020000) can0 4D3#03\n";

    fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(bytes).unwrap();
        file
    }

    fn gzip(text: &str) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(text.as_bytes()).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn plain_and_gzipped_logs_give_the_same_frames_and_bad_lines_are_counted() {
        for bytes in [LOG.as_bytes().to_vec(), gzip(LOG)] {
            let file = file(&bytes);
            let mut reader = LogReader::open(file.path(), Some("can0".to_owned())).unwrap();
            let mut frames = Vec::new();
            assert!(!reader.read(100, &mut frames).unwrap());
            let ids: Vec<CanId> = frames.iter().map(|f| f.frame.id).collect();
            assert_eq!(ids, [0x4D0, 0x4D2, 0x4D3].map(CanId::Standard));
            let report = reader.report();
            assert_eq!((report.lines, report.frames, report.other_interfaces), (5, 3, 1));
            assert_eq!((report.bad_lines, report.backwards), (1, 1));
            assert!(report.told[0].starts_with("line 4: "), "{:?}", report.told);
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = LogReader::open(Path::new("/nowhere/x.log"), None).err().unwrap().to_string();
        assert!(error.starts_with("/nowhere/x.log: "), "{error}");
    }

    #[test]
    fn a_file_without_line_ends_is_refused_piece_by_piece_in_bounded_memory() {
        let file = file(&vec![b'x'; 100_000]);
        let mut reader = LogReader::open(file.path(), None).unwrap();
        assert!(!reader.read(10, &mut Vec::new()).unwrap());
        assert_eq!(reader.report().bad_lines, 100_000_u64.div_ceil(LINE_MAX as u64));
        assert!(reader.line.capacity() <= 2 * LINE_MAX);
    }

    #[tokio::test(start_paused = true)]
    async fn pace_follows_the_log() {
        let file = file(LOG.as_bytes());
        let begun = Instant::now();
        let mut source = Replay::new(LogReader::open(file.path(), None).unwrap(), Pace::Times(2.0));
        let mut batch = Batch::default();
        let mut seen = Vec::new();
        while !batch.end {
            source.next(&mut batch).await.unwrap();
            seen.extend(batch.frames.iter().map(|_| begun.elapsed().as_millis()));
        }
        assert_eq!(seen, [0, 5, 15, 15], "twice as fast; a frame out of order comes when it is read");
    }
}
