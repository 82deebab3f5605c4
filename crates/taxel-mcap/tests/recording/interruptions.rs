//! What lies between the frames: errors of the controller, losses, and starts of the machine.

use prost::Message as _;
use taxel_can::RecordedFrames as _;
use taxel_mcap::{FrameTap, McapFile, Recording, frames_message, open_file};
use taxel_proto::v1::CanFrames;
use taxel_skin::Time;
use taxel_wire::{CanId, Frame, FrameKind, TimedFrame};

use crate::{WALL_NS, frame, labelled, limits, read_files, read_folder, start, topics};

/// The controller goes off when this frame comes.
fn off(number: u64) -> TimedFrame {
    let frame_of_error = Frame::new(CanId::Extended(0x40), FrameKind::Error, &[0; 8]).unwrap();
    TimedFrame { frame: frame_of_error, ..frame(number) }
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
    // The engine heard of the error before it took the frames that were read with it.
    let expected = [off(1), frame(0), frame(1), frame(2), frame(3), off(4)].map(labelled);
    let (frames, report) = read_folder(scratch.path());
    assert_eq!((frames, report.errors, report.words()), (expected.to_vec(), 2, Vec::new()));
}

/// The engine hears of it before it takes the frames that follow.
#[test]
fn frames_that_were_lost_are_told_where_they_are_missing() {
    let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
    std::fs::remove_file(&path).unwrap();
    let mut file = McapFile::begin(open_file(&path).unwrap(), &topics(), Default::default()).unwrap();
    for (number, kernel_lost, not_recorded) in [(0, 0, 0), (1, 3, 4), (2, 0, 0)] {
        let message = frames_message(&[frame(number)], WALL_NS);
        let message = CanFrames { bus: "can0".to_owned(), kernel_lost, not_recorded, ..message };
        file.write(0, 7, &message.encode_to_vec()).unwrap();
    }
    file.finish().unwrap();
    let (mut recording, mut frames) = (Recording::of_files([path.to_path_buf()], None), Vec::new());
    assert!(recording.next_batch(&mut frames, 10));
    assert_eq!((frames.len(), recording.take_lost()), (1, 7));
    assert!(!recording.next_batch(&mut frames, 10));
    assert_eq!((frames.len(), recording.take_lost()), (3, 0));
}

/// When two frames of each file were received, by what was read of them, in ms after the first. Of each file are given the
/// clock of the daemon and that of the wall at its first frame.
fn through_starts(files: &[(i64, i64)]) -> Vec<i64> {
    let scratch = tempfile::tempdir().unwrap();
    let mut paths = Vec::new();
    for (number, &(clock_ms, wall_ms)) in files.iter().enumerate() {
        let path = scratch.path().join(number.to_string());
        let mut file = McapFile::begin(open_file(&path).unwrap(), &topics(), Default::default()).unwrap();
        for after_ms in [0, 50] {
            let time = Time::from_nanos((clock_ms + after_ms) * 1_000_000);
            let frames = [TimedFrame { time, ..frame(7) }];
            let message = frames_message(&frames, WALL_NS + (wall_ms + after_ms) * 1_000_000);
            file.write(0, 7, &CanFrames { bus: "can0".to_owned(), ..message }.encode_to_vec()).unwrap();
        }
        file.finish().unwrap();
        paths.push(path);
    }
    let (frames, report) = read_files(paths);
    assert!(report.faults.is_empty() && report.bad == 0, "{report:?}");
    let times: Vec<i64> = frames.iter().map(|timed| timed.time.as_nanos() / 1_000_000).collect();
    times.iter().map(|time| time - times[0]).collect()
}

/// A robot without a battery clock may say nothing of how long it was off, and its boards are off with it.
#[test]
fn a_start_of_the_machine_is_a_silence_of_ten_seconds() {
    let same = through_starts(&[(20_000, 0), (20_100, 7_000)]);
    assert_eq!(same, [0, 50, 100, 150], "of one start, whatever the wall clock was set to");
    let anew = [0, 50, 10_050, 10_100];
    assert_eq!(through_starts(&[(90_000, 0), (9_000, 300_000)]), anew);
    assert_eq!(through_starts(&[(90_000, 0), (9_000, -300_000)]), anew);
    assert_eq!(through_starts(&[(0, 0), (2 * 86_400_000, 0)]), anew, "two days between two files");
    let twice = through_starts(&[(90_000, 0), (9_000, 100), (9_100, 0)]);
    assert_eq!(twice, [0, 50, 10_050, 10_100, 10_150, 10_200]);
}
