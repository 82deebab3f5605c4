//! What lies between the frames: errors of the controller and starts of the machine.

use std::path::Path;

use prost::Message as _;
use taxel_mcap::{BOOT, Ending, Folder, FrameTap, Input, Limits, McapFile, frames_message, open_file};
use taxel_proto::v1::CanFrames;
use taxel_skin::Time;
use taxel_wire::candump::{parse_line, write_line};
use taxel_wire::{CanId, Frame, FrameKind, TimedFrame};

use crate::{WALL_NS, frame, limits, read, start, topics, wait};

/// The controller goes off when this frame comes.
fn off(number: u64) -> TimedFrame {
    let frame_of_error = Frame::new(CanId::Extended(0x40), FrameKind::Error, &[0; 8]).unwrap();
    TimedFrame { frame: frame_of_error, ..frame(number) }
}

/// The text of all files of a folder.
fn read_folder(folder: &Path) -> (String, Ending) {
    let files = Folder::list(folder).unwrap();
    read(files.iter().map(|(name, _)| Input::File(folder.join(name.to_string()))).collect(), None)
}

/// What the daemon took the zero for lost by takes it in a replay, too.
#[test]
fn what_a_controller_told_stands_where_it_happened() {
    let scratch = tempfile::tempdir().unwrap();
    let (recorder, queue) = start(scratch.path(), limits());
    let mut tap = FrameTap::new(queue, 0, "can0".to_owned(), String::new());
    tap.take(&[frame(0), frame(1), frame(2)], &[off(1)], WALL_NS);
    tap.take(&[frame(3)], &[], WALL_NS);
    tap.take(&[], &[off(4)], WALL_NS);
    recorder.finish();
    let mut expected = String::new();
    // The engine heard of the error before it took the frames that were read with it.
    for TimedFrame { time, frame } in [off(1), frame(0), frame(1), frame(2), frame(3), off(4)] {
        write_line(&mut expected, Time::from_nanos(WALL_NS + time.as_nanos()), "can0", &frame).unwrap();
    }
    assert_eq!(read_folder(scratch.path()), (expected, Ending { frames: 6, ..Ending::default() }));
}

/// The disk may be behind just then, and the zero is lost all the same.
#[test]
fn an_error_that_found_no_room_comes_with_what_does() {
    let scratch = tempfile::tempdir().unwrap();
    let (recorder, queue) = start(scratch.path(), Limits { file_bytes: 1 << 30, budget_bytes: 1 << 32, ..limits() });
    let status = recorder.status();
    wait("the first file", || !status().file.is_empty());
    let mut tap = FrameTap::new(queue, 0, "can0".to_owned(), String::new());
    let frames: Vec<TimedFrame> = (0..2_000).map(frame).collect();
    let mut errors = 0;
    wait("a loss", || {
        errors += 1;
        tap.take(&frames, &[off(errors)], WALL_NS);
        status().lost > 0
    });
    let (lost, mut after) = (status().lost, 0);
    wait("room", || {
        after += 1;
        tap.take(&frames[..1], &[], WALL_NS);
        status().lost == lost + after - 1
    });
    recorder.finish();
    let text = read_folder(scratch.path()).0;
    assert_eq!(text.lines().filter(|line| line.contains(" 20000040#")).count() as u64, errors);
}

/// When two frames of each file were received, by what was read of them, in ms after the first. Of each file are given: which
/// start of the machine it names, and the clock of the daemon and that of the wall at its first frame.
fn through_starts(files: &[(Option<&str>, i64, i64)]) -> Vec<i64> {
    let scratch = tempfile::tempdir().unwrap();
    let mut inputs = Vec::new();
    for (number, &(awake, clock_ms, wall_ms)) in files.iter().enumerate() {
        let path = scratch.path().join(number.to_string());
        let about = awake.map(|boot| (BOOT.to_owned(), boot.to_owned())).into_iter().collect();
        let mut file = McapFile::begin(open_file(&path).unwrap(), &topics(), about).unwrap();
        for after_ms in [0, 50] {
            let time = Time::from_nanos((clock_ms + after_ms) * 1_000_000);
            let frames = [TimedFrame { time, ..frame(7) }];
            let message = frames_message(&frames, WALL_NS + (wall_ms + after_ms) * 1_000_000);
            file.write(0, 7, &CanFrames { bus: "can0".to_owned(), ..message }.encode_to_vec()).unwrap();
        }
        file.finish().unwrap();
        inputs.push(Input::File(path));
    }
    let (text, ending) = read(inputs, None);
    assert!(ending.faults.is_empty() && ending.bad == 0, "{ending:?}");
    let times: Vec<i64> = text.lines().map(|line| parse_line(line).unwrap().time.as_nanos() / 1_000_000).collect();
    times.iter().map(|time| time - times[0]).collect()
}

/// A robot without a battery clock may say nothing of how long it was off, and its boards are off with it.
#[test]
fn a_start_of_the_machine_is_never_without_a_silence() {
    let (one, other) = (Some("0123456789abcdef"), Some("fedcba9876543210"));
    let same = through_starts(&[(one, 20_000, 0), (one, 20_100, 7_000)]);
    assert_eq!(same, [0, 50, 100, 150], "of one start, whatever the wall clock was set to");
    let as_if_it_went_on = through_starts(&[(one, 20_000, 0), (other, 20_100, 100)]);
    assert_eq!(as_if_it_went_on, [0, 50, 10_050, 10_100]);
    assert_eq!(through_starts(&[(one, 90_000, 0), (other, 9_000, 300_000)]), [0, 50, 300_000, 300_050]);
    assert_eq!(through_starts(&[(one, 90_000, 0), (other, 9_000, -300_000)]), [0, 50, 10_050, 10_100]);
    let by_the_clock = through_starts(&[(None, 90_000, 0), (None, 9_000, 100), (None, 9_100, 0)]);
    assert_eq!(by_the_clock, [0, 50, 10_050, 10_100, 10_150, 10_200], "of files that say nothing");
}
