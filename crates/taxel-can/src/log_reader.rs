//! candump logs, read as fast as they can be: no allocation a line, and no line lost in silence.
//!
//! Times go on: where the log's clock steps back by more than a second, the times after that are later than the log's
//! (`log_clock`), and the report says where. With an interface asked for its frames alone count for that.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;

use flate2::read::MultiGzDecoder;
use taxel_skin::text::{decode, is_utf16};
use taxel_wire::candump::parse_line_bytes;
use taxel_wire::{FrameKind, TimedFrame};

use crate::log_clock::LogClock;
use crate::log_fault::LogFault;
use crate::log_format::{ForeignLog, HEAD_BYTES};
use crate::log_report::{LINE_BYTES_MAX, LineFault, LogReport};
use crate::lost_line::Lost;
use crate::recorded::RecordedFrames;

/// Bytes asked of the file at once.
const BLOCK_BYTES: usize = 256 * 1024;
/// Longest log in UTF-16.
const UTF16_BYTES_MAX: u64 = 256 << 20;
const GZIP_MAGIC: [u8; 2] = [0x1F, 0x8B];
/// With it some editors begin a file.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

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
    clock: LogClock,
    report: LogReport,
    /// Frames that the recorder lost behind what was handed out last.
    lost: u64,
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
    /// [`LogFault`] if the first bytes cannot be read, or are those of another program's log.
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
        let mut reader = Self {
            name,
            input,
            interface,
            buffer: vec![0; BLOCK_BYTES],
            start: 0,
            end: 0,
            over: false,
            skipping: false,
            clock: LogClock::default(),
            report: LogReport::default(),
            lost: 0,
        };
        reader.fill_head()?;
        if is_utf16(&reader.buffer[..reader.end]) {
            reader.decode_whole()?;
        }
        match ForeignLog::of(&reader.buffer[..reader.end]) {
            Some(format) => Err(LogFault::Foreign { name: reader.name, format }),
            None => Ok(reader),
        }
    }

    fn fill_head(&mut self) -> Result<(), LogFault> {
        while self.end < HEAD_BYTES && !self.over {
            self.fill()?;
        }
        Ok(())
    }

    /// A text in UTF-16 is read as a whole: shells on Windows redirect into such files, and nobody records for days by that.
    fn decode_whole(&mut self) -> Result<(), LogFault> {
        let fault = |error| LogFault::Read { name: self.name.clone(), line: 0, error };
        let mut bytes = self.buffer[..self.end].to_vec();
        self.input.by_ref().take(UTF16_BYTES_MAX).read_to_end(&mut bytes).map_err(fault)?;
        if bytes.len() as u64 > UTF16_BYTES_MAX {
            let words = "a text in UTF-16 of more than 256 MB: `iconv -f UTF-16 -t UTF-8 IN.log > OUT.log`";
            return Err(fault(io::Error::new(io::ErrorKind::FileTooLarge, words)));
        }
        self.input = Box::new(Cursor::new(decode(&bytes).into_bytes()));
        (self.start, self.end, self.over) = (0, 0, false);
        self.fill_head()
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
            self.report.refuse(LineFault::TooLong);
            return None;
        }
        let line = if self.report.lines == 1 { line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line) } else { line };
        let parsed = match parse_line_bytes(line) {
            Ok(parsed) => parsed,
            Err(error) => {
                if let Some(lost) = Lost::read(line) {
                    let wanted =
                        self.interface.as_deref().is_none_or(|wanted| [wanted, "any"].contains(&lost.interface));
                    self.lost += if wanted { self.report.note_lost(lost.frames) } else { 0 };
                    self.report.blank += 1;
                    return None;
                }
                match (line.first(), line.trim_ascii_start().first()) {
                    (Some(b'\t'), _) | (_, None | Some(b'#')) => self.report.blank += 1,
                    _ => self.report.refuse(error.into()),
                }
                return None;
            }
        };
        self.report.note_interface(parsed.interface);
        if self.interface.as_deref().is_some_and(|wanted| wanted != parsed.interface) {
            self.report.other_interface += 1;
            return None;
        }
        self.report.frames += 1;
        self.report.errors += u64::from(parsed.frame.kind == FrameKind::Error);
        self.report.note_time(parsed.time);
        let reading = self.clock.read(parsed.time, self.report.lines, &mut self.report.clock);
        self.report.backwards += u64::from(reading.is_late);
        Some(TimedFrame { time: reading.time, frame: parsed.frame })
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

impl RecordedFrames for LogReader {
    fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> Result<bool, LogFault> {
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
            } else if self.lost > 0 {
                return Ok(true);
            }
        }
        Ok(true)
    }

    fn take_lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }

    fn report(&self) -> &LogReport {
        &self.report
    }
}

#[cfg(test)]
mod tests;
