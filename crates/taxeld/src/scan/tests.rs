//! What a survey says of frames whose truth is known.

use std::path::Path;

use taxel_can::{BusError, ErrorCounters};
use taxel_skin::{BoardAddress, Module, Time};
use taxel_wire::icub::{Message, StatusWord};
use taxel_wire::{CanId, Frame, TimedFrame};

use super::survey::Survey;
use super::words;
use crate::config;

/// A scan of a module: twelve values and a status.
fn module(survey: &mut Survey, at_s: f64, (board, number): (u8, u8), values: [u8; 12], status: u16) {
    let (board, module) = (BoardAddress::new(board).unwrap(), Module::new(number).unwrap());
    let [head, tail] = [0.0, 0.0002].map(|later| Time::from_seconds(100.0 + at_s + later));
    let message = Message::Head { board, module, values: values[..7].try_into().unwrap() };
    survey.frame(&TimedFrame { time: head, frame: message.encode() });
    let message = Message::Tail { board, module, values: values[7..].try_into().unwrap(), status: StatusWord(status) };
    survey.frame(&TimedFrame { time: tail, frame: message.encode() });
}

fn other(survey: &mut Survey, at_s: f64, id: u16, bytes: &[u8]) {
    let frame = Frame::data(CanId::Standard(id), bytes).unwrap();
    survey.frame(&TimedFrame { time: Time::from_seconds(100.0 + at_s), frame });
}

/// Noise that is the same each time.
fn noise(scan: u32, value: usize) -> u8 {
    (scan.wrapping_mul(7).wrapping_add(value as u32 * 5) % 3) as u8
}

fn at_rest(scan: u32) -> [u8; 12] {
    std::array::from_fn(|k| 238 + noise(scan, k))
}

/// Five seconds of a hand on board 14 and a forearm on board 13: triangle 2 is pressed, so is the palm; module 1 falls silent.
fn surveyed() -> Survey {
    let mut survey = Survey::default();
    for scan in 0..100_u32 {
        let t = f64::from(scan) * 0.05;
        let press = if (40..70).contains(&scan) { 30 } else { 0 };
        let mut triangle = at_rest(scan).map(|v| v - press);
        (triangle[6], triangle[10]) = (240, 240);
        triangle[4] = 255;
        module(&mut survey, t, (13, 2), triangle, 0);
        module(&mut survey, t + 0.001, (14, 0), at_rest(scan), u16::from(scan == 7));
        let mut palm = at_rest(scan).map(|v| v - press);
        palm[11] = 240;
        module(&mut survey, t + 0.002, (14, 8), palm, if scan > 50 { 1 << (4 + 5) } else { 0 });
        if scan < 60 {
            module(&mut survey, t + 0.003, (13, 1), at_rest(scan), 0);
        }
        other(&mut survey, t + 0.004, 0x3A1, &(200 * scan).to_le_bytes());
    }
    survey.error(&BusError::Protocol { violations: 4 });
    survey
}

#[test]
fn boards_and_modules_are_found_and_what_else_is_on_the_bus() {
    let mut survey = surveyed();
    for (transmit, receive) in [(96, 20), (40, 120)] {
        survey.error(&BusError::Warning(Some(ErrorCounters { transmit, receive })));
    }
    let text = words::text(&survey);
    let expected = [
        "board 13: modules 1-2, every 50.0 ms",
        "  module 1: 60 scans, counts 238 to 240, 0 halves without a partner",
        "  module 2: 100 scans, counts 208 to 255, 0 halves without a partner",
        "board 14: modules 0, 8, every 50.0 ms",
        "  module 0: 100 scans, counts 238 to 240, 0 halves without a partner",
        "  module 8: 100 scans, counts 208 to 240, 0 halves without a partner",
        "identifier 3A1: 100 frames, 20.2/s, of 4 bytes, last [58, 4d, 00, 00]",
        "the bus: 2 x error-warning: many errors on the bus",
    ];
    for line in expected {
        assert!(text.lines().any(|said| said == line), "`{line}` is no line of: {text}");
    }
    assert!(text.contains("try sample-point 0.6"), "{text}");
}

#[test]
fn what_was_heard_is_the_beginning_of_a_configuration() {
    let survey = surveyed();
    let text = words::beginning(&survey, "can3");
    let path = Path::new("t.toml");
    let scene = config::examine_text(path, &text).unwrap().1;
    let plan = &scene.plan.patches[0];
    let boards: Vec<u8> = plan.patch.boards().iter().map(|board| board.address.get()).collect();
    assert_eq!((boards, plan.period.as_millis()), (vec![14, 13], 50));
    assert!(plan.bring_up.is_empty(), "{text}");
    assert!(text.contains("address = 14, modules = \"0, 8\""), "{text}");
}

/// Traffic of others, as a car has it, beside a board of which one module lost all its tails.
#[test]
fn a_board_without_a_whole_scan_is_no_board() {
    let mut survey = Survey::default();
    for scan in 0..10_u32 {
        let t = f64::from(scan) * 0.05;
        module(&mut survey, t, (13, 2), at_rest(scan), 0);
        other(&mut survey, t, 0x4D1, &[0x40, 1, 2, 3, 4, 5, 6, 7]);
        other(&mut survey, t, 0x496, &[0xC0, 1, 0x7C, 0x1F, 0, 0, 0, 0]);
    }
    let text = words::text(&survey);
    assert!(text.contains("board 13: modules 2, every") && !text.contains("board 9"), "{text}");
    let beginning = words::beginning(&survey, "can0");
    assert!(beginning.contains("modules = \"2\"") && !beginning.contains("address = 9"), "{beginning}");
}

#[test]
fn a_silent_bus_and_any_frame_at_all_are_borne() {
    assert!(words::text(&Survey::default()).contains("no skin board was heard"));
    let mut survey = Survey::default();
    let mut state = 1_u32;
    for i in 0..20_000_u32 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let bytes: Vec<u8> = (0..(state >> 28) % 9).map(|k| (state >> (k % 24)) as u8).collect();
        let id = if i % 3 == 0 {
            CanId::Extended(state & 0x1FFF_FFFF)
        } else {
            CanId::Standard((state >> 8 & 0x7FF) as u16)
        };
        let time = Time::from_nanos(i64::from(state));
        survey.frame(&TimedFrame { time, frame: Frame::data(id, &bytes).unwrap() });
    }
    assert!(words::text(&survey).starts_with("20000 frames in "));
}
