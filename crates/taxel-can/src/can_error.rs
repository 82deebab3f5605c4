//! Error frames: what a controller tells about its bus.
//!
//! Layout: `linux/can/error.h`. The identifier holds class bits, the data bytes the details.

use std::fmt;

use taxel_wire::{CanId, Frame, FrameKind};

/// One thing that an error frame reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BusError {
    /// The controller left the bus. It neither sends nor receives until it is restarted.
    BusOff,
    /// The controller is back after [`BusError::BusOff`].
    Restarted,
    /// An error counter reached 96.
    Warning(Counters),
    /// An error counter reached 128: the controller no longer marks errors for the others.
    Passive(Counters),
    /// Both error counters are low again.
    Active(Counters),
    /// The controller's own receive buffer overran: frames were lost before the kernel saw them, and no count exists.
    ControllerOverflow,
    /// A bit, stuff, form or other violation of the protocol; the bits of data byte 2.
    Protocol {
        /// `CAN_ERR_PROT_*`.
        violations: u8,
    },
    /// Nobody acknowledged a frame: no other node is there, or none at this bit rate.
    NoAck,
    /// Anything else, by its class bits: a lost arbitration, a frame that was not sent in time, the transceiver.
    Other {
        /// `CAN_ERR_*`.
        class: u32,
    },
}

impl BusError {
    /// What it is, without its numbers.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::BusOff => "bus-off: the controller left the bus",
            Self::Restarted => "the controller is back after bus-off",
            Self::Warning(_) => "error-warning: many errors on the bus",
            Self::Passive(_) => "error-passive: very many errors on the bus",
            Self::Active(_) => "error-active: the errors have become few again",
            Self::ControllerOverflow => "the controller's receive buffer overran",
            Self::Protocol { .. } => "a frame broke the protocol: wiring, termination or bit rate",
            Self::NoAck => "nobody acknowledged a frame: no other node, or another bit rate",
            Self::Other { .. } => "an error of another class, see linux/can/error.h",
        }
    }

    /// The error counters that came with it.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        match self {
            Self::Warning(counters) | Self::Passive(counters) | Self::Active(counters) => *counters,
            _ => None,
        }
    }
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind())?;
        if let Some(ErrorCounters { transmit, receive }) = self.counters() {
            write!(f, " (error counters: {transmit} sending, {receive} receiving)")?;
        }
        match self {
            Self::Protocol { violations } => write!(f, " (CAN_ERR_PROT {violations:#04x})"),
            Self::Other { class } => write!(f, " ({class:#x})"),
            _ => Ok(()),
        }
    }
}

/// The controller's error counters, where it told them.
pub type Counters = Option<ErrorCounters>;

/// Error counters of a controller, as in ISO 11898-1, cut at 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ErrorCounters {
    /// Of transmission.
    pub transmit: u8,
    /// Of reception.
    pub receive: u8,
}

const CONTROLLER: u32 = 0x04;
const PROTOCOL: u32 = 0x08;
const ACK: u32 = 0x20;
const BUS_OFF: u32 = 0x40;
const BUS_ERROR: u32 = 0x80;
const RESTARTED: u32 = 0x100;
const COUNTERS: u32 = 0x200;

/// Calls `each` for everything that `frame` reports; for nothing if it is no error frame.
pub fn decode(frame: &Frame, mut each: impl FnMut(BusError)) {
    let (FrameKind::Error, CanId::Extended(class)) = (frame.kind, frame.id) else { return };
    let mut data = [0; 8];
    for (to, from) in data.iter_mut().zip(frame.bytes()) {
        *to = *from;
    }
    let states = if class & CONTROLLER != 0 { controller(class, data) } else { [None; 2] };
    let known = [
        (class & BUS_OFF != 0).then_some(BusError::BusOff),
        (class & RESTARTED != 0).then_some(BusError::Restarted),
        (class & PROTOCOL != 0).then_some(BusError::Protocol { violations: data[2] }),
        (class & ACK != 0).then_some(BusError::NoAck),
    ];
    let told = states.into_iter().chain(known).flatten().inspect(|error| each(*error)).count();
    // With a protocol violation the bit for a bus error only says once more that there was an error.
    let told_of = BUS_OFF | RESTARTED | CONTROLLER | PROTOCOL | ACK | COUNTERS | BUS_ERROR;
    if class & !told_of != 0 || told == 0 {
        each(BusError::Other { class });
    }
}

/// The controller class: overruns and the three states, in data byte 1.
fn controller(class: u32, data: [u8; 8]) -> [Option<BusError>; 2] {
    // Before Linux 6.0 drivers filled the counters without the bit that says so. A state that is not active has a
    // counter of at least 96, so counters of zero there are no counters.
    let told = class & COUNTERS != 0 || data[6] != 0 || data[7] != 0;
    let counters = told.then_some(ErrorCounters { transmit: data[6], receive: data[7] });
    let state = match data[1] {
        state if state & 0x30 != 0 => Some(BusError::Passive(counters)),
        state if state & 0x0C != 0 => Some(BusError::Warning(counters)),
        state if state & 0x40 != 0 => Some(BusError::Active(counters)),
        _ => None,
    };
    [(data[1] & 0x01 != 0).then_some(BusError::ControllerOverflow), state]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(class: u32, data: [u8; 8]) -> Vec<BusError> {
        let mut all = Vec::new();
        let frame = Frame::new(CanId::Extended(class), FrameKind::Error, &data).unwrap();
        decode(&frame, |error| all.push(error));
        all
    }

    #[test]
    fn frames_of_a_serial_adapter_are_read_as_it_means_them() {
        // Recorded from slcan: `sb`, `sw096096`, `sp130128`, `sa000000`, `e2bf`.
        let counters = |transmit, receive| Some(ErrorCounters { transmit, receive });
        assert_eq!(decoded(0x40, [0; 8]), [BusError::BusOff]);
        assert_eq!(decoded(0x204, [0, 0x0C, 0, 0, 0, 0, 96, 96]), [BusError::Warning(counters(96, 96))]);
        assert_eq!(decoded(0x204, [0, 0x10, 0, 0, 0, 0, 130, 128]), [BusError::Passive(counters(130, 128))]);
        assert_eq!(decoded(0x204, [0, 0x40, 0, 0, 0, 0, 0, 0]), [BusError::Active(counters(0, 0))]);
        assert_eq!(decoded(0x88, [0, 0, 0x0A, 0, 0, 0, 0, 0]), [BusError::Protocol { violations: 0x0A }]);
    }

    #[test]
    fn a_frame_with_several_causes_tells_all_of_them() {
        let all = decoded(0x67, [0, 0x01, 0, 0, 0, 0, 0, 0]);
        let other = BusError::Other { class: 0x67 };
        assert_eq!(all, [BusError::ControllerOverflow, BusError::BusOff, BusError::NoAck, other]);
    }

    #[test]
    fn no_error_frame_is_lost_whatever_its_class_and_each_is_told_in_words() {
        for bit in 0..29 {
            let words = decoded(1 << bit, [0; 8])[0].to_string();
            assert!(!words.contains(['{', '}']) && !words.contains("Some") && words.contains(' '), "{bit}: {words}");
        }
        assert_eq!(decoded(0, [0; 8]), [BusError::Other { class: 0 }]);
    }
}
