//! Error frames in words (linux/can/error.h).

use taxel_wire::{CanId, Frame, FrameKind};

use crate::BusEvent;

const TX_TIMEOUT: u32 = 0x001;
const CONTROLLER: u32 = 0x004;
const PROTOCOL: u32 = 0x008;
const NO_ACK: u32 = 0x020;
const BUS_OFF: u32 = 0x040;
const BUS_ERROR: u32 = 0x080;
const RESTARTED: u32 = 0x100;

/// Bits of data byte 1 for [`CONTROLLER`].
const CONTROLLER_STATES: [(u8, &str); 7] = [
    (0x01, "receive buffer of the controller overflowed"),
    (0x02, "send buffer of the controller overflowed"),
    (0x04, "error-warning (receiving)"),
    (0x08, "error-warning (sending)"),
    (0x10, "error-passive (receiving)"),
    (0x20, "error-passive (sending)"),
    (0x40, "error-active again"),
];

/// What an error frame says; `None` for any other frame.
pub fn event(frame: &Frame) -> Option<BusEvent> {
    let CanId::Extended(class) = frame.id else { return None };
    if frame.kind != FrameKind::Error {
        return None;
    }
    if class & BUS_OFF != 0 {
        return Some(BusEvent::BusOff);
    }
    let mut words: Vec<&str> = Vec::new();
    let classes = [
        (TX_TIMEOUT, "sending timed out"),
        (PROTOCOL, "protocol violation"),
        (NO_ACK, "no other node acknowledges"),
        (BUS_ERROR, "bus error"),
        (RESTARTED, "the controller restarted"),
    ];
    words.extend(classes.iter().filter(|(bit, _)| class & bit != 0).map(|(_, word)| *word));
    if class & CONTROLLER != 0 {
        let states = frame.bytes().get(1).copied().unwrap_or(0);
        words.extend(CONTROLLER_STATES.iter().filter(|(bit, _)| states & bit != 0).map(|(_, word)| *word));
    }
    let text = if words.is_empty() { format!("error class {class:#x}") } else { words.join(", ") };
    Some(BusEvent::ControllerError(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(class: u32, data: [u8; 8]) -> Option<BusEvent> {
        event(&Frame::new(CanId::Extended(class), FrameKind::Error, &data).unwrap())
    }

    #[test]
    fn controller_states_and_bus_off_are_told_apart() {
        assert_eq!(error(0x40, [0; 8]), Some(BusEvent::BusOff));
        let passive = error(0x204, [0, 0x10, 0, 0, 0, 0, 0, 0]);
        assert_eq!(passive, Some(BusEvent::ControllerError("error-passive (receiving)".into())));
        assert_eq!(error(0x88, [0; 8]), Some(BusEvent::ControllerError("protocol violation, bus error".into())));
        assert_eq!(event(&Frame::of(CanId::Extended(0x40), [1])), None, "a data frame is none");
    }
}
