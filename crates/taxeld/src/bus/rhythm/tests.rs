use super::*;
use proptest::prelude::*;
use taxel_wire::Frame;

const BOARD_A: u16 = 0x4D0;
const BOARD_B: u16 = 0x4C0;
const GAUGE: u16 = 0x3A1;

/// What the kernel takes to wake a process that sleeps.
const WAKE: Duration = Duration::from_micros(60);

fn at(ms: f64) -> Time {
    Time::from_nanos((ms * 1e6) as i64)
}

fn frame(ms: f64, id: u16) -> TimedFrame {
    TimedFrame { time: at(ms), frame: Frame::of(CanId::Standard(id), [0, 1]) }
}

/// Bursts of a board: so many frames, 0.13 ms apart, the burst with number `n` begins at `begin_ms(n)`.
fn bursts(id: u16, frames: u32, begin_ms: impl Fn(u32) -> f64, count: u32) -> Vec<TimedFrame> {
    let burst = |n: u32| {
        let begin = begin_ms(n);
        (0..frames).map(move |k| frame(begin + 0.13 * f64::from(k), id))
    };
    (0..count).flat_map(burst).collect()
}

fn ordered(mut frames: Vec<TimedFrame>) -> Vec<TimedFrame> {
    frames.sort_by_key(|frame| frame.time);
    frames
}

fn rhythm() -> Rhythm {
    Rhythm::of_senders(vec![(CanId::Standard(BOARD_B), 12), (CanId::Standard(BOARD_A), 13)])
}

/// What a bus task makes of these frames.
#[derive(Debug, Default)]
struct Course {
    wakes: usize,
    /// When each frame was read.
    read: Vec<Time>,
}

/// Plays the bus task: sleeps until the next frame or the end of a pause, reads everything that is there, and asks for
/// the next pause.
fn play(rhythm: &mut Rhythm, frames: &[TimedFrame]) -> Course {
    let (mut course, mut pause) = (Course::default(), None::<Pause>);
    while course.read.len() < frames.len() {
        let next = course.read.len();
        let from = pause.map_or(Time::default(), |pause| pause.until + WAKE);
        course.wakes += usize::from(pause.is_some()) + usize::from(frames[next].time > from);
        let now = frames[next].time.max(from);
        let there = frames[next..].iter().take_while(|frame| frame.time <= now).count();
        rhythm.hear(&frames[next..next + there], pause.take());
        course.read.extend(std::iter::repeat_n(now, there));
        pause = rhythm.pause(now).map(|until| Pause { begun: now, until });
    }
    course
}

/// A forearm's two boards and its gauge at 100 Hz, for so many scans.
fn forearm(scans: u32) -> Vec<TimedFrame> {
    let mut frames = bursts(BOARD_A, 32, |n| 7.0 + 50.0 * f64::from(n), scans);
    frames.extend(bursts(BOARD_B, 14, |n| 20.0 + 50.0 * f64::from(n), scans));
    frames.extend((0..scans * 5).map(|n| frame(3.3 + 10.0 * f64::from(n), GAUGE)));
    ordered(frames)
}

/// The longest that the last frame of a burst of this board waited, from this time on.
fn longest_wait(frames: &[TimedFrame], course: &Course, board: u16, from: Time) -> Duration {
    let of_board = frames.iter().zip(&course.read).filter(|(frame, _)| frame.frame.id == CanId::Standard(board));
    let of_board: Vec<_> = of_board.collect();
    let last = |pair: &&[(&TimedFrame, &Time)]| pair[1].0.time.since(pair[0].0.time) > GAP && pair[0].0.time > from;
    of_board.windows(2).filter(last).map(|pair| pair[0].1.since(pair[0].0.time)).max().unwrap()
}

#[test]
fn a_forearm_wakes_its_bus_six_times_a_scan_and_no_scan_waits() {
    let mut rhythm = rhythm();
    play(&mut rhythm, &forearm(12));
    let later: Vec<TimedFrame> = forearm(52).into_iter().filter(|frame| frame.time > at(600.0)).collect();
    let course = play(&mut rhythm, &later);
    // The end of a pause and two frames within the margin, for each of two bursts; the first begins without a pause.
    assert!(course.wakes <= 40 * 6 + 2, "{} wakes for 40 scans", course.wakes);
    for board in [BOARD_A, BOARD_B] {
        assert_eq!(longest_wait(&later, &course, board, at(0.0)), Duration::ZERO);
    }
}

#[test]
fn until_a_rhythm_is_learned_each_frame_wakes() {
    let frames = bursts(BOARD_A, 32, |n| 50.0 * f64::from(n), BURSTS as u32);
    assert_eq!(play(&mut rhythm(), &frames).wakes, frames.len() - 1, "the first one was there already");
    let mut learned = rhythm();
    play(&mut learned, &forearm(20));
    assert!(learned.pause(at(1_000.0)).is_some());
    learned.forget();
    assert_eq!(learned.pause(at(1_000.0)), None);
}

