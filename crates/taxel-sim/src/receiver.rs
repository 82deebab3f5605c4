//! The host's adapter: what it makes of the frames on the wire before anybody sees them.

use crate::rng::{Rng, Stream};
use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::Time;
use taxel_wire::{Frame, TimedFrame};

/// Frames that the adapter can give again: four seconds of a full forearm and its gauge.
const REMEMBERED_FRAMES: usize = 4096;

/// Frames on their way to the host at times of their own.
#[derive(Clone, Debug, Default)]
struct Burst {
    frames: VecDeque<Frame>,
    next: Time,
    gap: Duration,
}

impl Burst {
    fn begin(&mut self, now: Time, within: Duration) {
        let frames = u32::try_from(self.frames.len().max(1)).unwrap_or(u32::MAX);
        (self.next, self.gap) = (now, within / frames);
    }

    fn due(&self) -> Option<Time> {
        (!self.frames.is_empty()).then_some(self.next)
    }

    fn step(&mut self) -> Option<Frame> {
        self.next = self.next + self.gap;
        self.frames.pop_front()
    }
}

/// The receiving end of the bus.
#[derive(Clone, Debug)]
pub(crate) struct Receiver {
    /// Chance that a frame is lost.
    pub(crate) loss_probability: f64,
    /// Chance that a frame comes twice.
    pub(crate) duplicate_probability: f64,
    /// Chance that a frame comes after its successor.
    pub(crate) swap_probability: f64,
    /// Frames that were lost.
    pub(crate) frames_lost: u64,
    loss: Rng,
    duplicates: Rng,
    swaps: Rng,
    /// A frame that lets its successor pass.
    passed: Option<Frame>,
    /// What was received, oldest first.
    remembered: VecDeque<TimedFrame>,
    /// While set, frames wait until then, and then come within so long.
    holding: Option<(Time, Duration)>,
    held: Burst,
    replayed: Burst,
}

