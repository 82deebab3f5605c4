//! A log as a bus.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use taxel_skin::Time;
use taxel_wire::{Frame, FrameKind, TimedFrame};
use tokio::time::{Instant, sleep_until};

use crate::can_error;
use crate::log_report::LogReport;
use crate::recorded::RecordedFrames;
use crate::source::{Batch, BusEvent, FrameSource, SendError, SourceError};

/// Frames read of the log at once, and the most that one batch has.
const BATCH_FRAMES: usize = 1024;
/// Slowest and fastest pace; beyond, a wait could not be told from an end or from none.
const SPEED_MIN: f64 = 1e-3;
const SPEED_MAX: f64 = 1e6;

/// How fast a log is played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// By its own clock, `speed` times as fast; held within 0.001 to 1,000,000, and 1 if it is not finite.
    Realtime {
        /// Log seconds per second.
        speed: f64,
    },
    /// Without waiting.
    AsFastAsPossible,
}

/// Recorded frames behind the interface of a bus. Each keeps the time that its log gives it.
///
/// A frame whose time is before that of an earlier one is handed out at once, with its time and in its place; the
/// report counts it. Error frames of the log become events, as on a real bus, and so do frames that the recorder lost.
pub struct Replay {
    log: Box<dyn RecordedFrames>,
    pace: Pace,
    /// Read and not yet handed out: `frames[at..]`.
    frames: Vec<TimedFrame>,
    at: usize,
    /// Frames that the recorder lost behind all of `frames`.
    lost: u64,
    over: bool,
    /// What the reader said after the frames that it read before.
    fault: Option<SourceError>,
    told_up: bool,
    told_end: bool,
    /// Where the log's clock begins: at its first frame, or at that of another bus ([`Replay::together`]).
    begin: Option<Time>,
    /// When that was by the runtime's clock; all buses that are played together have it from the first one.
    here: Arc<OnceLock<Instant>>,
    newest: Time,
    /// Where the report goes in the end.
    told: Option<Arc<OnceLock<LogReport>>>,
}

impl Replay {
    /// Plays `log` from where it is.
    #[must_use]
    pub fn new(log: impl RecordedFrames + 'static, pace: Pace) -> Self {
        let pace = match pace {
            Pace::Realtime { speed } if !speed.is_finite() => Pace::Realtime { speed: 1.0 },
            Pace::Realtime { speed } => Pace::Realtime { speed: speed.clamp(SPEED_MIN, SPEED_MAX) },
            Pace::AsFastAsPossible => pace,
        };
        Self {
            log: Box::new(log),
            pace,
            frames: Vec::with_capacity(BATCH_FRAMES),
            at: 0,
            lost: 0,
            over: false,
            fault: None,
            told_up: false,
            told_end: false,
            begin: None,
            here: Arc::default(),
            newest: Time::default(),
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
            begin = begin.into_iter().chain(replay.first_time()?).min();
        }
        let here = Arc::default();
        for replay in replays {
            (replay.begin, replay.here) = (begin, Arc::clone(&here));
        }
        Ok(begin)
    }

    /// When the first frame was received that is not handed out yet.
    fn first_time(&mut self) -> Result<Option<Time>, SourceError> {
        while self.at == self.frames.len() && !self.over && self.fault.is_none() {
            self.refill();
        }
        let first = self.frames.get(self.at).map(|timed| timed.time);
        match self.fault.take_if(|_| first.is_none()) {
            Some(fault) => Err(fault),
            None => Ok(first),
        }
    }

    /// What became of the log's lines so far.
    #[must_use]
    pub fn report(&self) -> &LogReport {
        self.log.report()
    }

    /// The present by the log's clock: of the play while it is paced, otherwise the newest time handed out.
    /// `None` before the first frame.
    #[must_use]
    pub fn log_time(&self) -> Option<Time> {
        let (begin, here) = (self.begin?, self.here.get()?);
        Some(match self.pace {
            Pace::Realtime { speed } => self.newest.max(begin + here.elapsed().mul_f64(speed)),
            Pace::AsFastAsPossible => self.newest,
        })
    }

