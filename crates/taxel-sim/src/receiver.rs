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
