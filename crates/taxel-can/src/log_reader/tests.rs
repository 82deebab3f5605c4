use super::*;
use flate2::{Compression, write::GzEncoder};
use proptest::prelude::*;
use std::io::Write;
use taxel_skin::Time;
use taxel_wire::candump::{LogError, write_line};
use taxel_wire::{CanId, Frame};

use crate::log_report::BadLine;

const LOG: &str = "(1.000000) can0 301#01\n\n# a comment\n(2.000000) can1 302#02\nnonsense\n(1.500000) can0 301#03";

/// Reads a few bytes at a time, as a pipe may.
struct Dribble(Cursor<Vec<u8>>, usize);

impl Read for Dribble {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let length = to.len().min(self.1);
        self.0.read(&mut to[..length])
    }
}

fn reader(bytes: &[u8], interface: Option<&str>) -> LogReader {
    LogReader::from_reader("log".to_owned(), Cursor::new(bytes.to_vec()), interface.map(str::to_owned)).unwrap()
}

fn read_all(reader: &mut LogReader) -> Vec<TimedFrame> {
    let mut frames = Vec::new();
    while reader.next_batch(&mut frames, 64).unwrap() {}
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
    assert_eq!((report.lines, report.frames, report.other_interface, report.blank, report.bad), (6, 2, 1, 2, 1));
    assert_eq!(report.first_bad[0].line, 5);
    assert!(matches!(report.first_bad[0].fault, LineFault::Syntax(LogError::Syntax { column: 1, .. })));
}

#[test]
fn a_frame_from_the_past_keeps_its_time_and_is_counted() {
    let mut log = reader(LOG.as_bytes(), None);
    let frames = read_all(&mut log);
    assert_eq!(frames[2].time, Time::from_seconds(1.5));
    assert_eq!(log.report().backwards, 1);
}

