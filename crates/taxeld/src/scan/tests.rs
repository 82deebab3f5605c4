//! What a survey says of frames whose truth is known.

use taxel_can::{BusError, ErrorCounters};
use taxel_engine::plan::Plan;
use taxel_skin::{BoardAddress, Module, Time};
use taxel_wire::icub::{Message, StatusWord};
use taxel_wire::{CanId, Frame, TimedFrame};

use super::compare::{differences, name_no_gauge_among_taxels};
use super::findings::Findings;
use super::survey::Survey;
use super::words;
use crate::config;
use std::path::Path;
use taxel_skin::BusIndex;

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

/// Five seconds of a hand on board 14 and a forearm on board 13: triangle 2 is pressed, so is the palm; the triangle's value
/// 4 is stuck and fingertip 0's value 3 flickers; module 1 falls silent.
fn surveyed() -> Findings {
    let mut survey = Survey::default();
    for scan in 0..100_u32 {
        let t = f64::from(scan) * 0.05;
        let press = if (40..70).contains(&scan) { 30 } else { 0 };
        let mut triangle = at_rest(scan).map(|v| v - press);
        (triangle[6], triangle[10]) = (240, 240);
        triangle[4] = 255;
        module(&mut survey, t, (13, 2), triangle, 0);
        let mut tip = at_rest(scan);
        tip[3] = if scan % 9 == 0 { 20 } else { tip[3] };
        module(&mut survey, t + 0.001, (14, 0), tip, u16::from(scan == 7));
        let mut palm = at_rest(scan).map(|v| v - press);
        palm[11] = 240;
        module(&mut survey, t + 0.002, (14, 8), palm, if scan > 50 { 1 << (4 + 5) } else { 0 });
        if scan < 60 {
            module(&mut survey, t + 0.003, (13, 1), at_rest(scan), 0);
        }
        // The bag: up by 0.2 kPa a scan, with noise; in pascal, after a counter.
        let pascal = 150 + 200 * scan as i32 + 30 * i32::from(noise(scan, 1));
        let mut bytes = [scan as u8, 0, 0, 0, 0, 0];
        bytes[2..].copy_from_slice(&pascal.to_le_bytes());
        other(&mut survey, t + 0.004, 0x3A1, &bytes);
        other(&mut survey, t + 0.005, 0x111, &(scan * 1000).to_be_bytes()); // a clock
        other(&mut survey, t + 0.006, 0x112, &[1, 2, 3, 4]); // never changes
        let torque = (scan.wrapping_mul(2_654_435_761) >> 16) as u16; // anything
        other(&mut survey, t + 0.007, 0x113, &torque.to_le_bytes());
    }
    survey.error(&BusError::Protocol { violations: 4 });
    survey.findings()
}

#[test]
fn boards_modules_periods_and_faults_are_found() {
    let found = surveyed();
    assert!((found.seconds - 4.957).abs() < 0.01, "{}", found.seconds);
    assert_eq!(found.boards.keys().copied().collect::<Vec<_>>(), [13, 14]);
    assert!((found.boards[&13].period_ms.unwrap() - 50.0).abs() < 0.1);
    let triangle = &found.boards[&13].modules[&2];
    assert_eq!((triangle.scans, &triangle.stuck[..], triangle.pressed), (100, &[4_u8][..], true));
    assert!(triangle.kinds.contains(&"triangle"), "{:?}", triangle.kinds);
    let palm = &found.boards[&14].modules[&8];
    assert!(palm.pressed && !palm.kinds.contains(&"triangle") && palm.kinds.contains(&"palm-pad11"), "{palm:?}");
    assert_eq!(palm.out_of_range, [(5, 49)].into());
    let tip = &found.boards[&14].modules[&0];
    assert_eq!((&tip.flickering[..], tip.no_acks), (&[3_u8][..], 1));
    assert!((tip.mean[0] - 239.0).abs() < 0.2 && tip.noise[0] > 0.5 && tip.noise[0] < 1.5, "{tip:?}");
    let silent = found.boards[&13].modules[&1].silent_s.unwrap();
    assert!((1.9..2.1).contains(&silent), "{silent}");
    // 2 x 3.6 skin frames of 111 bits a scan, and four others.
    let bits = 100.0 * (2.0 * 3.6 * 111.0 + (47.0 + 48.0) + 2.0 * (47.0 + 32.0) + (47.0 + 16.0));
    assert!((found.load - bits / found.seconds / 1e6).abs() < 1e-4, "{}", found.load);
}

