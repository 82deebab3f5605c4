use super::command::EVERYONE;
use super::*;
use crate::{CanId, Frame, FrameKind};
use proptest::prelude::*;
use taxel_skin::{BoardAddress, Module};

fn address(address: u8) -> BoardAddress {
    BoardAddress::new(address).unwrap()
}

fn standard(id: u16, bytes: &[u8]) -> Frame {
    Frame::data(CanId::Standard(id), bytes).unwrap()
}

fn any_board() -> impl Strategy<Value = BoardAddress> {
    (1..=15_u8).prop_map(address)
}

fn any_module() -> impl Strategy<Value = Module> {
    (0..16_u8).prop_map(Module::from_nibble)
}

prop_compose! {
    fn any_version()(board_type: u8, app: (u8, u8, u8), protocol: (u8, u8), compatible: bool) -> FirmwareVersion {
        FirmwareVersion { board_type, app, protocol, compatible }
    }
}

fn any_message() -> impl Strategy<Value = Message> {
    prop_oneof![
        (any_board(), any_module(), any::<[u8; 7]>()).prop_map(|(board, module, values)| Message::Head {
            board,
            module,
            values
        }),
        (any_board(), any_module(), any::<[u8; 5]>(), any::<u16>()).prop_map(|(board, module, values, status)| {
            Message::Tail { board, module, values, status: StatusWord(status) }
        }),
        (any_board(), any::<i16>()).prop_map(|(board, deci_celsius)| Message::Thermometer { board, deci_celsius }),
        (any_board(), any_version()).prop_map(|(board, version)| Message::FirmwareVersion { board, version }),
        any_board().prop_map(|board| Message::BoardOverflow { board }),
    ]
}

