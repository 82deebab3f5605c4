//! candump logs, read as fast as they can be: no allocation a line, and no line lost in silence.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;
use taxel_skin::Time;
use taxel_wire::TimedFrame;
use taxel_wire::candump::{LogError, parse_line_bytes};
use thiserror::Error;

/// Bytes asked of the file at once.
const BLOCK_BYTES: usize = 256 * 1024;
/// Longest line that is read: a frame's is at most 80 bytes. What is longer is refused as a whole.
const LINE_BYTES_MAX: usize = 4096;
/// Bad lines that are kept with their reason; all are counted.
const BAD_LINES_TOLD: usize = 5;
const GZIP_MAGIC: [u8; 2] = [0x1F, 0x8B];

/// The log cannot be opened, or not be read on.
#[derive(Debug, Error)]
pub enum LogFault {
    /// The file cannot be opened.
    #[error("{}: {error}", path.display())]
    Open {
        /// The log.
        path: PathBuf,
        /// The system's answer.
        error: io::Error,
    },
    /// Reading or unpacking failed. All complete lines before were handed out; of a damaged gzip those lack that were
    /// unpacked together with the damage, at most a block.
    #[error("{name}: after line {line}: {error}")]
    Read {
        /// The log.
        name: String,
        /// The last complete line, from 1.
        line: u64,
        /// The system's or the decoder's answer.
        error: io::Error,
    },
}

/// Why a line holds no frame.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum LineFault {
    /// It is not as candump writes it.
    #[error(transparent)]
    Syntax(#[from] LogError),
    /// It is too long to be a frame.
    #[error("longer than {LINE_BYTES_MAX} bytes")]
    TooLong,
}

/// A line that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadLine {
    /// Its number, from 1.
    pub line: u64,
    /// Why.
    pub fault: LineFault,
}

/// What became of the lines. `lines` is the sum of `frames`, `other_interface`, `blank` and `bad`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogReport {
    /// Lines read.
    pub lines: u64,
    /// Lines handed out as frames.
    pub frames: u64,
    /// Frames of interfaces not asked for.
    pub other_interface: u64,
    /// Empty lines and comments (`#` first).
    pub blank: u64,
    /// Lines refused.
    pub bad: u64,
    /// The first few of them.
    pub first_bad: Vec<BadLine>,
    /// Frames handed out whose time was before that of the frame before. They keep their time.
    pub backwards: u64,
}

/// A candump log, plain or gzipped, from its first line to its last.
pub struct LogReader {
    name: String,
    input: Box<dyn Read + Send>,
    interface: Option<String>,
    /// `buffer[start..end]` is read and not yet parsed.
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    over: bool,
    /// Within a line that is too long.
    skipping: bool,
    newest: Option<Time>,
    report: LogReport,
}

impl LogReader {
    /// Opens a log; whether it is gzipped is seen by its first bytes, not by its name.
    /// With `interface`, frames of other interfaces are left out and counted.
    ///
    /// # Errors
    /// [`LogFault`] if the file cannot be opened or its first bytes not be read.
    pub fn open(path: &Path, interface: Option<String>) -> Result<Self, LogFault> {
        let file = File::open(path).map_err(|error| LogFault::Open { path: path.to_owned(), error })?;
        Self::from_reader(path.display().to_string(), file, interface)
    }

    /// As [`LogReader::open`], of anything that can be read; `name` is for errors.
    ///
    /// # Errors
    /// [`LogFault`] if the first bytes cannot be read.
    pub fn from_reader(
        name: String,
        mut input: impl Read + Send + 'static,
        interface: Option<String>,
    ) -> Result<Self, LogFault> {
        let mut magic = Vec::with_capacity(GZIP_MAGIC.len());
        if let Err(error) = input.by_ref().take(GZIP_MAGIC.len() as u64).read_to_end(&mut magic) {
            return Err(LogFault::Read { name, line: 0, error });
        }
        let gzipped = magic == GZIP_MAGIC;
        let whole = Cursor::new(magic).chain(input);
        let input: Box<dyn Read + Send> = if gzipped {
            Box::new(MultiGzDecoder::new(io::BufReader::with_capacity(BLOCK_BYTES, whole)))
        } else {
            Box::new(whole)
        };
        Ok(Self {
            name,
            input,
            interface,
            buffer: vec![0; BLOCK_BYTES],
            start: 0,
            end: 0,
            over: false,
            skipping: false,
            newest: None,
            report: LogReport::default(),
        })
    }

    /// What became of the lines so far.
    #[must_use]
    pub fn report(&self) -> &LogReport {
        &self.report
    }

    /// Appends up to `max` frames (of every kind, error frames too) in the order of the log. `false`: the log is over.
    ///
    /// # Errors
    /// [`LogFault`] if the log cannot be read on; `frames` holds what was read before.
    pub fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> Result<bool, LogFault> {
        let mut room = max;
        while room > 0 {
            let Some(line) = self.next_line() else {
                if self.over {
                    return Ok(false);
                }
                self.fill()?;
                continue;
            };
            if let Some(frame) = self.parse(line) {
                frames.push(frame);
                room -= 1;
            }
        }
        Ok(true)
    }

    /// The place in the buffer of the next line, without its line feed; `None` if no complete one is there.
    fn next_line(&mut self) -> Option<(usize, usize)> {
        let rest = &self.buffer[self.start..self.end];
        let length = match rest.iter().position(|&byte| byte == b'\n') {
            Some(length) => length,
            // The last line may lack its line feed.
            None if self.over && !rest.is_empty() => rest.len(),
            None => return None,
        };
        let line = (self.start, self.start + length);
        self.start = (line.1 + 1).min(self.end);
        Some(line)
    }

    fn parse(&mut self, (from, to): (usize, usize)) -> Option<TimedFrame> {
        self.report.lines += 1;
        let line = &self.buffer[from..to];
        if self.skipping || line.len() > LINE_BYTES_MAX {
            self.skipping = false;
            self.refuse(LineFault::TooLong);
            return None;
        }
        let parsed = match parse_line_bytes(line) {
            Ok(parsed) => parsed,
            Err(error) => {
                match line.trim_ascii_start().first() {
                    None | Some(b'#') => self.report.blank += 1,
                    Some(_) => self.refuse(error.into()),
                }
                return None;
            }
        };
        if self.interface.as_deref().is_some_and(|wanted| wanted != parsed.interface) {
            self.report.other_interface += 1;
            return None;
        }
        let timed = TimedFrame { time: parsed.time, frame: parsed.frame };
        self.report.frames += 1;
        self.report.backwards += u64::from(self.newest.is_some_and(|before| timed.time < before));
        self.newest = Some(timed.time);
        Some(timed)
    }

    #[cold]
    fn refuse(&mut self, fault: LineFault) {
        self.report.bad += 1;
        if self.report.first_bad.len() < BAD_LINES_TOLD {
            self.report.first_bad.push(BadLine { line: self.report.lines, fault });
        }
    }

    /// Reads on behind the incomplete line, which moves to the buffer's beginning.
    fn fill(&mut self) -> Result<(), LogFault> {
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        if self.end > LINE_BYTES_MAX {
            // One byte is kept, so that its end is still seen as a line's.
            self.skipping = true;
            self.end = 1;
        }
        loop {
            match self.input.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.over = true,
                Ok(read) => self.end += read,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => {
                    return Err(LogFault::Read { name: self.name.clone(), line: self.report.lines, error });
                }
            }
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests;
