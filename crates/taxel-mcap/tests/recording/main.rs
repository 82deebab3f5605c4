//! What is recorded can be read, whatever happens meanwhile.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test's helpers fail as the test does

mod hostile;
mod interruptions;

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use prost::Message as _;
use taxel_can::{LogReport, RecordedFrames as _};
use taxel_mcap::{
    Folder, FrameTap, Given, Limits, McapFile, Queue, Recorder, Recording, Topic, frames_message, open_file,
};
use taxel_proto::v1::CanFrames;
use taxel_skin::Time;
use taxel_wire::{CanId, Frame, TimedFrame};

const WALL_NS: i64 = 1_795_331_642_000_000_000;

fn topics() -> Vec<Topic> {
    vec![Topic { name: "/taxeld/bus/can0".to_owned(), message: "CanFrames" }]
}

fn frame(number: u64) -> TimedFrame {
    let frame = Frame::of(CanId::Standard((number % 0x7FF) as u16), number.to_le_bytes());
    TimedFrame { time: Time::from_nanos(5_000_000_000 + number as i64 * 1_000), frame }
}

fn message(numbers: std::ops::Range<u64>) -> Vec<u8> {
    let frames: Vec<TimedFrame> = numbers.map(frame).collect();
    let wall = WALL_NS + frames[0].time.as_nanos();
    CanFrames { bus: "can0".to_owned(), ..frames_message(&frames, wall) }.encode_to_vec()
}

/// These frames as they are read.
fn frames(numbers: std::ops::Range<u64>) -> Vec<TimedFrame> {
    numbers.map(frame).map(labelled).collect()
}

fn labelled(timed: TimedFrame) -> TimedFrame {
    TimedFrame { time: Time::from_nanos(WALL_NS + timed.time.as_nanos()), ..timed }
}

fn read(mut recording: Recording) -> (Vec<TimedFrame>, LogReport) {
    let mut frames = Vec::new();
    while recording.next_batch(&mut frames, 70) {}
    assert_eq!(recording.take_lost(), recording.report().lost);
    (frames, recording.report().clone())
}

fn read_files(files: impl IntoIterator<Item = PathBuf>) -> (Vec<TimedFrame>, LogReport) {
    read(Recording::of_files(files, None))
}

/// The frames of all files of a folder.
fn read_folder(folder: &Path) -> (Vec<TimedFrame>, LogReport) {
    let files = Folder::list(folder).unwrap();
    read_files(files.iter().map(|(name, _)| folder.join(name.to_string())))
}

fn read_bytes(bytes: &[u8]) -> (Vec<TimedFrame>, LogReport) {
    read(Recording::of_reader("log".to_owned(), Cursor::new(bytes.to_vec()), None))
}

/// A file of three chunks of 100 frames and their places, and, if it is closed, its end.
fn three_chunks(closed: bool) -> (Vec<u8>, Vec<usize>) {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("three");
    let content = || fs::read(&path).unwrap();
    let mut file = McapFile::begin(open_file(&path).unwrap(), &topics(), BTreeMap::new()).unwrap();
    let mut ends = vec![content().len()];
    for chunk in 0..3 {
        file.write(0, 7, &message(chunk * 100..chunk * 100 + 100)).unwrap();
        file.flush().unwrap();
        ends.push(content().len());
    }
    if closed {
        file.finish().unwrap();
    } else {
        file.write(0, 7, &message(300..400)).unwrap(); // never flushed
        assert_eq!(content().len(), ends[3], "nothing of an open chunk is in the file");
        std::mem::forget(file); // as a killed process leaves it
    }
    (content(), ends)
}

#[test]
fn a_file_that_was_cut_anywhere_gives_its_whole_chunks_and_says_so() {
    let (bytes, ends) = three_chunks(false);
    for cut in 0..=bytes.len() {
        let (all, report) = read_bytes(&bytes[..cut]);
        // The index of its messages follows a chunk, so that the chunk is whole before `ends`.
        let most = 100 * ends.iter().skip(1).filter(|end| **end <= cut + 200).count() as u64;
        let least = 100 * ends.iter().skip(1).filter(|end| **end <= cut).count() as u64;
        assert!((least..=most).contains(&report.frames), "cut at {cut}: {report:?}");
        assert_eq!(all, frames(0..report.frames), "cut at {cut}");
        assert_eq!(report.faults.len(), 1, "cut at {cut}: {report:?}");
    }
    let (_, report) = read_bytes(&bytes);
    assert_eq!(report.frames, 300);
    assert!(report.words()[0].starts_with("log: the file was cut off"), "{report:?}");
}