fn any_command() -> impl Strategy<Value = Command> {
    prop_oneof![
        any::<(u8, u8, u8)>().prop_map(|(kind, period_ms, no_load)| {
            Command::SetBoardConfig(BoardConfig { kind, period_ms, no_load })
        }),
        (any_module(), any_module(), any::<(u8, bool, u16)>()).prop_map(|(a, b, (shift, enabled, cdc_offset))| {
            Command::SetTriangles(TriangleConfig { first: a.min(b), last: a.max(b), shift, enabled, cdc_offset })
        }),
        Just(Command::Start),
        Just(Command::Stop),
        any::<(u8, u8)>().prop_map(|protocol| Command::QueryFirmware { protocol }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn messages_survive_the_wire(message in any_message()) {
        prop_assert_eq!(decode(&message.encode()), Ok(message));
        prop_assert_eq!(Command::decode(&message.encode()), None);
    }

    #[test]
    fn commands_survive_the_wire(board in any_board(), command in any_command()) {
        let expected = (board.get() != EVERYONE).then_some((board, command));
        prop_assert_eq!(Command::decode(&command.encode(board)), expected);
    }
}

#[test]
fn every_identifier_length_and_marker_is_decoded_as_the_table_says() {
    for id in 0..=0x7FF_u16 {
        let (class, source, low) = (id >> 8, id >> 4 & 0xF, id & 0xF);
        let is_board = (1..=15).contains(&source);
        for length in 0..=8 {
            for first in [0x40, 0xC0, 0x01, 0x1C, 0x00] {
                let mut bytes = [0x11; 8];
                bytes[0] = first;
                let decoded = decode(&standard(id, &bytes[..length]));
                let expected = match (class, first, length) {
                    (3 | 4, 0x40, 8) => "head",
                    (3 | 4 | 6, 0xC0, 8) => "tail",
                    (3, 0x01, 5) if low >= 14 => "thermometer",
                    (2, 0x1C, 8) if low == 0 => "version",
                    (7, _, 0) if low == 5 => "overflow",
                    _ => "refused",
                };
                let found = match decoded {
                    Ok(Message::Head { .. }) => "head",
                    Ok(Message::Tail { .. }) => "tail",
                    Ok(Message::Thermometer { .. }) => "thermometer",
                    Ok(Message::FirmwareVersion { .. }) => "version",
                    Ok(Message::BoardOverflow { .. }) => "overflow",
                    Err(_) => "refused",
                };
                let expected = if is_board { expected } else { "refused" };
                assert_eq!(found, expected, "id {id:03X}, length {length}, first byte {first:02X}");
            }
        }
    }
}

#[test]
fn board_13_triangle_5() {
    let module = Module::from_nibble(5);
    let head = standard(0x4D5, &[0x40, 240, 239, 241, 0, 255, 240, 238]);
    let values = [240, 239, 241, 0, 255, 240, 238];
    assert_eq!(decode(&head), Ok(Message::Head { board: address(13), module, values }));

    let tail = standard(0x4D5, &[0xC0, 1, 2, 3, 4, 5, 0x80, 0x12]);
    let status = StatusWord(0x8012);
    let tail_message = Message::Tail { board: address(13), module, values: [1, 2, 3, 4, 5], status };
    assert_eq!(decode(&tail), Ok(tail_message));
    assert_eq!(tail_message.encode(), tail);
    assert!(status.not_connected() && !status.no_ack() && !status.is_ok());
    let bad: Vec<usize> = (0..100).filter(|&value| status.out_of_range(value)).collect();
    assert_eq!(bad, [0, 11]);
    assert!(StatusWord(1).no_ack() && StatusWord(0).is_ok());
}

#[test]
fn thermometers_are_told_from_legacy_modules() {
    for id in [0x3DE, 0x3DF] {
        let frame = standard(id, &[0x01, 0x2C, 0x01, 0, 0]);
        assert_eq!(decode(&frame), Ok(Message::Thermometer { board: address(13), deci_celsius: 300 }));
    }
    let cold = standard(0x3DE, &[0x03, 0xF6, 0xFF, 9, 9]);
    assert_eq!(decode(&cold), Ok(Message::Thermometer { board: address(13), deci_celsius: -10 }));
}

#[test]
fn firmware_reply_and_overflow_notice() {
    let reply = standard(0x2D0, &[0x1C, 11, 1, 24, 0, 2, 0, 1]);
    let version = FirmwareVersion { board_type: 11, app: (1, 24, 0), protocol: (2, 0), compatible: true };
    assert_eq!(decode(&reply), Ok(Message::FirmwareVersion { board: address(13), version }));
    assert!(version.loses_arbitrated_frames());
    assert!(!FirmwareVersion { app: (1, 25, 0), ..version }.loses_arbitrated_frames());
    assert!(!FirmwareVersion { app: (1, 20, 9), ..version }.loses_arbitrated_frames());
    assert!(!FirmwareVersion { board_type: 5, ..version }.loses_arbitrated_frames());

    assert_eq!(decode(&standard(0x7D5, &[])), Ok(Message::BoardOverflow { board: address(13) }));
}

#[test]
fn refusals_name_what_is_wrong() {
    let remote = Frame::new(CanId::Standard(0x4D5), FrameKind::Remote, &[0; 8]).unwrap();
    assert_eq!(decode(&remote), Err(Refusal::Kind(FrameKind::Remote)));
    let error = Frame::new(CanId::Extended(0x40), FrameKind::Error, &[0; 8]).unwrap();
    assert_eq!(decode(&error), Err(Refusal::Kind(FrameKind::Error)));
    let extended = Frame::data(CanId::Extended(0x4D5), &[0x40; 8]).unwrap();
    assert_eq!(decode(&extended), Err(Refusal::NotSkin));
    assert_eq!(decode(&standard(0xCD5, &[0x40; 8])), Err(Refusal::NotSkin), "no 11-bit identifier");
    let refusal = decode(&standard(0x4D5, &[0x40; 7])).unwrap_err();
    assert_eq!(refusal.to_string(), "frame 4D5 has 7 bytes, expected one of [8]");
    let refusal = decode(&standard(0x61F, &[0x40; 8])).unwrap_err();
    assert_eq!(refusal.to_string(), "frame 61F begins with hexadecimal 40, expected one of [C0]");
    let refusal = decode(&standard(0x405, &[0x40; 8])).unwrap_err();
    assert_eq!(refusal.to_string(), "frame 405 comes from address 0, expected a board address from 1 to 15");
}

#[test]
fn commands_have_the_bytes_of_the_manual() {
    let config = BoardConfig { kind: 0, period_ms: 50, no_load: 240 };
    let triangles = TriangleConfig {
        first: Module::from_nibble(0),
        last: Module::from_nibble(15),
        shift: 2,
        enabled: true,
        cdc_offset: 0x2200,
    };
    let table: [(Command, &[u8]); 5] = [
        (Command::SetBoardConfig(config), &[0x4D, 0, 50, 240]),
        (Command::SetTriangles(triangles), &[0x50, 0, 15, 2, 1, 0x00, 0x22]),
        (Command::Start, &[0x07, 0]),
        (Command::Stop, &[0x07, 1]),
        (Command::QueryFirmware { protocol: (2, 0) }, &[0x1C, 2, 0]),
    ];
    for (command, bytes) in table {
        assert_eq!(command.encode(address(13)), standard(0x20D, bytes), "{command:?}");
    }
}
