//! Frames of a bus on their way into a recording.

use prost::Message as _;
use taxel_proto::Timestamp;
use taxel_proto::v1::{CanFrame, CanFrameKind, CanFrames};
use taxel_wire::{CanId, Frame, FrameKind, TimedFrame};

use crate::queue::{Given, Queue};

/// One bus's way to the recorder.
pub struct FrameTap {
    queue: Queue,
    topic: usize,
    bus: String,
    interface: String,
    /// Frames that found no room since the last that did.
    not_recorded: u64,
    kernel_lost: u64,
}

impl FrameTap {
    /// The tap of a bus, by its name and its network interface, whose frames are this topic.
    #[must_use]
    pub const fn new(queue: Queue, topic: usize, bus: String, interface: String) -> Self {
        Self { queue, topic, bus, interface, not_recorded: 0, kernel_lost: 0 }
    }

    /// The kernel lost so many frames.
    pub const fn kernel_lost(&mut self, frames: u64) {
        self.kernel_lost = self.kernel_lost.saturating_add(frames);
    }

    /// Copies frames on their way to the engine, and the error frames of the controller that came with them, of which the engine
    /// hears first. Never waits. `wall_offset_ns` is what to add to a time of the run's clock for nanoseconds since 1970.
    pub fn take(&mut self, frames: &[TimedFrame], errors: &[TimedFrame], wall_offset_ns: i64) {
        let frames = [errors, frames].concat();
        let Some(first) = frames.first() else { return };
        let wall_ns = first.time.as_nanos().saturating_add(wall_offset_ns);
        let (bus, interface) = (self.bus.clone(), self.interface.clone());
        let (kernel_lost, not_recorded) = (self.kernel_lost, self.not_recorded);
        let things = frames.len() as u64;
        let weight = (things, frames.len() * size_of::<TimedFrame>());
        let encode = move || {
            let message = frames_message(&frames, wall_ns);
            CanFrames { bus, interface, kernel_lost, not_recorded, ..message }.encode_to_vec()
        };
        match self.queue.give_later(self.topic, u64::try_from(wall_ns).unwrap_or(0), weight, encode) {
            Given::Taken => (self.kernel_lost, self.not_recorded) = (0, 0),
            Given::Lost => self.not_recorded = self.not_recorded.saturating_add(things),
        }
    }
}

/// The message of frames, of which the first was received at so many nanoseconds since 1970.
#[must_use]
pub fn frames_message(frames: &[TimedFrame], wall_ns: i64) -> CanFrames {
    let first = frames.first().map_or(0, |first| first.time.as_nanos());
    let (seconds, nanos) = (wall_ns.div_euclid(1_000_000_000), wall_ns.rem_euclid(1_000_000_000));
    CanFrames {
        monotonic_ns: first,
        time: Some(Timestamp { seconds, nanos: nanos as i32 }),
        frames: frames.iter().map(|timed| frame_message(timed, first)).collect(),
        ..CanFrames::default()
    }
}

/// The message of one frame.
fn frame_message(timed: &TimedFrame, first_ns: i64) -> CanFrame {
    let TimedFrame { time, frame } = timed;
    let (id, extended) = match frame.id {
        CanId::Standard(id) => (u32::from(id), false),
        CanId::Extended(id) => (id, true),
    };
    let (kind, data, asked_bytes) = match frame.kind {
        FrameKind::Data => (CanFrameKind::Data, frame.bytes().to_vec(), 0),
        FrameKind::Fd => (CanFrameKind::Fd, frame.bytes().to_vec(), 0),
        FrameKind::Remote => (CanFrameKind::Remote, Vec::new(), frame.bytes().len() as u32),
        FrameKind::Error => (CanFrameKind::Error, frame.bytes().to_vec(), 0),
    };
    let after_ns = time.as_nanos().saturating_sub(first_ns);
    CanFrame { after_ns, id, extended, kind: kind.into(), data, asked_bytes }
}

/// The frame of a message; `None` if no bus can carry it.
pub(crate) fn frame_of(message: &CanFrame) -> Option<Frame> {
    let id = if message.extended {
        CanId::Extended(message.id & 0x1FFF_FFFF)
    } else {
        CanId::Standard((message.id & 0x7FF) as u16)
    };
    let kept = match id {
        CanId::Standard(id) => u32::from(id),
        CanId::Extended(id) => id,
    };
    if kept != message.id {
        return None;
    }
    match message.kind() {
        CanFrameKind::Data => Frame::new(id, FrameKind::Data, &message.data),
        CanFrameKind::Fd => Frame::fd(id, &message.data),
        CanFrameKind::Remote => {
            Frame::new(id, FrameKind::Remote, [0; 8].get(..usize::try_from(message.asked_bytes).ok()?)?)
        }
        // Its identifier is a class of 29 bits.
        CanFrameKind::Error => Frame::new(id, FrameKind::Error, &message.data).filter(|_| message.extended),
        CanFrameKind::Unspecified => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use taxel_skin::Time;

    proptest! {
        #[test]
        fn a_frame_comes_out_as_it_went_in(
            id in 0_u32..0x2000_0000,
            extended: bool,
            kind in 0..4,
            data in prop::collection::vec(any::<u8>(), 0..=8),
            ns in 0..i64::MAX,
        ) {
            let id = if extended || kind == 3 { CanId::Extended(id) } else { CanId::Standard((id & 0x7FF) as u16) };
            let frame = match kind {
                0 => Frame::new(id, FrameKind::Data, &data).unwrap(),
                1 => Frame::new(id, FrameKind::Remote, &data).unwrap(),
                3 => Frame::new(id, FrameKind::Error, &data).unwrap(),
                _ => Frame::fd(id, &data).unwrap(),
            };
            let timed = TimedFrame { time: Time::from_nanos(ns), frame };
            let message = frames_message(&[timed], 1);
            prop_assert_eq!(message.monotonic_ns, ns);
            prop_assert_eq!(frame_of(&message.frames[0]), Some(frame));
        }
    }

    #[test]
    fn what_no_bus_can_carry_is_no_frame() {
        let good = CanFrame { id: 0x7FF, kind: CanFrameKind::Data.into(), data: vec![0; 8], ..CanFrame::default() };
        assert!(frame_of(&good).is_some());
        for bad in [
            CanFrame { id: 0x800, ..good.clone() },
            CanFrame { data: vec![0; 9], ..good.clone() },
            CanFrame { kind: 99, ..good.clone() },
            CanFrame { kind: CanFrameKind::Error.into(), ..good.clone() },
            CanFrame { kind: CanFrameKind::Remote.into(), asked_bytes: 9, ..good.clone() },
            CanFrame { id: u32::MAX, extended: true, ..good },
        ] {
            assert_eq!(frame_of(&bad), None, "{bad:?}");
        }
    }
}
