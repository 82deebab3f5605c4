//! Frames that somebody recorded, wherever they come from, and those of several buses as one course in the order of their times.

use taxel_skin::{BusIndex, Time};
use taxel_wire::TimedFrame;

use crate::log_report::LogReport;

/// Frames per read.
const FRAMES: usize = 4096;

/// The frames of one bus as they were recorded, from first to last: of a candump log, or of a recording.
pub trait RecordedFrames: Send {
    /// Appends up to `max` frames (of every kind, error frames too) in their order; fewer where the recorder lost some behind
    /// them ([`RecordedFrames::take_lost`]). `false`: there are no more, or it cannot be read on, which the report tells.
    fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> bool;

    /// How many frames the recorder lost between what was handed out last and what comes, by its own words; told once.
    fn take_lost(&mut self) -> u64 {
        0
    }

    /// What became of everything so far.
    fn report(&self) -> &LogReport;
}

/// Frames of one bus, and how many were lost behind them.
pub struct Run<'a> {
    /// The position of the bus.
    pub bus: BusIndex,
    /// Its frames.
    pub frames: &'a [TimedFrame],
    /// Lost behind them.
    pub lost: u64,
}

/// A bus.
struct Lane {
    reader: Box<dyn RecordedFrames>,
    frames: Vec<TimedFrame>,
    /// Of `frames`, the first that was not handed out.
    next: usize,
    more: bool,
}

/// What was recorded of several buses.
pub struct Lanes(Vec<Lane>);

impl Lanes {
    /// Of these buses.
    #[must_use]
    pub fn new(buses: Vec<Box<dyn RecordedFrames>>) -> Self {
        Self(buses.into_iter().map(|reader| Lane { reader, frames: Vec::new(), next: 0, more: true }).collect())
    }

    /// The next frames, as many of one bus as come before those of another one.
    pub fn next_run(&mut self) -> Option<Run<'_>> {
        self.0.iter_mut().for_each(Lane::fill);
        let times = self.0.iter().enumerate().filter_map(|(bus, lane)| Some((lane.first()?, bus)));
        let (_, bus) = times.clone().min()?;
        let until = times.filter(|(_, other)| *other != bus).map(|(time, _)| time).min();
        let lane = &mut self.0[bus];
        let (begin, rest) = (lane.next, &lane.frames[lane.next..]);
        let earlier = rest.iter().position(|frame| until.is_some_and(|until| frame.time > until));
        lane.next += earlier.unwrap_or(rest.len()).max(1);
        let lost = if lane.next == lane.frames.len() { lane.reader.take_lost() } else { 0 };
        Some(Run { bus: BusIndex(bus as u8), frames: &lane.frames[begin..lane.next], lost })
    }

    /// What became of the log's lines, for each bus.
    pub fn reports(&self) -> impl Iterator<Item = &LogReport> {
        self.0.iter().map(|lane| lane.reader.report())
    }
}

impl Lane {
    fn fill(&mut self) {
        while self.more && self.next == self.frames.len() {
            self.next = 0;
            self.frames.clear();
            self.more = self.reader.next_batch(&mut self.frames, FRAMES);
        }
    }

    fn first(&self) -> Option<Time> {
        self.frames.get(self.next).map(|frame| frame.time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LogReader;

    #[test]
    fn frames_of_several_buses_come_in_the_order_of_their_times() {
        let log = "(1.0) can0 001#00\n(1.1) can1 002#00\n(1.2) can1 003#00\n(1.3) can0 004#00\n(1.4) can1 005#00\n";
        let bus = |interface: &str| -> Box<dyn RecordedFrames> {
            Box::new(LogReader::new("log".to_owned(), log.as_bytes(), Some(interface.to_owned())))
        };
        let mut lanes = Lanes::new(vec![bus("can0"), bus("can1")]);
        let mut runs = Vec::new();
        while let Some(Run { bus, frames, .. }) = lanes.next_run() {
            runs.push((bus.0, frames.iter().map(|timed| timed.frame.id.to_string()).collect::<Vec<_>>().join(" ")));
        }
        let expected = [(0, "001"), (1, "002 003"), (0, "004"), (1, "005")];
        assert_eq!(runs, expected.map(|(bus, ids)| (bus, ids.to_owned())));
    }
}
