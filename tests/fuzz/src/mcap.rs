//! Recordings.

use std::io::Cursor;

use taxel_can::{LogReport, RecordedFrames as _};
use taxel_mcap::Recording;
use taxel_wire::TimedFrame;

/// A file as frames, whatever bus they are of.
pub fn run(data: &[u8]) {
    let (frames, report) = read(data, 4096, None);
    assert_eq!(frames.len() as u64, report.frames);
    assert!(report.faults.len() <= 1 && report.words().iter().all(|words| !words.is_empty()));
    assert_eq!(read(data, 7, None), (frames, report.clone()), "in small pieces");
    let (_, of_one) = read(data, 4096, Some("can0".to_owned()));
    // Bad frames of other buses are not looked at.
    assert!(of_one.frames <= report.frames && of_one.bad <= report.bad && of_one.faults == report.faults);
    assert_eq!(of_one.lines, report.lines);
}

/// The frames, read so many at a time, and what became of everything.
fn read(data: &[u8], piece: usize, bus: Option<String>) -> (Vec<TimedFrame>, LogReport) {
    let mut recording = Recording::of_reader("a recording".to_owned(), Cursor::new(data.to_vec()), bus);
    let mut frames = Vec::new();
    while recording.next_batch(&mut frames, piece) {}
    (frames, recording.report().clone())
}