#[test]
fn a_sender_without_a_rhythm_is_watched_without_a_pause() {
    let mut frames = bursts(BOARD_A, 32, |n| 50.0 * f64::from(n), 40);
    frames.extend(bursts(BOARD_B, 1, |n| 30.0 * f64::from(n) + [0.0, 13.0, 8.0][n as usize % 3], 60));
    let course = play(&mut rhythm(), &ordered(frames.clone()));
    let frames = ordered(frames);
    assert!(frames.iter().zip(&course.read).all(|(frame, read)| frame.time == *read));
}

#[test]
fn who_is_silent_keeps_nobody_awake() {
    let mut frames = forearm(20);
    frames.retain(|frame| frame.frame.id != CanId::Standard(BOARD_B) || frame.time < at(650.0));
    let mut rhythm = rhythm();
    play(&mut rhythm, &frames);
    assert_eq!(rhythm.pause(at(1_000.0)), None, "it may still come");
    let later: Vec<TimedFrame> = bursts(BOARD_A, 32, |n| 1_007.0 + 50.0 * f64::from(n), 20);
    let course = play(&mut rhythm, &later);
    // For half a second, three bursts from here on, each frame wakes; then the end of a pause and two or three frames.
    assert!(course.wakes <= 3 * 32 + 17 * 4, "{} wakes", course.wakes);
}

#[test]
fn a_lost_frame_and_a_lost_burst_delay_nothing() {
    let (mut frames, mut n) = (forearm(60), 0);
    frames.retain(|frame| {
        n += usize::from(frame.frame.id == CanId::Standard(BOARD_A));
        let whole_burst = frame.time > at(1_500.0) && frame.time < at(1_550.0);
        !(n % 32 == 17 && n > 20 * 32 && n < 25 * 32 || whole_burst)
    });
    let course = play(&mut rhythm(), &frames);
    for board in [BOARD_A, BOARD_B] {
        assert_eq!(longest_wait(&frames, &course, board, at(0.0)), Duration::ZERO);
    }
}

#[test]
fn a_board_that_moves_its_rhythm_waits_for_one_period_at_most_and_is_learned_again() {
    let shifted = |n: u32| 50.0 * f64::from(n) + if n < 20 { 0.0 } else { 31.0 };
    let frames = bursts(BOARD_A, 32, shifted, 60);
    let course = play(&mut rhythm(), &frames);
    assert!(longest_wait(&frames, &course, BOARD_A, at(0.0)) <= Duration::from_millis(50));
    assert_eq!(longest_wait(&frames, &course, BOARD_A, at(1_040.0)), Duration::ZERO);
}

#[test]
fn ends_that_were_missed_make_looking_begin_earlier() {
    let uneven = |n: u32| 50.0 * f64::from(n) - if n % 12 == 11 { 1.0 } else { 0.0 };
    let frames = bursts(BOARD_A, 32, uneven, 200);
    let course = play(&mut rhythm(), &frames);
    let waits = frames.iter().zip(&course.read).skip(31).step_by(32).map(|(frame, read)| read.since(frame.time));
    let waits: Vec<Duration> = waits.filter(|wait| !wait.is_zero()).collect();
    assert!(waits[0] > Duration::from_micros(500), "{waits:?}");
    assert!(waits[1..].iter().all(|wait| *wait < Duration::from_micros(150)), "{waits:?}");
}

proptest! {
    /// Boards with a rhythm as real ones have it: whatever else is on the bus, no end of a burst waits for longer than
    /// it is irregular.
    #[test]
    fn no_end_of_a_burst_waits_longer_than_the_rhythm_is_uneven(
        (frames_a, frames_b) in (1_u32..32, 1_u32..32),
        (period_a, period_b) in (prop::sample::select(vec![10.0, 20.0, 50.0, 100.0]), 15.0_f64..60.0),
        phase in 0.0_f64..50.0,
        jitter in prop::collection::vec(-0.05_f64..0.05, 40),
    ) {
        let uneven = |n: u32, at: f64| at + jitter[n as usize % 40];
        let mut frames = bursts(BOARD_A, frames_a, |n| uneven(n, 1.0 + period_a * f64::from(n)), 120);
        frames.extend(bursts(BOARD_B, frames_b, |n| uneven(n + 7, 1.0 + phase + period_b * f64::from(n)), 120));
        let frames = ordered(frames);
        let course = play(&mut rhythm(), &frames);
        for board in [BOARD_A, BOARD_B] {
            let longest = longest_wait(&frames, &course, board, at(0.0));
            // Four draws of the jitter: of the end itself, of the one before, and of the two that made the shortest period.
            prop_assert!(longest <= Duration::from_micros(200) + WAKE, "{longest:?}");
        }
    }
}
