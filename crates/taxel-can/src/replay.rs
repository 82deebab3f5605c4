//! A log as a bus.

use std::mem;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use taxel_skin::Time;
use taxel_wire::{Frame, FrameKind, TimedFrame};
use tokio::time::{Instant, sleep_until};

use crate::can_error;
use crate::log_report::LogReport;
use crate::recorded::{LogFault, RecordedFrames};
use crate::source::{Batch, BusEvent, FrameSource, NotSent, SendError, SourceError};

/// Frames read of the log at once, and the most that one batch has.
const BATCH_FRAMES: usize = 1024;

/// Recorded frames behind the interface of a bus. Each keeps the time that its log gives it.
///
/// A frame whose time is before that of an earlier one is handed out at once, with its time and in its place; the
/// report counts it. Error frames of the log become events, as on a real bus, and so do frames that the recorder lost.
pub struct Replay {
    log: Box<dyn RecordedFrames>,
    /// Log seconds per second; `None`: without waiting.
    speed: Option<f64>,
    /// Read and not yet handed out: `frames[at..]`.
    frames: Vec<TimedFrame>,
    at: usize,
    /// Frames that the recorder lost behind all of `frames`.
    lost: u64,
    /// Whether there are more behind `frames`, or what the reader said there.
    more: Result<bool, LogFault>,
    told_up: bool,
    /// Where the log's clock begins: at its first frame, or at that of another bus ([`Replay::together`]).
    begin: Option<Time>,
    /// When that was by the runtime's clock; all buses that are played together have it from the first one.
    here: Arc<OnceLock<Instant>>,
    /// Where the report goes in the end.
    told: Option<Arc<OnceLock<LogReport>>>,
}

impl Replay {
    /// Plays `log` from where it is, `speed` times as fast as its own clock, or without waiting.
    #[must_use]
    pub fn new(log: Box<dyn RecordedFrames>, speed: Option<f64>) -> Self {
        Self {
            log,
            speed,
            frames: Vec::with_capacity(BATCH_FRAMES),
            at: 0,
            lost: 0,
            more: Ok(true),
            told_up: false,
            begin: None,
            here: Arc::default(),
            told: None,
        }
    }

    /// Leaves the report in `told` when nobody plays this log any more.
    #[must_use]
    pub fn telling(mut self, told: Arc<OnceLock<LogReport>>) -> Self {
        self.told = Some(told);
        self
    }

    /// Plays buses of one recording by one clock, so that they are as far apart as they were: it begins with the earliest
    /// first frame, whose time is the answer. `None`: no log has a frame. To be called before the first of them plays.
    ///
    /// # Errors
    /// A log that cannot be read up to its first frame.
    pub fn together(replays: &mut [Self]) -> Result<Option<Time>, SourceError> {
        let mut begin = None;
        for replay in &mut *replays {
            while replay.at == replay.frames.len() && replay.read_on()? {}
            let first = replay.frames.get(replay.at).map(|timed| timed.time);
            begin = begin.into_iter().chain(first).min();
        }
        let here = Arc::default();
        for replay in replays {
            (replay.begin, replay.here) = (begin, Arc::clone(&here));
        }
        Ok(begin)
    }

    /// What became of the log's lines so far.
    #[must_use]
    pub fn report(&self) -> &LogReport {
        self.log.report()
    }

    /// When the frame is to be handed out; `None`: at once.
    fn due(&mut self, time: Time) -> Option<Instant> {
        let speed = self.speed?;
        let (begin, here) = (*self.begin.get_or_insert(time), *self.here.get_or_init(Instant::now));
        let wait = time.since(begin).as_secs_f64() / speed;
        // A wait beyond the runtime's clock: nobody lives to see it.
        here.checked_add(Duration::try_from_secs_f64(wait).ok()?)
    }

    /// Puts every frame that is due into the batch.
    fn take_due(&mut self, now: Instant, batch: &mut Batch) {
        while let Some(&timed) = self.frames.get(self.at) {
            if self.due(timed.time).is_some_and(|due| due > now) {
                return;
            }
            if timed.frame.kind == FrameKind::Error && !batch.frames.is_empty() {
                return; // what came before it is taken before it is told
            }
            self.at += 1;
            match timed.frame.kind {
                FrameKind::Error => can_error::decode(&timed.frame, |error| {
                    batch.events.push(BusEvent::Error { error, local: false });
                }),
                _ => batch.frames.push(timed),
            }
        }
    }

