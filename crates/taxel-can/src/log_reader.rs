//! candump logs, read as fast as they can be: no allocation a line, and no line lost in silence.

use std::io::{BufRead, BufReader, Cursor, Read};

use flate2::read::MultiGzDecoder;
use taxel_wire::candump::parse_line;
use taxel_wire::{FrameKind, TimedFrame};

use crate::log_report::LogReport;
use crate::recorded::RecordedFrames;

/// Bytes asked of the file at once.
const BLOCK_BYTES: usize = 256 * 1024;
/// A frame's line has at most 300 bytes. A longer line comes in pieces, each of which is refused.
const LINE_BYTES_MAX: u64 = 4096;
const GZIP_MAGIC: [u8; 2] = [0x1F, 0x8B];
/// What shells and editors of Windows begin a file with: UTF-16 in both orders, and UTF-8.
const MARKS: [&[u8]; 3] = [&[0xFF, 0xFE], &[0xFE, 0xFF], &[0xEF, 0xBB, 0xBF]];
/// What `candump -d` writes where the kernel lost frames: `DROPCOUNT: dropped 300 CAN frames on 'can0' socket (total ...)`.
const DROPPED: &[u8] = b"DROPCOUNT: dropped ";

/// A candump log, plain or gzipped, from its first line to its last.
pub struct LogReader {
    name: String,
    input: BufReader<Box<dyn Read + Send>>,
    interface: Option<String>,
    line: Vec<u8>,
    /// Lost before the line that comes, and not told yet.
    lost: u64,
    report: LogReport,
}

impl LogReader {
    /// A log of anything that can be read; whether it is gzipped or UTF-16 is seen by its first bytes. `name` is for faults. With
    /// `interface`, frames of other interfaces are left out and counted. Where it cannot be read on the report tells it: all
    /// complete lines before are handed out, but of a damaged gzip those that were unpacked together with the damage.
    #[must_use]
    pub fn new(name: String, mut input: impl Read + Send + 'static, interface: Option<String>) -> Self {
        let mut magic = Vec::new();
        let mut begun = input.by_ref().take(3).read_to_end(&mut magic);
        let gzipped = magic.starts_with(&GZIP_MAGIC);
        if MARKS.iter().any(|mark| magic.starts_with(mark)) {
            begun = begun.and_then(|_| input.read_to_end(&mut magic));
            magic = taxel_skin::text::decode(&magic).into_bytes();
        }
        let mut report = LogReport::default();
        report.faults.extend(begun.err().map(|error| format!("{name}: {error}")));
        let whole = Cursor::new(magic).chain(input);
        let input: Box<dyn Read + Send> = if gzipped {
            Box::new(MultiGzDecoder::new(BufReader::with_capacity(BLOCK_BYTES, whole)))
        } else {
            Box::new(whole)
        };
        let input = BufReader::with_capacity(BLOCK_BYTES, input);
        Self { name, input, interface, line: Vec::new(), lost: 0, report }
    }