#[test]
fn a_damaged_chunk_is_not_used() {
    let (bytes, ends) = three_chunks(true);
    for at in ends[1]..ends[2] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        let (all, report) = read_bytes(&damaged);
        assert!(frames(0..300).starts_with(&all) || report.faults.is_empty(), "byte {at}: {report:?}");
        assert!(report.faults.is_empty() || report.frames >= 100, "byte {at}: {report:?}");
    }
}

#[test]
fn only_the_bus_that_is_wanted_is_read_and_files_follow_each_other() {
    let scratch = tempfile::tempdir().unwrap();
    let path = |name: &str| scratch.path().join(name);
    for (name, numbers) in [("a", 0..10), ("b", 10..20)] {
        let mut file = McapFile::begin(open_file(&path(name)).unwrap(), &topics(), BTreeMap::new()).unwrap();
        file.write(0, 7, &message(numbers)).unwrap();
        file.finish().unwrap();
    }
    let of = |bus: &str| read(Recording::of_files(["a", "lacks", "b"].map(path), Some(bus.to_owned())));
    let (all, report) = of("can0");
    assert_eq!(all, frames(0..20));
    assert_eq!((report.frames, report.faults.len()), (20, 1));
    let (all, report) = of("can1");
    assert_eq!((all.len(), report.other_interface, report.interfaces), (0, 20, vec!["can0".to_owned()]));
}

fn limits() -> Limits {
    Limits {
        budget_bytes: (4 << 20) + 300_000,
        file_bytes: 50_000,
        file_age: Duration::from_secs(3600),
        keep_free_bytes: 0,
        flush_every: Duration::from_millis(1),
        retry_after: Duration::from_millis(1),
    }
}

/// Waits for what must come, on however slow a machine.
fn wait(what: &str, mut done: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !done() {
        assert!(begun.elapsed() < Duration::from_secs(120), "{what} did not come");
        std::thread::yield_now();
    }
}

fn start(folder: &Path, limits: Limits) -> (Recorder, Queue) {
    let folder = Folder::open(folder).unwrap();
    Recorder::start(folder, limits, topics(), BTreeMap::new(), Box::new(open_file)).unwrap()
}

#[test]
fn files_end_at_their_size_and_the_oldest_go_to_stay_within_the_budget() {
    let scratch = tempfile::tempdir().unwrap();
    let foreign = scratch.path().join("mine.mcap");
    fs::write(&foreign, [0; 1000]).unwrap();
    let (recorder, queue) = start(scratch.path(), limits());
    let status = recorder.status();
    let newest = || Folder::list(scratch.path()).unwrap().last().map_or(0, |(name, _)| name.number());
    let mut given = 0;
    wait("the twentieth file", || {
        // Incompressible enough, and more than one file takes.
        if queue.give(0, 7, message(given * 500..given * 500 + 500)) == Given::Taken {
            given += 1;
        }
        newest() >= 20
    });
    let done = recorder.finish();
    assert_eq!(done.problem, None);
    let files = Folder::list(scratch.path()).unwrap();
    let bytes: u64 = files.iter().map(|(_, bytes)| bytes).sum();
    assert_eq!(bytes, done.bytes);
    assert!(bytes <= limits().budget_bytes, "{bytes} bytes");
    assert!(files[0].0.number() > 1, "the oldest are gone");
    assert!(foreign.exists());
    assert_eq!(status().lost, done.lost);
    let (all, report) = read_folder(scratch.path());
    assert!(report.faults.is_empty(), "{report:?}");
    if done.lost == 0 {
        let offset = all[0].time.as_nanos() - frame(given * 500 - all.len() as u64).time.as_nanos();
        let newest = (given * 500 - all.len() as u64..given * 500).map(frame);
        let newest = newest.map(|timed| TimedFrame { time: Time::from_nanos(timed.time.as_nanos() + offset), ..timed });
        assert!(newest.eq(all), "the newest are there, in their order");
    }
}

/// `/dev/full` takes what is not flushed yet, and refuses all of it.
#[test]
fn a_disk_that_is_full_is_told_and_recorded_on_once_there_is_room() {
    let scratch = tempfile::tempdir().unwrap();
    let has_room = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&has_room);
    let opener = move |path: &Path| match seen.load(Ordering::Relaxed) {
        true => open_file(path),
        false => fs::File::options().write(true).open("/dev/full"),
    };
    let folder = Folder::open(scratch.path()).unwrap();
    let (recorder, queue) = Recorder::start(folder, limits(), topics(), BTreeMap::new(), Box::new(opener)).unwrap();
    let status = recorder.status();
    wait("a full disk", || status().problem.is_some());
    let why = status().problem.unwrap();
    assert!(why.contains("No space left"), "{why}");
    wait("the loss", || {
        queue.give(0, 7, message(0..100));
        status().lost > 0
    });
    has_room.store(true, Ordering::Relaxed);
    wait("a new file", || status().problem.is_none());
    assert_eq!(queue.give(0, 7, message(0..100)), Given::Taken);
    let done = recorder.finish();
    assert_eq!(done.problem, None);
    assert!(read_folder(scratch.path()).1.frames >= 100);
}