#[test]
fn the_bag_is_told_from_clocks_constants_and_noise() {
    let found = surveyed();
    let pressures = |id: &str| &found.others.iter().find(|other| other.id == id).unwrap().pressures;
    let bag = &pressures("3A1")[0];
    assert_eq!((bag.start_bit, bag.length_bits, bag.byte_order, bag.unit), (16, 32, "little", "Pa"), "{bag:?}");
    assert!(bag.moving && bag.meaning == "differential" && (19.0..21.0).contains(&bag.kpa.1), "{bag:?}");
    for id in ["111", "112", "113"] {
        assert!(!pressures(id).iter().any(|p| p.moving), "{id}: {:?}", pressures(id));
    }
}

const CONFIG: &str = r#"
[store]
path = "t.db"
[[bus]]
name = "arm"
interface = "can0"
[[patch]]
name = "arm"
bus = "arm"
period_ms = 30
boards = [
    { address = 13, modules = "1-3" },
    { address = 14, modules = "8 triangle" },
    { address = 12, modules = "0" },
]
gauge = { id = 0x3A2, signal = "0|32@1+", unit = "Pa" }
"#;

#[test]
fn differences_from_the_configuration_are_named() {
    let found = surveyed();
    let path = Path::new("t.toml");
    let of = |text: &str| {
        let scene = config::examine_text(path, text).unwrap().1;
        differences(&found, &scene.plan, BusIndex(0))
    };
    assert_eq!(
        of(CONFIG),
        [
            "board 12 is configured and was not heard",
            "board 13: modules 3 are configured and were not heard",
            "board 13 sends every 50 ms, the configuration says 30 ms",
            "board 14: modules 0 send and are not configured",
            "board 14 sends every 50 ms, the configuration says 30 ms",
            "board 14 module 8: configured as triangle, but its values are those of fingertip or palm-pad11",
            "arm: the gauge, identifier 3A2, was not heard",
        ]
    );
    let right = CONFIG.replace("= 30", "= 50").replace("1-3", "1-2").replace("8 triangle", "0 fingertip, 8 palm-pad11");
    let right = right.replace("    { address = 12, modules = \"0\" },\n", "").replace("0x3A2", "0x3A1");
    assert_eq!(of(&right), Vec::<String>::new());
    let text = words::text(&found, Some(&[]));
    assert!(text.ends_with("all is as the configuration says\n") && text.contains("sample-point 0.6"), "{text}");
}

/// The plan of an array of which each message has one signal, `T`.
fn plan_of_array(period_ms: u32, messages: &[(&str, u32, u8, &str)], gauge: &str) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let message = |(name, id, bytes, signal): &(&str, u32, u8, &str)| {
        format!("BO_ {id} {name}: {bytes} D\n SG_ T : {signal} (1,0) [0|0] \"\" D\n\n")
    };
    let messages: String = messages.iter().map(message).collect();
    std::fs::write(folder.path().join("a.dbc"), format!("VERSION \"\"\nNS_ :\nBS_:\nBU_: D\n{messages}")).unwrap();
    let text = format!(
        "store.path = \"t.db\"\n[[bus]]\nname = \"c\"\ninterface = \"can0\"\n[[patch]]\nname = \"a\"\nbus = \"c\"\n\
         period_ms = {period_ms}\narea_mm2 = 16.0\narray = {{ dbc = \"a.dbc\", taxels = [\"*\"] }}\n{gauge}\n"
    );
    let path = folder.path().join("t.toml");
    config::examine_text(&path, &text).unwrap().1.plan
}