    /// The frame of the line that was read.
    fn frame(&mut self) -> Option<TimedFrame> {
        self.report.lines += 1;
        let parsed = match parse_line(&self.line) {
            Ok(parsed) => parsed,
            Err(error) => {
                if let Some(lost) = dropped(&self.line) {
                    self.lost += lost;
                    self.report.lost = self.report.lost.saturating_add(lost);
                    self.report.lost_line =
                        if self.report.lost_line > 0 { self.report.lost_line } else { self.report.lines };
                    return None;
                }
                // A tab begins what `candump -e` says of the error frame before.
                let first = self.line.trim_ascii_start().first();
                if !self.line.starts_with(b"\t") && first.is_some_and(|first| *first != b'#') {
                    self.report.refuse(error);
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
        let time = self.report.times.read(parsed.time, self.report.lines);
        Some(TimedFrame { time, frame: parsed.frame })
    }
}

/// How many frames the kernel lost, of a line that says so.
fn dropped(line: &[u8]) -> Option<u64> {
    let rest = line.strip_prefix(DROPPED)?;
    std::str::from_utf8(rest).ok()?.split(' ').next()?.parse().ok()
}

impl RecordedFrames for LogReader {
    fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> bool {
        let until = frames.len() + max;
        while frames.len() < until {
            self.line.clear();
            let read = self.input.by_ref().take(LINE_BYTES_MAX).read_until(b'\n', &mut self.line);
            let fault =
                |error| self.report.faults.push(format!("{}: after line {}: {error}", self.name, self.report.lines));
            if read.map_err(fault).unwrap_or(0) == 0 {
                return false;
            }
            frames.extend(self.frame());
            if self.lost > 0 {
                break;
            }
        }
        true
    }

    fn take_lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }

    fn report(&self) -> &LogReport {
        &self.report
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;
    use taxel_skin::Time;
    use taxel_wire::{CanId, Frame};

    const LOG: &str = "(1.000000) can0 301#01\n\n# a comment\n(2.000000) can1 302#02\nnonsense\n(1.500000) can0 301#03";

    fn reader(bytes: &[u8], interface: Option<&str>) -> LogReader {
        LogReader::new("log".to_owned(), Cursor::new(bytes.to_vec()), interface.map(str::to_owned))
    }

    fn read_all(reader: &mut LogReader) -> Vec<TimedFrame> {
        let mut frames = Vec::new();
        while reader.next_batch(&mut frames, 64) {}
        frames
    }

    fn gzipped(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn every_line_is_accounted_for() {
        let mut log = reader(LOG.as_bytes(), Some("can0"));
        let frames = read_all(&mut log);
        let expected = [(1.0, 1), (1.5, 3)].map(|(time, byte)| TimedFrame {
            time: Time::from_seconds(time),
            frame: Frame::of(CanId::Standard(0x301), [byte]),
        });
        assert_eq!(frames, expected);
        let report = log.report();
        assert_eq!((report.lines, report.frames, report.other_interface, report.bad), (6, 2, 1, 1));
        assert_eq!((report.first_bad[0].line, report.first_bad[0].fault.column), (5, 1));
        let mut all = reader(LOG.as_bytes(), None);
        assert_eq!(read_all(&mut all)[2].time, Time::from_seconds(1.5));
        assert_eq!(all.report().times.backwards, 1);
    }

    #[test]
    fn what_other_settings_of_candump_and_other_systems_write_is_read() {
        let text = "(1.0) can0 301#0011223344556677_C\nDROPCOUNT: dropped 300 CAN frames on 'can0' socket (total drops 300)\n\
                    (2.0) can0 301#01\n";
        let mut log = reader(text.as_bytes(), None);
        let mut frames = Vec::new();
        assert!(log.next_batch(&mut frames, 64));
        assert_eq!((frames.len(), frames[0].frame.bytes().len(), log.take_lost(), log.take_lost()), (1, 8, 300, 0));
        read_all(&mut log);
        assert_eq!(log.report().words(), ["the recorder lost 300 frames, the first before line 2"]);
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes: Vec<u8> = "\u{feff}(1.0) can0 301#01\n".encode_utf16().flat_map(order).collect();
            assert_eq!(read_all(&mut reader(&bytes, None)).len(), 1);
        }
        assert_eq!(read_all(&mut reader("\u{feff}(1.0) can0 301#01\n".as_bytes(), None)).len(), 1);
    }

    #[test]
    fn of_one_interface_the_clock_of_another_moves_nothing() {
        let text = "(50.0) can1 301#\n(1.0) can0 301#\n(51.0) can1 301#\n(2.0) can0 301#\n";
        let mut log = reader(text.as_bytes(), Some("can0"));
        let times: Vec<f64> = read_all(&mut log).iter().map(|timed| timed.time.as_seconds()).collect();
        assert_eq!(times, [1.0, 2.0]);
        assert_eq!(log.report().words(), Vec::<String>::new());
        assert_eq!(log.report().interfaces, ["can1", "can0"]);
    }

    #[test]
    fn times_that_tell_nothing_are_a_fault() {
        let fault = |time: fn(u32) -> String| {
            let text: String = (0..20).map(|i| format!("({}) can0 301#\n", time(i))).collect();
            let mut log = reader(text.as_bytes(), None);
            read_all(&mut log);
            log.report().time_fault()
        };
        let same = fault(|_| "0.5".to_owned()).unwrap();
        assert_eq!(same, "all 20 frames share one time: record without -H");
        let from_frame_to_frame = fault(|i| format!("0.{:06}", i % 3 * 100)).unwrap();
        assert!(from_frame_to_frame.contains("as `candump -td` writes them"), "{from_frame_to_frame}");
        assert_eq!(fault(|i| format!("7.{i:06}")), None);
    }

    #[test]
    fn gzip_is_known_by_its_bytes_also_in_several_members() {
        let two = [gzipped(LOG.as_bytes()), gzipped(b"\n(3.0) can0 301#04\n")].concat();
        assert_eq!(read_all(&mut reader(&two, None)).len(), 4);
        for bytes in [&b""[..], b"\n", &[0x1F]] {
            assert!(read_all(&mut reader(bytes, None)).is_empty());
        }
    }

    #[test]
    fn a_cut_gzip_gives_its_lines_and_then_the_fault_with_its_place() {
        let text = "(1.000000) can0 301#01\n".repeat(100_000);
        let mut whole = gzipped(text.as_bytes());
        whole.truncate(whole.len() / 2);
        let mut log = reader(&whole, None);
        let frames = read_all(&mut log);
        let [fault] = &log.report().faults[..] else { panic!("the end was not the log's") };
        assert!(!frames.is_empty() && fault.contains(&format!("log: after line {}: ", frames.len())), "{fault}");
    }

    #[test]
    fn a_line_without_end_is_refused_and_takes_no_memory() {
        let text = [vec![b'x'; 3 * BLOCK_BYTES], b"\n(1.0) can0 301#01\n".to_vec()].concat();
        let mut log = reader(&text, None);
        assert_eq!(read_all(&mut log).len(), 1);
        assert!(log.report().bad > 0 && log.line.capacity() <= 2 * LINE_BYTES_MAX as usize);
    }
}
