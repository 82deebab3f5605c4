//! What a device that is described by its signals is sent so that it streams, as words in its line: `commands 0101, 02FF`.
//!
//! A command may set a gain or a range, and nothing at rest would tell. Identifiers count by their order, as with signals, so
//! that a device of the same make at another identifier is the same; when a command is sent does not count.

use taxel_wire::{CanId, Frame};

use crate::fnv::Fnv;
use crate::intake::cells::{DevicePlan, Sender};

/// Longer words would make the line too long for a model set: a number stands for them.
const WORDS_BYTES_MAX: usize = 200;

/// The commands of a device in words, in the order in which they are sent; `None` where it is not known what it is sent.
pub fn commands(device: &DevicePlan) -> Option<String> {
    if device.commands.is_empty() {
        return (device.sender != Sender::Elsewhere).then(|| "commands none".to_owned());
    }
    let mut sent: Vec<_> = device.commands.iter().collect();
    sent.sort_by_key(|(after, _)| *after); // stable: commands of one time keep their order
    let mut ids: Vec<CanId> = sent.iter().map(|(_, frame)| frame.id).collect();
    ids.sort_unstable();
    ids.dedup();
    let words = sent.iter().map(|(_, frame)| word(frame, &ids)).collect::<Vec<_>>().join(", ");
    if words.len() <= WORDS_BYTES_MAX {
        return Some(format!("commands {words}"));
    }
    let mut hash = Fnv::default();
    hash.push(words.as_bytes());
    Some(format!("commands {} of sum {:08x}", sent.len(), hash.sum()))
}

/// The bytes of a command, and the place of its identifier among several.
fn word(frame: &Frame, ids: &[CanId]) -> String {
    let bytes: String = frame.bytes().iter().map(|byte| format!("{byte:02X}")).collect();
    let bytes = if bytes.is_empty() { "nothing".to_owned() } else { bytes };
    match ids.binary_search(&frame.id) {
        Ok(place) if ids.len() > 1 => format!("{}#{bytes}", place + 1),
        _ => bytes,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// Of commands to these identifiers, so many milliseconds after the beginning.
    fn of(sent: &[(u16, u64, &[u8])]) -> String {
        let command = |&(id, ms, bytes): &(u16, u64, &[u8])| {
            (Duration::from_millis(ms), Frame::data(CanId::Standard(id), bytes).unwrap())
        };
        let commands = sent.iter().map(command).collect();
        let device = DevicePlan { commands, sender: Sender::Patch, ..DevicePlan::without_frames() };
        let told = super::commands(&device);
        assert_eq!(told, super::commands(&DevicePlan { sender: Sender::OtherPatch, ..device }));
        told.unwrap()
    }

    #[test]
    fn commands_are_told_by_their_bytes_in_the_order_in_which_they_are_sent() {
        let says = |sent: &[(u16, u64, &[u8])], words: &str| assert_eq!(of(sent), words);
        says(&[(5, 0, &[1, 1])], "commands 0101");
        says(&[(5, 30, &[2, 255]), (5, 0, &[1])], "commands 01, 02FF");
        says(&[(7, 0, &[1]), (5, 0, &[1])], "commands 2#01, 1#01");
        says(&[(5, 0, &[1]), (6, 30, &[2])], "commands 1#01, 2#02");
        says(&[(8, 10, &[1]), (9, 50, &[2])], "commands 1#01, 2#02"); // at other identifiers, and a little later
        says(&[(6, 0, &[1]), (5, 30, &[2])], "commands 2#01, 1#02");
        says(&[(5, 30, &[1]), (6, 0, &[2])], "commands 2#02, 1#01");
        says(&[(5, 0, &[])], "commands nothing");
        says(&[], "commands none");
    }

    #[test]
    fn many_commands_are_told_by_a_number() {
        let many = |last: u8| {
            let all: Vec<[u8; 2]> = (0..200).map(|n| [n, if n == 199 { last } else { 0 }]).collect();
            of(&all.iter().map(|bytes| (5, 0, bytes.as_slice())).collect::<Vec<_>>())
        };
        let (long, other) = (many(0), many(1));
        assert_ne!(long, other);
        assert!(long.starts_with("commands 200 of sum "), "{long}");
    }

    #[test]
    fn what_somebody_else_sends_is_known_if_the_configuration_says_so() {
        let listened = DevicePlan { sender: Sender::Elsewhere, ..DevicePlan::without_frames() };
        assert_eq!(super::commands(&listened), None);
        let commands = vec![(Duration::ZERO, Frame::data(CanId::Standard(5), &[1]).unwrap())];
        assert_eq!(super::commands(&DevicePlan { commands, ..listened }), Some(of(&[(5, 0, &[1])])));
    }
}