#[test]
fn a_described_array_is_compared_by_its_frames_and_is_no_board() {
    let mut survey = Survey::default();
    for scan in 0..51_u32 {
        for part in 0..2 {
            let frame = Frame::fd(CanId::Extended(0x18FE_0000 + part), &[scan as u8; 48]).unwrap();
            survey.frame(&TimedFrame { time: Time::from_seconds(100.0 + 0.02 * f64::from(scan)), frame });
        }
    }
    let found = survey.findings();
    assert_eq!(found.others[0].lengths, [48]);
    let message = |name, part: u32| (name, 0x98FE_0000 + part, 48, "0|16@1+");
    let of = |period_ms, messages: &[_]| differences(&found, &plan_of_array(period_ms, messages, ""), BusIndex(0));
    assert_eq!(of(20, &[message("A", 0), message("B", 1)]), Vec::<String>::new());
    assert_eq!(
        of(40, &[message("A", 0), message("B", 1), message("C", 2)]),
        [
            "a: 51.0 frames with identifier 18FE0000 came a second, the configuration says 25.0",
            "a: 51.0 frames with identifier 18FE0001 came a second, the configuration says 25.0",
            "a: frames with identifier 18FE0002 were not heard",
        ]
    );
}

#[test]
fn taxels_that_the_configuration_describes_are_no_candidates_for_the_gauge() {
    let mut survey = Survey::default();
    for scan in 0..100_u16 {
        let value = (100 * scan.min(99 - scan)).to_le_bytes();
        for id in [0x120, 0x200] {
            let frame = Frame::of(CanId::Standard(id), value);
            survey.frame(&TimedFrame { time: Time::from_seconds(0.02 * f64::from(scan)), frame });
        }
    }
    let mut found = survey.findings();
    let gauge = "gauge = { id = 0x200, signal = \"0|16@1+\", unit = \"Pa\" }";
    let plan = plan_of_array(20, &[("A", 0x120, 2, "0|16@1+")], gauge);
    let candidates =
        |found: &Findings| found.others.iter().map(|other| !other.pressures.is_empty()).collect::<Vec<_>>();
    assert_eq!(candidates(&found), [true, true]);
    name_no_gauge_among_taxels(&mut found, &plan, BusIndex(0));
    assert_eq!(candidates(&found), [false, true]);
    assert_eq!(differences(&found, &plan, BusIndex(0)), Vec::<String>::new());
}

#[test]
fn what_was_heard_is_the_beginning_of_a_configuration() {
    let found = surveyed();
    let text = words::beginning(&found, "can3");
    let path = Path::new("t.toml");
    let scene = config::examine_text(path, &text).unwrap().1;
    let plan = &scene.plan.patches[0];
    let boards: Vec<u8> = plan.patch.boards().iter().map(|board| board.address.get()).collect();
    assert_eq!((boards, plan.period.as_millis()), (vec![14, 13], 50));
    assert!(plan.bring_up.is_empty() && plan.gauge.is_some(), "{text}");
    assert_eq!(differences(&found, &scene.plan, BusIndex(0)), Vec::<String>::new(), "{text}");
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
    let found = survey.findings();
    assert_eq!(found.boards.keys().copied().collect::<Vec<_>>(), [13]);
    assert_eq!(found.boards[&13].modules.keys().copied().collect::<Vec<_>>(), [2]);
    let text = words::text(&found, None);
    assert!(
        text.contains("frames like those of board 9 (modules 6), board 13 (modules 1), but no whole scan"),
        "{text}"
    );
    let beginning = words::beginning(&found, "can0");
    assert!(beginning.contains("modules = \"2\"") && !beginning.contains("address = 9"), "{beginning}");
}

#[test]
fn error_frames_are_one_line_whatever_their_counters() {
    let mut survey = Survey::default();
    for (transmit, receive) in [(96, 20), (40, 120)] {
        survey.error(&BusError::Warning(Some(ErrorCounters { transmit, receive })));
    }
    survey.error(&BusError::NoAck);
    let found = survey.findings();
    let text = words::text(&found, None);
    let lines: Vec<&str> = text.lines().filter(|line| line.contains("error")).collect();
    let expected = "error frames: 2 x error-warning: many errors on the bus; 1 x nobody acknowledged a frame: no other node, or \
                    another bit rate; error counters up to 96 sending, 120 receiving";
    assert_eq!(lines, [expected]);
    let json = serde_json::to_value(&found).unwrap();
    assert_eq!(json["errors"]["kinds"]["error-warning: many errors on the bus"], 2);
}

#[test]
fn a_silent_bus_and_any_frame_at_all_are_borne() {
    let nothing = Survey::default().findings();
    assert!(words::text(&nothing, None).contains("no skin board was heard"));
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
    let found = survey.findings();
    assert!(found.others.len() <= 512 && found.notices.len() == 1, "{:?}", found.notices);
    let _ = words::text(&found, None);
}
