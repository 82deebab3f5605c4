//! When a bus has to be looked at.
//!
//! Boards send in bursts with a rhythm, and only the last frame of a burst makes a scan whole. To be woken for each frame
//! costs a sleep and a wake each, which is most of the daemon's processor time. So the rhythm of each sender is learned
//! from the kernel's stamps, and between two ends of bursts nobody looks: the frames wait in the kernel's buffer, which
//! holds half a second of a full bus, with the time of their reception. From shortly before the next end each frame
//! wakes again.
//!
//! A bus on which one sender has no rhythm (any more) is looked at without a pause.

use std::collections::VecDeque;
use std::time::Duration;

use taxel_engine::engine::routes::{Route, Routes};
use taxel_engine::plan::Plan;
use taxel_skin::{BusIndex, Time};
use taxel_wire::{CanId, TimedFrame};

/// Frames of one sender further apart than this are of two bursts. A frame takes 0.13 ms at 1 Mbit/s, and a board's burst
/// may be held up by that of another.
const GAP: Duration = Duration::from_millis(2);
/// So many bursts in a row show a rhythm.
const BURSTS: usize = 8;
/// The longest of their periods is at most so many times the shortest.
const SPREAD: f64 = 1.1;
/// Looking begins so long before the end of a burst: what a sleeping process takes to wake, and a frame or
/// two.
const MARGIN: Duration = Duration::from_micros(200);
/// Below this a pause is not worth a timer.
const WORTH: Duration = Duration::from_millis(2);
/// Who has sent nothing for so long is not waited for.
const SILENT_AFTER: Duration = Duration::from_millis(500);
/// However often ends were missed, looking does not begin earlier than this and [`MARGIN`] before one.
const MISSED_MAX: Duration = Duration::from_millis(10);
/// A missed end is forgotten to a third in so many pauses, some seconds.
const FORGETTING: u32 = 256;
/// Devices that are described by their signals are one sender together.
const DEVICES: u8 = 16;

/// The rhythm of one bus.
#[derive(Debug)]
pub struct Rhythm {
    /// The sender of each identifier that is waited for, ascending. Gauges, thermometers and replies are not in it.
    sender_of: Vec<(CanId, u8)>,
    senders: Vec<Sender>,
    /// By how much ends have come before somebody looked, on top of [`MARGIN`]; forgotten slowly.
    missed: Duration,
}

/// What is known of one sender.
#[derive(Clone, Debug, Default)]
struct Sender {
    newest: Option<Time>,
    /// Frames of the newest burst, which may go on.
    frames: u32,
    /// The bursts before it.
    bursts: VecDeque<Burst>,
}

#[derive(Clone, Copy, Debug)]
struct Burst {
    frames: u32,
    end: Time,
}

/// A time in which nobody looked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pause {
    /// Since when.
    pub begun: Time,
    /// Until when.
    pub until: Time,
}

impl Sender {
    fn hear(&mut self, time: Time) {
        if let Some(end) = self.newest
            && time.since(end) > GAP
        {
            if self.bursts.len() == BURSTS {
                self.bursts.pop_front();
            }
            self.bursts.push_back(Burst { frames: self.frames, end });
            self.frames = 0;
        }
        self.frames += 1;
        self.newest = Some(time);
    }

    /// When the last frame of the next burst, or of the one that goes on, can come at the earliest; `None` without a
    /// rhythm.
    fn next_end(&self) -> Option<Time> {
        let periods = || self.bursts.iter().zip(self.bursts.iter().skip(1)).map(|(a, b)| b.end.since(a.end));
        let (shortest, longest) = (periods().min()?, periods().max()?);
        if self.bursts.len() < BURSTS || longest > shortest.mul_f64(SPREAD) {
            return None;
        }
        let end = if self.is_over() { self.newest? } else { self.bursts.back()?.end };
        Some(end + shortest)
    }

    /// Whether the newest burst has as many frames as any of those before it.
    fn is_over(&self) -> bool {
        self.bursts.iter().all(|burst| self.frames >= burst.frames)
    }

    /// When the newest burst ended, if that was in the pause.
    fn ended_within(&self, pause: Pause) -> Option<Time> {
        self.newest.filter(|&newest| self.is_over() && pause.begun < newest && newest < pause.until)
    }
}

impl Rhythm {
    /// Nothing is learned yet.
    pub fn new(plan: &Plan, routes: &Routes, bus: BusIndex) -> Self {
        let sender = |id: CanId| match routes.of(bus, id) {
            Route::Module { patch, module } => {
                let patch = &plan.patches[usize::from(patch)].patch;
                let board = patch.modules()[usize::from(module)].board;
                Some((id, patch.boards()[usize::from(board)].address.get()))
            }
            Route::Device => Some((id, DEVICES)),
            Route::Foreign | Route::Board { .. } | Route::Gauge => None,
        };
        Self::of_senders(routes.wanted(bus).into_iter().filter_map(sender).collect())
    }

    fn of_senders(sender_of: Vec<(CanId, u8)>) -> Self {
        Self { sender_of, senders: vec![Sender::default(); usize::from(DEVICES) + 1], missed: Duration::ZERO }
    }

    /// Everything has to be learned anew: the boards were spoken to, or the bus had something to say.
    pub fn forget(&mut self) {
        self.senders.fill(Sender::default());
    }

    /// Takes frames in the order of reception, and the pause that they come after, if there was one.
    pub fn hear(&mut self, frames: &[TimedFrame], after: Option<Pause>) {
        for frame in frames {
            if let Ok(place) = self.sender_of.binary_search_by(|(id, _)| id.cmp(&frame.frame.id)) {
                self.senders[usize::from(self.sender_of[place].1)].hear(frame.time);
            }
        }
        if let Some(pause) = after {
            let ends = self.senders.iter().filter_map(|sender| sender.ended_within(pause));
            let missed = ends.min().map_or(Duration::ZERO, |end| pause.until.since(end));
            self.missed = (self.missed - self.missed / FORGETTING + missed).min(MISSED_MAX);
        }
    }

    /// Until when nobody needs to look, if that is worth it.
    pub fn pause(&self, now: Time) -> Option<Time> {
        let speaking = |sender: &&Sender| sender.newest.is_some_and(|newest| now.since(newest) < SILENT_AFTER);
        let next_ends: Option<Vec<Time>> = self.senders.iter().filter(speaking).map(Sender::next_end).collect();
        let until = next_ends?.into_iter().min()? - (MARGIN + self.missed);
        (until.since(now) >= WORTH).then_some(until)
    }
}

#[cfg(test)]
mod tests;
