//! What a log has of the buses of a configuration, as one course of frames in the order of their times.

use std::path::Path;

use taxel_can::{LogReport, RecordedFrames};
use taxel_skin::{BusIndex, Time};
use taxel_wire::TimedFrame;

use crate::config::{self, Config, Scene};
use crate::log_words::read_on;
use crate::open_log::{Wanted, open_log};

/// Frames per read.
const FRAMES: usize = 4096;

/// Frames of one bus, and how many were lost behind them.
pub struct Run<'a> {
    pub bus: BusIndex,
    pub frames: &'a [TimedFrame],
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

/// All buses.
pub struct Lanes(Vec<Lane>);

impl Lanes {
    /// Opens a log once for each bus.
    ///
    /// # Errors
    /// A log that cannot be read.
    pub fn open(log: &Path, config: &Config, scene: &Scene) -> anyhow::Result<Self> {
        let wanted = readings(config, scene);
        let lane = |wanted| Ok(Lane { reader: open_log(log, wanted)?, frames: Vec::new(), next: 0, more: true });
        wanted.map(lane).collect::<anyhow::Result<_>>().map(Self)
    }

    /// The next frames, as many of one bus as come before those of another one.
    pub fn next(&mut self) -> Option<Run<'_>> {
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
            (self.next, self.frames) = (0, std::mem::take(&mut self.frames));
            self.frames.clear();
            self.more = read_on(self.reader.as_mut(), &mut self.frames, FRAMES);
        }
    }

    fn first(&self) -> Option<Time> {
        self.frames.get(self.next).map(|frame| frame.time)
    }
}

/// What is to be read of a log for each bus.
pub fn readings(config: &Config, scene: &Scene) -> impl Iterator<Item = Wanted> {
    config.bus.iter().zip(0..).map(|(section, position)| Wanted {
        interface: section.interface.clone(),
        // A recording knows the names of buses; with one bus they need not be the same.
        bus: (config.bus.len() > 1).then(|| section.name.clone()),
        port: config::port_of(config, &scene.plan, BusIndex(position)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_can::LogReader;

    #[test]
    fn frames_of_several_buses_come_in_the_order_of_their_times() {
        let log = "(1.0) can0 001#00\n(1.1) can1 002#00\n(1.2) can1 003#00\n(1.3) can0 004#00\n(1.4) can1 005#00\n";
        let lane = |interface: &str| {
            let reader = LogReader::new("log".to_owned(), log.as_bytes(), Some(interface.to_owned())).unwrap();
            Lane { reader: Box::new(reader), frames: Vec::new(), next: 0, more: true }
        };
        let mut lanes = Lanes(vec![lane("can0"), lane("can1")]);
        let mut runs = Vec::new();
        while let Some(Run { bus, frames, .. }) = lanes.next() {
            runs.push((bus.0, frames.iter().map(|timed| timed.frame.id.to_string()).collect::<Vec<_>>().join(" ")));
        }
        let expected = [(0, "001"), (1, "002 003"), (0, "004"), (1, "005")];
        assert_eq!(runs, expected.map(|(bus, ids)| (bus, ids.to_owned())));
    }
}