/// A cleaning script, or a disk that is mounted there after the daemon has started.
#[test]
fn a_folder_that_was_removed_is_told_and_recorded_into_again() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("recordings");
    let (recorder, queue) = start(&path, Limits { retry_after: Duration::from_secs(1), ..limits() });
    let status = recorder.status();
    wait("a file", || !status().file.is_empty());
    std::fs::remove_dir_all(&path).unwrap();
    wait("the word", || status().problem.is_some());
    let why = status().problem.unwrap();
    assert!(why.starts_with(&path.display().to_string()) && why.contains("No such file"), "{why}");
    wait("another file", || status().problem.is_none());
    queue.give(0, 7, message(0..100));
    recorder.finish();
    let files = Folder::list(&path).unwrap();
    assert_eq!(files.len(), 1);
}

#[test]
fn after_a_file_was_removed_or_moved_another_is_recorded_into() {
    let removed: fn(&Path) = |path| fs::remove_file(path).unwrap();
    let moved: fn(&Path) = |path| fs::rename(path, path.with_extension("moved")).unwrap();
    for meddle in [removed, moved] {
        let scratch = tempfile::tempdir().unwrap();
        let (recorder, queue) = start(scratch.path(), Limits { file_bytes: 1 << 30, ..limits() });
        let status = recorder.status();
        wait("a file", || !status().file.is_empty());
        let first = status().file;
        // Of another second, which is in the name.
        std::thread::sleep(Duration::from_millis(1_100));
        meddle(Path::new(&first));
        wait("another file", || status().file != first);
        let second = status().file;
        assert_eq!(queue.give(0, 7, message(0..100)), Given::Taken);
        let done = recorder.finish();
        assert_eq!((done.problem, done.file), (None, second.clone()));
        let (all, report) = read_files([second.into()]);
        assert_eq!((all, report.faults), (frames(0..100), Vec::new()));
    }
}

#[test]
fn what_did_not_reach_the_disk_before_its_file_was_removed_is_counted_at_the_end_too() {
    let scratch = tempfile::tempdir().unwrap();
    let (recorder, queue) = start(scratch.path(), Limits { flush_every: Duration::from_secs(3600), ..limits() });
    let status = recorder.status();
    wait("a file", || !status().file.is_empty());
    fs::remove_file(status().file).unwrap();
    let mut tap = FrameTap::new(queue, 0, "can0".to_owned(), String::new());
    tap.take(&(0..100).map(frame).collect::<Vec<_>>(), &[], WALL_NS);
    let done = recorder.finish();
    assert_eq!((done.lost, done.bytes), (100, 0));
    assert!(done.problem.unwrap().contains("No such file"));
}

#[test]
fn a_disk_with_too_little_space_is_left_alone() {
    let scratch = tempfile::tempdir().unwrap();
    let (recorder, _queue) = start(scratch.path(), Limits { keep_free_bytes: u64::MAX, ..limits() });
    let status = recorder.status();
    wait("the word", || status().problem.is_some());
    assert!(status().problem.unwrap().contains("are kept free"));
    drop(recorder);
    assert_eq!(Folder::list(scratch.path()).unwrap().len(), 0);
}

#[test]
fn a_queue_without_room_loses_and_the_recording_says_how_many() {
    let scratch = tempfile::tempdir().unwrap();
    let (recorder, queue) = start(scratch.path(), Limits { file_bytes: 1 << 30, budget_bytes: 1 << 32, ..limits() });
    let status = recorder.status();
    wait("the first file", || !status().file.is_empty());
    let mut tap = FrameTap::new(queue, 0, "can0".to_owned(), String::new());
    let frames: Vec<TimedFrame> = (0..2_000).map(frame).collect();
    tap.kernel_lost(3);
    // Each is weighed with 176 kB of the 8 MiB that may wait; the thread needs longer for it than this loop.
    wait("a loss", || {
        tap.take(&frames, &[], WALL_NS);
        status().lost > 0
    });
    let lost = status().lost;
    let mut after = 0;
    wait("room", || {
        after += 1;
        tap.take(&frames[..1], &[], WALL_NS);
        status().lost == lost + after - 1
    });
    let lost = recorder.finish().lost;
    let (_, report) = read_folder(scratch.path());
    assert_eq!(report.lost, lost + 3, "as many as were counted, and those of the kernel");
}