/// A recording whose clock was set back by an hour, one joined before an earlier one, and two that both begin at 0.
#[test]
fn where_the_clock_steps_back_time_goes_on_and_the_report_says_where() {
    let run =
        |from_s: u32| (0..4).map(|i| format!("({}.{}) can0 301#0{i}\n", from_s + i / 2, i % 2 * 5)).collect::<String>();
    for (second, back) in [(run(5000 - 3600), "3601.5"), (run(0), "5001.5"), (run(4999), "2.5")] {
        let mut log = reader(format!("{}\n{second}", run(5000)).as_bytes(), None);
        let frames = read_all(&mut log);
        let times: Vec<f64> = frames.iter().map(|timed| timed.time.as_seconds()).collect();
        assert_eq!(times, [5000.0, 5000.5, 5001.0, 5001.5, 5001.6, 5002.1, 5002.6, 5003.1], "by {back}");
        assert_eq!(log.report().backwards, 0);
        let said = log.report().words();
        assert!(said[0].starts_with(&format!("the clock stepped back by {back} s at line 6: ")), "{said:?}");
    }
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
fn times_from_frame_to_frame_are_suspected() {
    let text: String = (0..20).map(|i| format!(" (000.{:06})  can0  301   [0]\n", i % 3 * 100)).collect();
    let mut log = reader(text.as_bytes(), None);
    assert_eq!(read_all(&mut log).len(), 20);
    let said = log.report().words();
    assert!(said.len() == 1 && said[0].contains("as `candump -td` writes them"), "{said:?}");
}

/// What `candump -ta -e` shows: an error frame has a line more. The file is one of an editor with a byte order mark.
#[test]
fn what_a_screen_shows_is_read_and_explanations_are_no_fault() {
    let text = "\u{feff} (1.000000)  can0  301   [1]  01\r\n (1.100000)  can0  20000004   [8]  00 01 00 00 00 00 00 00   \
                ERRORFRAME\r\n\tcontroller-problem{rx-overflow}\r\n (1.200000)  can0  301   [2]  01 02   '..'\r\n";
    for bytes in [text.as_bytes().to_vec(), gzipped(text.as_bytes())] {
        let mut log = reader(&bytes, None);
        assert_eq!(read_all(&mut log).len(), 3);
        assert_eq!((log.report().lines, log.report().blank, log.report().bad), (4, 1, 0));
    }
    let mut log = reader(b"  can0  301   [1]  01\n", None);
    assert!(read_all(&mut log).is_empty());
    let said = log.report().words();
    assert_eq!(said[0], "1 of 1 lines are no frame:");
    assert!(
        said[1].starts_with("  line 1: column 3: ") && said[1].ends_with("record with `candump -l` or `candump -ta`"),
        "{said:?}"
    );
}

/// Of a controller without a clock of its own, and of a table of whole seconds.
#[test]
fn times_that_tell_nothing_are_named() {
    let words = |time: fn(u32) -> String| {
        let text: String = (0..20).map(|i| format!("({}) can0 301#\n", time(i))).collect();
        let mut log = reader(text.as_bytes(), None);
        read_all(&mut log);
        log.report().words()
    };
    assert_eq!(words(|_| "0.5".to_owned()), ["all 20 frames share one time (0.5 s): record without -H"]);
    let whole = words(|i| format!("{}.000000", 7 + i / 5));
    assert!(whole.len() == 1 && whole[0].starts_with("all times of its 20 frames are whole seconds"), "{whole:?}");
    assert_eq!(words(|i| format!("7.{i:06}")), Vec::<String>::new());
}

#[test]
fn lost_frames_of_another_interface_are_no_loss() {
    let text = "(1.5) can0 301#\nDROPCOUNT: dropped 1 CAN frame on 'can1' socket (total drops 1)\n";
    let mut log = reader(text.as_bytes(), Some("can0"));
    read_all(&mut log);
    assert_eq!((log.report().lost, log.take_lost(), log.report().words()), (0, 0, Vec::new()));
}

#[test]
fn gzip_is_known_by_its_bytes_also_in_several_members() {
    let two = [gzipped(LOG.as_bytes()), gzipped(b"\n(3.0) can0 301#04\n")].concat();
    assert_eq!(read_all(&mut reader(&two, None)).len(), 4);
}

/// As PowerShell redirects.
#[test]
fn a_log_in_utf_16_is_read() {
    let text = format!("\u{feff}{}", LOG.replace('\n', "\r\n"));
    let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    for bytes in [gzipped(&bytes), bytes] {
        let mut log = reader(&bytes, None);
        assert_eq!((read_all(&mut log).len(), log.report().lines), (3, 6));
    }
}

#[test]
fn another_program_s_log_is_refused_when_it_is_opened() {
    let text = b"date Sam Sep 13 12:26:40 2020\nbase hex  timestamps absolute\n".to_vec();
    let Err(fault) = LogReader::from_reader("d.asc".to_owned(), Cursor::new(text), None) else { panic!("opened") };
    assert!(fault.to_string().starts_with("d.asc: it is a Vector ASC log, which is not read."), "{fault}");
}

#[test]
fn a_cut_gzip_gives_its_lines_and_then_the_fault_with_its_place() {
    let text = "(1.000000) can0 301#01\n".repeat(100_000);
    let mut whole = gzipped(text.as_bytes());
    whole.truncate(whole.len() / 2);
    let mut log = reader(&whole, None);
    let mut frames = Vec::new();
    let fault = loop {
        match log.next_batch(&mut frames, 1000) {
            Ok(more) => assert!(more, "the end was not the log's"),
            Err(fault) => break fault,
        }
    };
    assert!(!frames.is_empty());
    assert!(matches!(fault, LogFault::Read { line, .. } if line == frames.len() as u64), "{fault}");
}

#[test]
fn a_line_without_end_is_one_bad_line_and_takes_no_memory() {
    let mut text = vec![b'x'; 3 * BLOCK_BYTES + 17];
    text.extend(b"\n(1.0) can0 301#01\n");
    text.extend([b'y'; LINE_BYTES_MAX + 1]);
    let mut log = reader(&text, None);
    assert_eq!(read_all(&mut log).len(), 1);
    assert_eq!((log.report().lines, log.report().bad), (3, 2));
    assert_eq!(log.report().first_bad[0].fault, LineFault::TooLong);
    assert_eq!(log.report().first_bad[1], BadLine { line: 3, fault: LineFault::TooLong });
    assert_eq!(log.buffer.len(), BLOCK_BYTES);
}

#[test]
fn an_empty_log_is_just_over() {
    for bytes in [&b""[..], b"\n", &[0x1F]] {
        assert!(read_all(&mut reader(bytes, None)).is_empty());
    }
}

#[test]
fn a_missing_file_is_named() {
    let Err(fault) = LogReader::open(Path::new("/nowhere/run.log"), None) else { panic!("opened") };
    assert!(fault.to_string().starts_with("/nowhere/run.log: "), "{fault}");
}

proptest! {
    /// How the input is cut into reads and batches changes nothing.
    #[test]
    fn frames_survive_any_cut(ids in prop::collection::vec(0_u16..0x800, 0..200), read in 1_usize..100, max in 1_usize..50) {
        let mut text = String::new();
        let mut expected = Vec::new();
        for (i, id) in ids.iter().enumerate() {
            let time = Time::from_nanos(i as i64 * 1_000);
            let frame = Frame::of(CanId::Standard(*id), [i as u8; 3]);
            write_line(&mut text, time, "can0", &frame).unwrap();
            expected.push(TimedFrame { time, frame });
        }
        let input = Dribble(Cursor::new(text.into_bytes()), read);
        let mut log = LogReader::from_reader("log".to_owned(), input, None).unwrap();
        let mut frames = Vec::new();
        loop {
            let before = frames.len();
            let more = log.next_batch(&mut frames, max).unwrap();
            prop_assert!(frames.len() - before <= max);
            if !more { break; }
        }
        prop_assert_eq!(frames, expected);
    }

    #[test]
    fn no_bytes_panic_and_all_lines_are_counted(bytes: Vec<u8>) {
        prop_assume!(!bytes.starts_with(&GZIP_MAGIC) && ForeignLog::of(&bytes).is_none() && !is_utf16(&bytes));
        let mut log = reader(&bytes, Some("can0"));
        read_all(&mut log);
        let report = log.report();
        prop_assert_eq!(report.lines, report.frames + report.other_interface + report.blank + report.bad);
    }
}
