//! The first scans of a real recording, from text to module scans and pressure.

use crate::candump::parse_line;
use crate::icub::{self, Message, Pairer, StatusWord};
use crate::signal::{ByteOrder, PressureMeaning, PressureUnit, SignalSpec};
use crate::{CanId, Frame};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::time::Duration;
use taxel_skin::{Kilopascal, Time};

const LOG: &str = "insole/left_calibration_16hz.candump.gz";
const SCANS: usize = 10;
const MODULES: usize = 28;
const LINES_PER_SCAN: usize = 1 + 2 * MODULES;
const PRESSURE: SignalSpec = SignalSpec {
    id: CanId::Standard(0x3A1),
    start_bit: 0,
    length_bits: 32,
    byte_order: ByteOrder::Little,
    signed: true,
    scale: 1.0,
    offset: 0.0,
    unit: PressureUnit::Pascal,
    meaning: PressureMeaning::Differential,
};

/// The log's first frames, or `None` where the data are absent.
fn first_frames(count: usize) -> Option<Vec<(Time, Frame)>> {
    let data = std::env::var_os("TAXELD_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")), PathBuf::from);
    let path = data.join(LOG);
    let file = match File::open(&path) {
        Ok(file) => file,
        Err(error) => {
            eprintln!("SKIPPED: cannot open {}: {error}; set TAXELD_DATA to the data folder", path.display());
            return None;
        }
    };
    let lines = BufReader::new(flate2::read::GzDecoder::new(file)).split(b'\n').take(count);
    let frames = lines.map(|line| {
        let line = line.unwrap();
        let parsed = parse_line(&line).unwrap();
        assert_eq!(parsed.interface, "can0");
        (parsed.time, parsed.frame)
    });
    Some(frames.collect())
}

#[test]
fn the_insole_log_is_whole_scans_of_28_modules() {
    let Some(frames) = first_frames(SCANS * LINES_PER_SCAN) else { return };
    let mut pairers: BTreeMap<_, Pairer> = BTreeMap::new();
    let mut scans = Vec::new();
    let mut pressures = Vec::new();
    for (time, frame) in frames {
        let message = match PRESSURE.decode(&frame) {
            Ok(pressure) => {
                // Its class is that of legacy skin; as skin it must be refused, not taken for module 1 of board 10.
                assert!(matches!(icub::decode(&frame), Err(icub::Refusal::Length { .. })));
                pressures.push(pressure);
                continue;
            }
            Err(_) => icub::decode(&frame).unwrap(),
        };
        assert_eq!(message.encode(), frame);
        match message {
            Message::Head { board, module, values } => {
                let pairer = pairers.entry((board, module)).or_insert_with(|| Pairer::new(Duration::from_millis(50)));
                pairer.head(time, values);
            }
            Message::Tail { board, module, values, status } => {
                let pairer = pairers.get_mut(&(board, module)).unwrap();
                scans.push((board.get(), module.get(), pairer.tail(time, values, status).unwrap()));
            }
            other => panic!("the log has skin only, not {other:?}"),
        }
    }
    assert_eq!(pressures.len(), SCANS);
    assert_eq!(pressures[0], Kilopascal(5.839));
    assert_eq!(pairers.len(), MODULES);
    assert!(pairers.values().all(|pairer| pairer.orphans() == icub::Orphans::default()));
    assert_eq!(scans.len(), SCANS * MODULES);

    let (board, module, first) = scans[0];
    assert_eq!((board, module), (13, 0));
    assert_eq!(first.time, Time::from_nanos(1_600_000_001_290_741_000));
    assert_eq!(first.values, [0xF1, 0xF0, 0xF0, 0xF2, 0xF1, 0xF0, 0xF0, 0xF1, 0xF2, 0xF1, 0xF0, 0xF1]);
    assert_eq!(first.status, StatusWord(0));
    assert_eq!((scans[16].0, scans[16].1), (12, 0));
    assert!(scans.iter().all(|(_, _, scan)| scan.values[6] == 240 && scan.values[10] == 240), "thermal pads");
}