    /// Reads on when all is handed out; `false` at the log's end. Files are read here and now: a block takes well under a
    /// millisecond.
    fn read_on(&mut self) -> Result<bool, LogFault> {
        let more = mem::replace(&mut self.more, Ok(false))?;
        if more {
            self.frames.clear();
            self.at = 0;
            self.more = self.log.next_batch(&mut self.frames, BATCH_FRAMES);
            self.lost += self.log.take_lost();
        }
        Ok(more)
    }
}

impl FrameSource for Replay {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        if !mem::replace(&mut self.told_up, true) {
            batch.events.push(BusEvent::Up);
        }
        loop {
            self.take_due(Instant::now(), batch);
            if !batch.frames.is_empty() || !batch.events.is_empty() {
                return Ok(());
            }
            if let Some(next) = self.frames.get(self.at).map(|timed| timed.time) {
                if let Some(due) = self.due(next) {
                    sleep_until(due).await;
                }
            } else if self.lost > 0 {
                let frames = mem::take(&mut self.lost);
                batch.events.push(BusEvent::Dropped { frames });
            } else if !self.read_on()? {
                batch.end = true;
                return Ok(());
            }
        }
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError { id: frame.id, why: NotSent::Log })
    }
}

impl Drop for Replay {
    fn drop(&mut self) {
        if let Some(told) = &self.told {
            let _ = told.set(self.log.report().clone()); // it is nobody else's to set
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log_reader::LogReader;
    use std::io::Cursor;
    use taxel_wire::CanId;

    fn replay(text: &str, speed: Option<f64>) -> Replay {
        let bytes = Cursor::new(text.as_bytes().to_vec());
        Replay::new(Box::new(LogReader::new("log".to_owned(), bytes, None).unwrap()), speed)
    }

    async fn play(replay: &mut Replay) -> (Vec<(Duration, TimedFrame)>, Vec<BusEvent>) {
        let (mut frames, mut events, mut batch) = (Vec::new(), Vec::new(), Batch::default());
        let start = Instant::now();
        while !batch.end {
            replay.next(&mut batch).await.unwrap();
            assert!(!batch.is_empty());
            frames.extend(batch.frames.iter().map(|frame| (start.elapsed(), *frame)));
            events.append(&mut batch.events);
        }
        (frames, events)
    }

    #[tokio::test(start_paused = true)]
    async fn frames_come_at_the_log_s_pace_and_keep_its_time() {
        let log = "(100.0) can0 301#01\n(100.5) can0 301#02\n(100.4) can0 301#03\n(102.0) can0 301#04\n";
        let (frames, events) = play(&mut replay(log, Some(2.0))).await;
        assert_eq!(events, [BusEvent::Up]);
        let times: Vec<f64> = frames.iter().map(|(_, frame)| frame.time.as_seconds()).collect();
        assert_eq!(times, [100.0, 100.5, 100.4, 102.0]);
        let waited: Vec<u128> = frames.iter().map(|(waited, _)| waited.as_millis()).collect();
        for (waited, due) in waited.iter().zip([0, 250, 250, 1000]) {
            assert!((due..=due + 2).contains(waited), "{waited} ms, due at {due} ms");
        }
    }

    #[tokio::test]
    async fn an_error_is_told_between_the_frames_before_and_after_it() {
        let log = ["301#", "302#", "20000040#", "303#", "30000000#0000000000000000"]
            .map(|frame| format!("(1.0) can0 {frame}\n"));
        let (mut played, mut batch) = (replay(&log.concat(), None), Batch::default());
        let mut told = Vec::new();
        while !batch.end {
            played.next(&mut batch).await.unwrap();
            let errors = batch.events.iter().filter(|event| matches!(event, BusEvent::Error { .. }));
            told.push((errors.count(), batch.frames.len()));
        }
        assert_eq!(told, [(0, 0), (0, 2), (1, 1), (1, 0), (0, 0)]);
        assert_eq!((played.report().frames, played.report().errors), (5, 2));
    }

    #[tokio::test(start_paused = true)]
    async fn buses_that_are_played_together_stay_as_far_apart_as_they_were() {
        let mut buses = ["(103.0) can1 301#\n", "(101.0) can0 301#\n(102.0) can0 301#\n", "# nothing\n"]
            .map(|log| replay(log, Some(2.0)));
        assert_eq!(Replay::together(&mut buses).unwrap(), Some(Time::from_seconds(101.0)));
        let [late, early, _] = &mut buses;
        let ((late, _), (early, _)) = tokio::join!(play(late), play(early));
        for ((waited, _), due) in early.iter().chain(&late).zip([0, 500, 1000]) {
            assert!((due..=due + 2).contains(&waited.as_millis()), "{waited:?}, due at {due} ms");
        }
        let mut nothing = [replay("nonsense\n", Some(2.0))];
        assert_eq!(Replay::together(&mut nothing).unwrap(), None);
        assert_eq!(nothing[0].report().bad, 1);
    }

    #[tokio::test]
    async fn the_report_is_left_when_nobody_plays_any_more() {
        let told = Arc::default();
        let mut played = replay("(1.000000) can0 301#01\nnonsense\n", None).telling(Arc::clone(&told));
        play(&mut played).await;
        assert!(told.get().is_none());
        drop(played);
        assert_eq!(told.get().unwrap().bad, 1);
    }

    #[tokio::test(start_paused = true)]
    async fn a_cancelled_wait_loses_no_frame() {
        let log = "(1.000000) can0 301#01\n(2.000000) can0 301#02\n(3.000000) can0 301#03\n";
        let (mut played, mut batch, mut seen) = (replay(log, Some(1.0)), Batch::default(), Vec::new());
        while !batch.end {
            if let Ok(result) = tokio::time::timeout(Duration::from_millis(70), played.next(&mut batch)).await {
                result.unwrap();
                seen.extend(batch.frames.iter().map(|timed| timed.frame.bytes()[0]));
            }
        }
        assert_eq!(seen, [1, 2, 3]);
    }

    #[tokio::test(start_paused = true)]
    async fn without_a_speed_nothing_is_waited_for_and_nothing_lost() {
        let log: String = (0..5_000).map(|i| format!("({i}.0) can0 {:03X}#\n", i % 0x800)).collect();
        let start = Instant::now();
        let (frames, _) = play(&mut replay(&log, None)).await;
        assert_eq!(frames.len(), 5_000);
        assert!(frames.iter().enumerate().all(|(i, (_, timed))| timed.frame.id == CanId::Standard(i as u16 % 0x800)));
        assert_eq!(start.elapsed(), Duration::ZERO, "the paused clock moves only for a wait");
    }

    /// Frame 1, a loss of seven frames, frame 2.
    struct Lossy(LogReport, u8);

    impl RecordedFrames for Lossy {
        fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, _: usize) -> Result<bool, LogFault> {
            self.1 += 1;
            let frame = Frame::of(CanId::Standard(0x301), [self.1]);
            frames.extend((self.1 < 3).then_some(TimedFrame { time: Time::default(), frame }));
            Ok(self.1 < 3)
        }

        fn take_lost(&mut self) -> u64 {
            if self.1 == 1 { 7 } else { 0 }
        }

        fn report(&self) -> &LogReport {
            &self.0
        }
    }

    #[tokio::test]
    async fn frames_that_the_recorder_lost_are_told_between_those_before_and_after() {
        let mut played = Replay::new(Box::new(Lossy(LogReport::default(), 0)), None);
        let (mut told, mut batch) = (Vec::new(), Batch::default());
        while !batch.end {
            played.next(&mut batch).await.unwrap();
            told.extend(batch.events.contains(&BusEvent::Dropped { frames: 7 }).then_some(7));
            told.extend(batch.frames.iter().map(|_| 0));
        }
        assert_eq!(told, [0, 7, 0]);
    }

    #[tokio::test]
    async fn a_log_takes_no_frames() {
        let refused = replay("", None).send(&Frame::of(CanId::Standard(0x301), [1])).await.unwrap_err();
        assert_eq!(refused.to_string(), "frame 301 not sent: a log takes no frames");
    }
}
