//! The wire at 1 Mbit/s: one frame at a time, the lowest identifier first, so that boards interleave.

use crate::rng::{Rng, Stream};
use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::Time;
use taxel_wire::{CanId, Frame, TimedFrame};

/// Frames that a sender can hold: two scans of a full board. What a sender has not sent by then is out of date.
const QUEUE_FRAMES: usize = 64;

/// A sender on the bus.
#[derive(Clone, Debug, Default)]
struct Port {
    queue: VecDeque<Frame>,
    /// When its controller contends for the bus again.
    ready: Time,
}

/// The foremost frame of a port is on the wire.
#[derive(Clone, Copy, Debug)]
struct Transfer {
    port: usize,
    end: Time,
}

/// The wire and the send queues on it.
#[derive(Clone, Debug)]
pub(crate) struct Bus {
    ports: Vec<Port>,
    transfer: Option<Transfer>,
    free: Time,
    rng: Rng,
}

impl Bus {
    pub(crate) fn new(ports: usize, seed: u64, start: Time) -> Self {
        Self {
            ports: vec![Port { queue: VecDeque::new(), ready: start }; ports],
            transfer: None,
            free: start,
            rng: Rng::new(seed, Stream::Bus),
        }
    }

    pub(crate) fn reseed(&mut self, seed: u64) {
        self.rng = Rng::new(seed, Stream::Bus);
    }

    /// Queues a frame; where the sender's queue is full it is lost.
    pub(crate) fn queue(&mut self, port: usize, now: Time, frame: Frame) {
        let port = &mut self.ports[port];
        if port.queue.len() >= QUEUE_FRAMES {
            return;
        }
        if port.queue.is_empty() {
            port.ready = port.ready.max(now);
        }
        port.queue.push_back(frame);
    }

    /// Throws away what a sender has not sent. A frame on the wire is finished.
    pub(crate) fn discard(&mut self, port: usize) {
        let sending = usize::from(self.transfer.is_some_and(|transfer| transfer.port == port));
        self.ports[port].queue.truncate(sending);
    }

    /// When the bus next starts or ends a frame.
    pub(crate) fn next(&self) -> Option<Time> {
        match self.transfer {
            Some(transfer) => Some(transfer.end),
            None => {
                let ready = self.ports.iter().filter(|port| !port.queue.is_empty()).map(|port| port.ready).min()?;
                Some(ready.max(self.free))
            }
        }
    }

    /// Starts or ends a frame at `now`, which must be [`Self::next`]. A frame is on the wire until its end.
    pub(crate) fn step(&mut self, now: Time) -> Option<TimedFrame> {
        let Some(Transfer { port, end }) = self.transfer.take() else {
            self.start(now);
            return None;
        };
        let sender = &mut self.ports[port];
        let frame = sender.queue.pop_front();
        // The firmware hands one frame at a time to its controller, so others get their turn in between.
        sender.ready = end + Duration::from_nanos(self.rng.between(4_000.0, 11_000.0) as u64);
        self.free = end;
        frame.map(|frame| TimedFrame { time: end, frame })
    }

    fn start(&mut self, now: Time) {
        let contenders = self.ports.iter().enumerate().filter(|(_, port)| port.ready <= now);
        let heads = contenders.filter_map(|(index, port)| port.queue.front().map(|frame| (index, frame)));
        if let Some((port, frame)) = heads.min_by_key(|(_, frame)| priority(frame.id)) {
            let (id, bytes) = (frame.id, frame.bytes().len());
            self.transfer = Some(Transfer { port, end: now + self.duration(id, bytes) });
        }
    }

    /// 47 bits (67 with a long identifier) and the data, plus the stuff bits: for skin data 2 to 9 of at most 24.
    fn duration(&mut self, id: CanId, bytes: usize) -> Duration {
        let overhead = if matches!(id, CanId::Extended(_)) { 67 } else { 47 };
        let bits = overhead + 8 * bytes;
        let stuffed = (bits as f64 * self.rng.between(0.02, 0.09)).round() as u64;
        Duration::from_micros(bits as u64 + stuffed)
    }
}

/// Arbitration: the first eleven bits decide, and among equals the standard frame wins.
const fn priority(id: CanId) -> (u32, u32) {
    match id {
        CanId::Standard(id) => (id as u32, 0),
        CanId::Extended(id) => (id >> 18, 1 + (id & 0x3_FFFF)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drain(bus: &mut Bus) -> Vec<TimedFrame> {
        let mut out = Vec::new();
        while let Some(time) = bus.next() {
            out.extend(bus.step(time));
        }
        out
    }

    fn frame(id: u16) -> Frame {
        Frame::data(CanId::Standard(id), &[0; 8]).unwrap()
    }

    #[test]
    fn frames_follow_each_other_in_time_and_low_identifiers_first() {
        let mut bus = Bus::new(2, 1, Time::default());
        for n in 0..10 {
            bus.queue(0, Time::default(), frame(0x400 + n));
            bus.queue(1, Time::default(), frame(0x300 + n));
        }
        let out = drain(&mut bus);
        assert_eq!(out.len(), 20);
        for pair in out.windows(2) {
            let gap = pair[1].time.since(pair[0].time).as_nanos();
            assert!((111_000..=140_000).contains(&gap), "{gap} ns between frames");
        }
        assert_eq!(out[0].frame, frame(0x300));
        assert_eq!(out[1].frame, frame(0x400), "the loser goes while the winner fetches its next");
    }

    #[test]
    fn a_full_queue_refuses_and_a_discard_keeps_the_frame_on_the_wire() {
        let mut bus = Bus::new(1, 1, Time::default());
        (0..100).for_each(|n| bus.queue(0, Time::default(), frame(n)));
        assert_eq!(drain(&mut bus.clone()).len(), QUEUE_FRAMES);
        assert!(bus.step(Time::default()).is_none(), "starts the first");
        bus.discard(0);
        assert_eq!(drain(&mut bus).len(), 1);
    }
}
