//! Recordings.

use std::io::{Cursor, Read};
use std::sync::mpsc;

use taxel_mcap::{CandumpText, Chunks, Ending, Input};
use taxel_wire::candump::parse_line;

/// Inputs are so short that what unpacks to more than this would be a bomb.
const UNPACKED_MAX: usize = 64 << 20;

/// A file, as records and as the text of its frames.
pub fn run(data: &[u8]) {
    check_records(data);
    let (text, ending) = read(data, 4096, None);
    check_text(&text, &ending);
    assert_eq!(read(data, 7, None), (text.clone(), ending.clone()), "in small pieces");
    let (_, of_one) = read(data, 4096, Some("can0".to_owned()));
    // Bad frames of other buses are not looked at.
    assert!(of_one.frames <= ending.frames && of_one.bad <= ending.bad && of_one.faults == ending.faults);
    assert_eq!(of_one.frames + of_one.other_bus + of_one.bad, ending.frames + ending.bad);
}

/// An end, after which there is nothing, and no more memory than a chunk may have.
fn check_records(data: &[u8]) {
    let mut chunks = Chunks::new(data);
    let mut bytes = 0;
    loop {
        match chunks.next_record() {
            Ok(Some(record)) => bytes += record.body.len(),
            Ok(None) => break,
            Err(fault) => {
                assert!(!fault.to_string().is_empty());
                break;
            }
        }
    }
    assert!(bytes <= UNPACKED_MAX, "{bytes} bytes of {}", data.len());
    assert!(matches!(chunks.next_record(), Ok(None)), "there is nothing after the end");
}

/// Every frame is a line that can be read, and what ended the file is said.
fn check_text(text: &str, ending: &Ending) {
    assert_eq!(text.lines().count() as u64, ending.frames);
    for line in text.lines() {
        let parsed = parse_line(line);
        assert!(parsed.is_ok(), "{line}: {parsed:?}");
    }
    assert!(ending.faults.len() <= 1 && ending.words().iter().all(|words| !words.is_empty()));
}

/// The text, read so many bytes at a time, and how it ended.
fn read(data: &[u8], piece: usize, bus: Option<String>) -> (String, Ending) {
    let (told, ending) = mpsc::channel();
    let input = Input::Open("a recording".to_owned(), Box::new(Cursor::new(data.to_vec())));
    let mut reader = CandumpText::new(vec![input], bus, move |ending| drop(told.send(ending.clone())));
    let (mut text, mut buffer) = (Vec::new(), vec![0; piece]);
    loop {
        match reader.read(&mut buffer).expect("a text has no faults of its own") {
            0 => break,
            length => text.extend_from_slice(&buffer[..length]),
        }
    }
    (String::from_utf8(text).expect("a text"), ending.recv().expect("it is told once"))
}