    /// When the frame is to be handed out; `None`: at once.
    fn due(&mut self, time: Time) -> Option<Instant> {
        let (begin, here) = (*self.begin.get_or_insert(time), *self.here.get_or_init(Instant::now));
        let Pace::Realtime { speed } = self.pace else { return None };
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
            self.newest = self.newest.max(timed.time);
            match timed.frame.kind {
                FrameKind::Error => can_error::decode(&timed.frame, |error| {
                    batch.events.push(BusEvent::Error { error, local: false });
                }),
                _ => batch.frames.push(timed),
            }
        }
    }

    /// Reads on when all is handed out. Files are read here and now: a block takes well under a millisecond.
    fn refill(&mut self) {
        self.frames.clear();
        self.at = 0;
        match self.log.next_batch(&mut self.frames, BATCH_FRAMES) {
            Ok(more) => self.over = !more,
            Err(fault) => self.fault = Some(fault.into()),
        }
        self.lost += self.log.take_lost();
    }
}

impl FrameSource for Replay {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        if !self.told_up {
            self.told_up = true;
            batch.events.push(BusEvent::Up);
        }
        loop {
            if self.at == self.frames.len() {
                if self.lost > 0 {
                    let frames = std::mem::take(&mut self.lost);
                    batch.events.push(BusEvent::Dropped { frames });
                    return Ok(());
                }
                if let Some(fault) = self.fault.take() {
                    self.over = true;
                    return Err(fault);
                }
                if self.over {
                    if !batch.is_empty() {
                        return Ok(());
                    }
                    if self.told_end {
                        // A bus that is over is silent, like any other.
                        return std::future::pending().await;
                    }
                    self.told_end = true;
                    batch.end = true;
                    return Ok(());
                }
                self.refill();
                continue;
            }
            self.take_due(Instant::now(), batch);
            if !batch.is_empty() {
                return Ok(());
            }
            if let Some(due) = self.frames.get(self.at).map(|timed| timed.time).and_then(|time| self.due(time)) {
                sleep_until(due).await;
            }
        }
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError::Log { id: frame.id })
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
    use std::fmt::Write;
    use std::io::Cursor;
    use taxel_wire::CanId;

    fn replay(text: &str, pace: Pace) -> Replay {
        let bytes = Cursor::new(text.as_bytes().to_vec());
        Replay::new(LogReader::from_reader("log".to_owned(), bytes, None).unwrap(), pace)
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
        let log =
            "(100.000000) can0 301#01\n(100.500000) can0 301#02\n(100.400000) can0 301#03\n(102.000000) can0 301#04\n";
        let mut played = replay(log, Pace::Realtime { speed: 2.0 });
        assert_eq!(played.log_time(), None);
        let (frames, events) = play(&mut played).await;
        assert_eq!(events, [BusEvent::Up]);
        let times: Vec<f64> = frames.iter().map(|(_, frame)| frame.time.as_seconds()).collect();
        assert_eq!(times, [100.0, 100.5, 100.4, 102.0]);
        let waited: Vec<u128> = frames.iter().map(|(waited, _)| waited.as_millis()).collect();
        for (waited, due) in waited.iter().zip([0, 250, 250, 1000]) {
            assert!((due..=due + 2).contains(waited), "{waited} ms, due at {due} ms");
        }
        assert_eq!(played.report().backwards, 1);
        assert!(played.log_time() >= Some(Time::from_seconds(102.0)));
    }

    #[tokio::test]
    async fn an_error_is_told_between_the_frames_before_and_after_it() {
        let log = ["301#", "302#", "20000040#", "303#", "30000000#0000000000000000"]
            .map(|frame| format!("(1.0) can0 {frame}\n"));
        let (mut played, mut batch) = (replay(&log.concat(), Pace::AsFastAsPossible), Batch::default());
        let mut told = Vec::new();
        while !batch.end {
            played.next(&mut batch).await.unwrap();
            let errors = batch.events.iter().filter(|event| matches!(event, BusEvent::Error { .. }));
            told.push((errors.count(), batch.frames.len()));
        }
        assert_eq!(told, [(0, 2), (1, 1), (1, 0), (0, 0)]);
        assert_eq!((played.report().frames, played.report().errors), (5, 2));
    }

    #[tokio::test(start_paused = true)]
    async fn buses_that_are_played_together_stay_as_far_apart_as_they_were() {
        let pace = Pace::Realtime { speed: 2.0 };
        let mut buses = ["(103.0) can1 301#\n", "(101.0) can0 301#\n(102.0) can0 301#\n", "# nothing\n"]
            .map(|log| replay(log, pace));
        assert_eq!(Replay::together(&mut buses).unwrap(), Some(Time::from_seconds(101.0)));
        let [late, early, _] = &mut buses;
        let ((late, _), (early, _)) = tokio::join!(play(late), play(early));
        for ((waited, _), due) in early.iter().chain(&late).zip([0, 500, 1000]) {
            assert!((due..=due + 2).contains(&waited.as_millis()), "{waited:?}, due at {due} ms");
        }
        let mut nothing = [replay("nonsense\n", pace)];
        assert_eq!(Replay::together(&mut nothing).unwrap(), None);
        assert_eq!(nothing[0].report().bad, 1);
    }

    #[tokio::test]
    async fn the_report_is_left_when_nobody_plays_any_more() {
        let told = Arc::default();
        let log = "(1.000000) can0 301#01\nnonsense\n";
        let mut played = replay(log, Pace::AsFastAsPossible).telling(Arc::clone(&told));
        play(&mut played).await;
        assert!(told.get().is_none());
        drop(played);
        assert_eq!(told.get().unwrap().bad, 1);
    }

    #[tokio::test(start_paused = true)]
    async fn a_cancelled_wait_loses_no_frame() {
        let log = "(1.000000) can0 301#01\n(2.000000) can0 301#02\n(3.000000) can0 301#03\n";
        let mut played = replay(log, Pace::Realtime { speed: 1.0 });
        let mut batch = Batch::default();
        let mut seen = Vec::new();
        while !batch.end {
            match tokio::time::timeout(Duration::from_millis(70), played.next(&mut batch)).await {
                Ok(result) => {
                    result.unwrap();
                    seen.extend(batch.frames.iter().map(|timed| timed.frame.bytes()[0]));
                }
                Err(_cancelled) => {}
            }
        }
        assert_eq!(seen, [1, 2, 3]);
    }

    #[tokio::test(start_paused = true)]
    async fn as_fast_as_possible_waits_for_nothing_and_loses_nothing() {
        let mut log = String::new();
        for i in 0..5_000 {
            writeln!(log, "({i}.000000) can0 {:03X}#", i % 0x800).unwrap();
        }
        let start = Instant::now();
        let mut played = replay(&log, Pace::AsFastAsPossible);
        let (frames, _) = play(&mut played).await;
        assert_eq!(frames.len(), 5_000);
        assert!(frames.iter().enumerate().all(|(i, (_, timed))| timed.frame.id == CanId::Standard(i as u16 % 0x800)));
        assert_eq!(start.elapsed(), Duration::ZERO, "the paused clock moves only for a wait");
        assert_eq!(played.log_time(), Some(Time::from_seconds(4_999.0)));
    }

    #[tokio::test]
    async fn frames_that_candump_lost_are_told_between_those_before_and_after() {
        let lost =
            |frames, of| format!("DROPCOUNT: dropped {frames} CAN frame(s) on '{of}' socket (total drops 400)\n");
        let frame = |at| format!("({at}.5) can0 301#\n");
        let log = [lost(300, "can0"), frame(1), frame(2), lost(1, "can0"), lost(7, "any"), frame(3)].concat();
        let mut played = replay(&log, Pace::AsFastAsPossible);
        let mut told = Vec::new();
        let mut batch = Batch::default();
        while !batch.end {
            played.next(&mut batch).await.unwrap();
            told.extend(batch.events.iter().filter_map(|event| match event {
                BusEvent::Dropped { frames } => Some(*frames),
                _ => None,
            }));
            told.extend(batch.frames.iter().map(|_| 0));
        }
        assert_eq!(told, [300, 0, 0, 1, 7, 0]);
        let report = played.report();
        assert_eq!((report.frames, report.blank, report.bad, report.lost), (3, 3, 0, 308));
        assert_eq!(report.words(), ["the recorder lost 308 frames, before line 1 and at 2 more places"]);
    }

    #[tokio::test]
    async fn error_frames_of_a_log_are_events_and_a_log_takes_no_frames() {
        let mut played = replay("(1.000000) can0 20000040#0000000000000000\n", Pace::AsFastAsPossible);
        let (frames, events) = play(&mut played).await;
        assert!(frames.is_empty());
        assert_eq!(events, [BusEvent::Up, BusEvent::Error { error: crate::BusError::BusOff, local: false }]);
        let frame = Frame::of(CanId::Standard(0x301), [1]);
        assert!(matches!(played.send(&frame).await, Err(SendError::Log { .. })));
    }
}
