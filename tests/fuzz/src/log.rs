//! Whole logs, plain or gzipped, that come in pieces of any size.

use std::io::{self, Read};
use std::time::Duration;

use taxel_can::{LogReader, LogReport, RecordedFrames as _};
use taxel_skin::Time;
use taxel_wire::TimedFrame;
use taxel_wire::candump::parse_line;

/// A line that is longer comes in pieces.
const LINE_BYTES_MAX: usize = 4096;
/// By so much the times of frames may be out of order.
const OUT_OF_ORDER_MAX: Duration = Duration::from_secs(1);

/// What some editors begin a file with: UTF-16 and UTF-8.
const MARKS: [&[u8]; 3] = [&[0xFF, 0xFE], &[0xFE, 0xFF], &[0xEF, 0xBB, 0xBF]];

/// The size of the pieces, then the log.
pub fn run(data: &[u8]) {
    let Some((pieces, log)) = data.split_first() else { return };
    let (frames, report, whole) = read(log, log.len().max(1), None);
    assert_eq!(frames.len() as u64, report.frames);
    assert!(report.lines >= report.frames + report.other_interface + report.bad);
    assert!(report.first_bad.len() as u64 <= report.bad.min(5));
    assert!(report.first_bad.iter().all(|bad| bad.line <= report.lines && !bad.fault.to_string().is_empty()));
    let in_pieces = read(log, 1 + usize::from(*pieces), None);
    let common = frames.len().min(in_pieces.0.len());
    assert_eq!(frames[..common], in_pieces.0[..common], "in pieces of {}", 1 + usize::from(*pieces));
    // How much of a damaged gzip is unpacked before the damage is seen depends on its pieces.
    assert!(in_pieces.2 == whole && (!whole || (in_pieces.0.len(), &in_pieces.1) == (common, &report)));
    if !log.starts_with(&[0x1F, 0x8B]) {
        assert!(whole, "a plain log is read to its end");
        compare(log, &frames, &report);
    }
    let (of_one, report_of_one, _) = read(log, log.len().max(1), Some("can0".to_owned()));
    assert_eq!(report_of_one.frames + report_of_one.other_interface, report.frames);
    assert!(of_one.len() <= frames.len());
}

/// The frames, what became of the lines, and whether the log was read to its end.
fn read(log: &[u8], piece: usize, interface: Option<String>) -> (Vec<TimedFrame>, LogReport, bool) {
    let input = Pieces { log: log.to_vec(), at: 0, piece };
    let mut reader = LogReader::new("a log".to_owned(), input, interface);
    let mut frames = Vec::new();
    loop {
        let before = frames.len();
        if !reader.next_batch(&mut frames, 3) {
            let report = reader.report().clone();
            assert!(report.faults.iter().all(|fault| fault.starts_with("a log: ")), "{report:?}");
            let whole = report.faults.is_empty();
            return (frames, report, whole);
        }
        assert!(frames.len() == before + 3 || reader.take_lost() > 0);
    }
}

/// A plain log is what its lines are, one by one.
fn compare(log: &[u8], frames: &[TimedFrame], report: &LogReport) {
    if MARKS.iter().any(|mark| log.starts_with(mark)) {
        return; // it is read as a text of other bytes
    }
    let lines = log.split_inclusive(|byte| *byte == b'\n').flat_map(|line| line.chunks(LINE_BYTES_MAX));
    assert_eq!(report.lines, lines.clone().count() as u64);
    let parsed = lines.filter_map(|line| parse_line(line).ok());
    let expected: Vec<TimedFrame> = parsed.map(|line| TimedFrame { time: line.time, frame: line.frame }).collect();
    // A clock that was set goes on; until then times are those of the lines.
    let mut newest = Time::default();
    for (frame, expected) in frames.iter().zip(&expected) {
        assert_eq!(frame.frame, expected.frame);
        assert!(newest.since(frame.time) <= OUT_OF_ORDER_MAX, "{frame:?}");
        newest = newest.max(frame.time);
    }
    assert_eq!(frames.len(), expected.len());
    assert!(report.times.steps > 0 || frames == expected);
}

/// Gives so many bytes at a time.
struct Pieces {
    log: Vec<u8>,
    at: usize,
    piece: usize,
}

impl Read for Pieces {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let length = into.len().min(self.piece).min(self.log.len() - self.at);
        into[..length].copy_from_slice(&self.log[self.at..][..length]);
        self.at += length;
        Ok(length)
    }
}
