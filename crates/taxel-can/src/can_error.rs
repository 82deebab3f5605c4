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
    /// The controller's own buffer overran: frames were lost before the kernel saw them, and no count exists.
    ControllerOverflow {
        /// The receive buffer (`true`) or the transmit buffer.
        receive: bool,
    },
    /// A bit, stuff, form or other violation of the protocol; the bits of data byte 2.
    Protocol {
        /// `CAN_ERR_PROT_*`.
        violations: u8,
    },
    /// A frame was not sent in time.
    TxTimeout,
    /// Another node won the arbitration.
    LostArbitration,
    /// The transceiver reports a fault of the wires; data byte 4.
    Transceiver {
        /// `CAN_ERR_TRX_*`.
        status: u8,
    },
    /// Nobody acknowledged a frame: no other node is there, or none at this bit rate.
    NoAck,
    /// Bus errors that the controller does not specify.
    Unspecified,
    /// Class bits that are not known here.
    Unknown {
        /// The bits.
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
            Self::ControllerOverflow { receive: true } => "the controller's receive buffer overran",
            Self::ControllerOverflow { receive: false } => "the controller's transmit buffer overran",
            Self::Protocol { .. } => "a frame broke the protocol: wiring, termination or bit rate",
            Self::TxTimeout => "a frame was not sent in time",
            Self::LostArbitration => "another node won the arbitration",
            Self::Transceiver { .. } => "the transceiver reports a fault of the wires",
            Self::NoAck => "nobody acknowledged a frame: no other node, or another bit rate",
            Self::Unspecified => "an error on the bus that the controller does not specify",
            Self::Unknown { .. } => "an error frame of an unknown class",
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
            Self::Transceiver { status } => write!(f, " (CAN_ERR_TRX {status:#04x})"),
            Self::Unknown { class } => write!(f, " ({class:#x})"),
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

const TX_TIMEOUT: u32 = 0x01;
const LOST_ARBITRATION: u32 = 0x02;
const CONTROLLER: u32 = 0x04;
const PROTOCOL: u32 = 0x08;
const TRANSCEIVER: u32 = 0x10;
const ACK: u32 = 0x20;
const BUS_OFF: u32 = 0x40;
const BUS_ERROR: u32 = 0x80;
const RESTARTED: u32 = 0x100;
const COUNTERS: u32 = 0x200;
const KNOWN: u32 = 0x3FF;

/// Calls `each` for everything that `frame` reports; for nothing if it is no error frame.
pub fn decode(frame: &Frame, mut each: impl FnMut(BusError)) {
    let (FrameKind::Error, CanId::Extended(class)) = (frame.kind, frame.id) else { return };
    let mut data = [0; 8];
    for (to, from) in data.iter_mut().zip(frame.bytes()) {
        *to = *from;
    }
    if class & BUS_OFF != 0 {
        each(BusError::BusOff);
    }
    if class & RESTARTED != 0 {
        each(BusError::Restarted);
    }
    if class & CONTROLLER != 0 {
        controller(class, data, &mut each);
    }
    if class & PROTOCOL != 0 {
        each(BusError::Protocol { violations: data[2] });
    }
    let plain = [
        (TX_TIMEOUT, BusError::TxTimeout),
        (LOST_ARBITRATION, BusError::LostArbitration),
        (TRANSCEIVER, BusError::Transceiver { status: data[4] }),
        (ACK, BusError::NoAck),
    ];
    for (bit, error) in plain {
        if class & bit != 0 {
            each(error);
        }
    }
    // With a protocol violation this bit only says once more that there was an error.
    if class & BUS_ERROR != 0 && class & PROTOCOL == 0 {
        each(BusError::Unspecified);
    }
    if class & !KNOWN != 0 || class & (KNOWN & !COUNTERS) == 0 {
        each(BusError::Unknown { class });
    }
}

/// The controller class: overruns and the three states, in data byte 1.
fn controller(class: u32, data: [u8; 8], each: &mut impl FnMut(BusError)) {
    // Before Linux 6.0 drivers filled the counters without the bit that says so. A state that is not active has a
    // counter of at least 96, so counters of zero there are no counters.
    let told = class & COUNTERS != 0 || data[6] != 0 || data[7] != 0;
    let counters = told.then_some(ErrorCounters { transmit: data[6], receive: data[7] });
    let state = data[1];
    if state & 0x01 != 0 {
        each(BusError::ControllerOverflow { receive: true });
    }
    if state & 0x02 != 0 {
        each(BusError::ControllerOverflow { receive: false });
    }
    if state & 0x30 != 0 {
        each(BusError::Passive(counters));
    } else if state & 0x0C != 0 {
        each(BusError::Warning(counters));
    } else if state & 0x40 != 0 {
        each(BusError::Active(counters));
    } else if state & 0x03 == 0 {
        each(BusError::Unspecified);
    }
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
        let expected = [
            BusError::BusOff,
            BusError::ControllerOverflow { receive: true },
            BusError::TxTimeout,
            BusError::LostArbitration,
            BusError::NoAck,
        ];
        assert_eq!(all, expected);
    }

    #[test]
    fn no_error_frame_is_lost_whatever_its_class() {
        for bit in 0..29 {
            assert!(!decoded(1 << bit, [0; 8]).is_empty(), "class bit {bit}");
        }
        assert_eq!(decoded(0, [0; 8]), [BusError::Unknown { class: 0 }]);
    }

    #[test]
    fn errors_are_told_in_words() {
        let said = |class, data| decoded(class, data)[0].to_string();
        let active = said(0x204, [0, 0x40, 0, 0, 0, 0, 5, 0]);
        assert_eq!(active, "error-active: the errors have become few again (error counters: 5 sending, 0 receiving)");
        for bit in 0..29 {
            let words = said(1 << bit, [0; 8]);
            assert!(!words.contains(['{', '}']) && !words.contains("Some") && words.contains(' '), "{words}");
        }
    }

    #[test]
    fn a_data_frame_reports_nothing() {
        decode(&Frame::of(CanId::Extended(0x40), []), |error| panic!("{error:?}"));
    }
}
