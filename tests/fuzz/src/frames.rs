//! Frames of skin boards, and commands to them.

use taxel_wire::icub::{Command, Message, Refusal, decode};
use taxel_wire::{Frame, FrameKind};

use crate::bytes::Bytes;

/// Any number of frames, one after the other.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    while !bytes.is_empty() {
        if let Some(frame) = bytes.frame() {
            check(&frame);
        }
    }
}

fn check(frame: &Frame) {
    let command = Command::decode(frame);
    match decode(frame) {
        Ok(message) => {
            assert!(command.is_none() && frame.kind == FrameKind::Data, "{frame:?} is {message:?} and {command:?}");
            says_the_same(frame, &message);
        }
        Err(refusal) => {
            let text = refusal.to_string();
            assert!(refusal == Refusal::NotSkin || text.contains("expected"), "{text}");
        }
    }
    if let Some((board, command)) = command {
        assert_eq!(Command::decode(&command.encode(board)), Some((board, command)));
    }
}

/// A message that is encoded is read as the same, and has every byte that means something.
fn says_the_same(frame: &Frame, message: &Message) {
    let encoded = message.encode();
    assert_eq!(decode(&encoded), Ok(*message));
    let meaning = match message {
        Message::Head { .. } | Message::Tail { .. } => 0..8,
        Message::Thermometer { .. } => 1..3, // which sensors are in, and what the second says, are not kept
        Message::FirmwareVersion { .. } => 0..7,
        Message::BoardOverflow { .. } => 0..0,
    };
    assert_eq!(encoded.bytes().get(meaning.clone()), frame.bytes().get(meaning), "{message:?}");
}