impl Receiver {
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            loss_probability: 0.0,
            duplicate_probability: 0.0,
            swap_probability: 0.0,
            frames_lost: 0,
            loss: Rng::new(seed, Stream::Loss),
            duplicates: Rng::new(seed, Stream::Duplicates),
            swaps: Rng::new(seed, Stream::Swaps),
            passed: None,
            remembered: VecDeque::new(),
            holding: None,
            held: Burst::default(),
            replayed: Burst::default(),
        }
    }

    pub(crate) fn reseed(&mut self, seed: u64) {
        self.loss = Rng::new(seed, Stream::Loss);
        self.duplicates = Rng::new(seed, Stream::Duplicates);
        self.swaps = Rng::new(seed, Stream::Swaps);
    }

    /// A frame has come over the wire; what the host gets now is appended.
    pub(crate) fn take(&mut self, frame: TimedFrame, out: &mut Vec<TimedFrame>) {
        if self.loss_probability > 0.0 && self.loss.chance(self.loss_probability) {
            self.frames_lost += 1;
        } else if self.holding.is_some() || self.held.due().is_some() {
            self.held.frames.push_back(frame.frame);
        } else {
            self.give(frame, out);
        }
    }

    /// From now on frames wait for `span`, then come within `within`.
    pub(crate) fn hold(&mut self, now: Time, span: Duration, within: Duration) {
        self.holding = Some((now + span, within));
    }

    /// The frames of the last `span` come again, evenly spread over `within`.
    pub(crate) fn replay(&mut self, now: Time, span: Duration, within: Duration) {
        let first = self.remembered.partition_point(|frame| frame.time < now - span);
        self.replayed.frames = self.remembered.range(first..).map(|frame| frame.frame).collect();
        self.replayed.begin(now, within);
    }

    /// When a frame that waits comes next.
    pub(crate) fn next(&self) -> Option<Time> {
        let held = match self.holding {
            Some((until, _)) => Some(until),
            None => self.held.due(),
        };
        [held, self.replayed.due()].into_iter().flatten().min()
    }

    /// What waits until `now`, which must be [`Self::next`].
    pub(crate) fn step(&mut self, now: Time, out: &mut Vec<TimedFrame>) {
        if self.replayed.due() == Some(now) {
            out.extend(self.replayed.step().map(|frame| TimedFrame { time: now, frame }));
            return;
        }
        if let Some((_, within)) = self.holding.take() {
            self.held.begin(now, within);
        } else if let Some(frame) = self.held.step() {
            self.give(TimedFrame { time: now, frame }, out);
        }
    }

    fn give(&mut self, frame: TimedFrame, out: &mut Vec<TimedFrame>) {
        if self.remembered.len() == REMEMBERED_FRAMES {
            self.remembered.pop_front();
        }
        self.remembered.push_back(frame);
        if self.swap_probability > 0.0 && self.swaps.chance(self.swap_probability) && self.passed.is_none() {
            self.passed = Some(frame.frame);
            return;
        }
        out.push(frame);
        if self.duplicate_probability > 0.0 && self.duplicates.chance(self.duplicate_probability) {
            out.push(frame);
        }
        out.extend(self.passed.take().map(|late| TimedFrame { time: frame.time, frame: late }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_wire::CanId;

    fn at(ms: i64) -> TimedFrame {
        let frame = Frame::of(CanId::Standard(ms as u16), []);
        TimedFrame { time: Time::from_nanos(ms * 1_000_000), frame }
    }

    fn ids(frames: &[TimedFrame]) -> Vec<CanId> {
        frames.iter().map(|frame| frame.frame.id).collect()
    }

    fn drain(receiver: &mut Receiver, out: &mut Vec<TimedFrame>) {
        while let Some(next) = receiver.next() {
            receiver.step(next, out);
        }
    }

    #[test]
    fn held_frames_come_all_in_order_with_fresh_times() {
        let (mut receiver, mut out) = (Receiver::new(1), Vec::new());
        receiver.hold(at(0).time, Duration::from_millis(100), Duration::from_millis(10));
        (0..10).for_each(|n| receiver.take(at(10 * n), &mut out));
        assert!(out.is_empty());
        drain(&mut receiver, &mut out);
        assert_eq!(ids(&out), (0..10).map(|n| at(10 * n).frame.id).collect::<Vec<_>>());
        let times: Vec<_> = out.iter().map(|frame| frame.time.as_nanos() / 1_000_000).collect();
        assert_eq!(times, (100..110).collect::<Vec<_>>());
        receiver.take(at(200), &mut out);
        assert_eq!(out[10], at(200), "the queue is empty");
    }

    #[test]
    fn replayed_frames_are_the_newest_and_are_not_remembered_twice() {
        let (mut receiver, mut out) = (Receiver::new(1), Vec::new());
        (1..=10).for_each(|n| receiver.take(at(10 * n), &mut out));
        out.clear();
        receiver.replay(at(101).time, Duration::from_millis(31), Duration::from_millis(4));
        drain(&mut receiver, &mut out);
        assert_eq!(ids(&out), [70, 80, 90, 100].map(|ms| at(ms).frame.id));
        assert_eq!(out[3].time, at(104).time);
        assert_eq!(receiver.remembered.len(), 10);
    }

    #[test]
    fn a_swapped_frame_follows_its_successor_and_a_duplicate_follows_itself() {
        let (mut receiver, mut out) = (Receiver::new(1), Vec::new());
        receiver.swap_probability = 1.0;
        receiver.take(at(1), &mut out);
        receiver.take(at(2), &mut out);
        assert_eq!(ids(&out), [2, 1].map(|ms| at(ms).frame.id));
        assert!(out.iter().all(|frame| frame.time == at(2).time), "time never goes back");
        (receiver.swap_probability, receiver.duplicate_probability) = (0.0, 1.0);
        receiver.take(at(3), &mut out);
        assert_eq!(out[2..], [at(3), at(3)]);
    }
}
