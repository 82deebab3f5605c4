use super::*;
use taxel_skin::ModuleKind;
use taxel_wire::array::CountField;
use taxel_wire::bits::{ByteOrder, Selector};

const PERIOD: Duration = Duration::from_millis(20);

fn field(start_bit: u16, length_bits: u16) -> BitField {
    BitField::new(start_bit, length_bits, ByteOrder::Little, false).unwrap()
}

/// Four frames of one identifier, told apart by their first byte, with two taxels of 16 bits each; two modules of four.
/// Byte 5 is a counter, byte 6 a status.
fn device(scans: ScanBegin) -> Device {
    let count = |start| CountField { field: field(start, 16), low: 0, shift: 0, top: u16::MAX };
    let frame = |kind: i128| FrameSpec {
        frames: FrameMatch { id: ID, selectors: vec![Selector { field: field(0, 8), values: vec![(kind, kind)] }] },
        counts: (0..2).map(|n| (2 * kind as u16 + n, count(8 + 16 * n))).collect(),
    };
    let plan = DevicePlan {
        frames: (0..4).map(frame).collect(),
        scans,
        status: Some((DeviceSignal { frames: any_frame(), field: field(48, 8) }, 0)),
        commands: vec![],
        sender: Sender::Patch,
    };
    Device::new(&crate::tests::patch(&[ModuleKind::Cells(4); 2]), 0, plan, PERIOD)
}

const ID: CanId = CanId::Extended(0x18_0000);

fn any_frame() -> FrameMatch {
    FrameMatch { id: ID, selectors: vec![] }
}

/// Frame `kind` of scan `scan`, whose counts are all the scan's number.
fn frame(ms: f64, kind: u8, scan: u8) -> TimedFrame {
    let bytes = [kind, scan, 0, scan, 0, scan, 0];
    TimedFrame { time: Time::from_nanos((ms * 1e6) as i64), frame: Frame::of(ID, bytes) }
}

fn complete(device: &mut Device, frame: TimedFrame) -> Vec<usize> {
    device.on_frame(&frame).unwrap().unwrap().modules
}

/// Whichever frame is lost, and however the scans are told apart, no module has counts of two scans.
#[test]
fn a_lost_frame_never_makes_a_module_of_two_scans() {
    let begins = [
        ScanBegin::Time,
        ScanBegin::Frame(FrameMatch { id: ID, selectors: vec![Selector { field: field(0, 8), values: vec![(0, 0)] }] }),
        ScanBegin::Counter(field(40, 8)),
    ];
    for begin in begins {
        for lost in 0..40 {
            let (mut device, mut seen) = (device(begin.clone()), 0);
            for n in (0..40_u8).filter(|n| *n != lost) {
                let (scan, kind) = (n / 4, n % 4);
                let at = 20.0 * f64::from(scan) + 2.0 * f64::from(kind);
                for module in complete(&mut device, frame(at, kind, scan)) {
                    assert_eq!(device.counts(module), [u16::from(scan); 4], "{begin:?}, {lost} was lost");
                    seen += 1;
                }
            }
            let least = if matches!(begin, ScanBegin::Frame(_)) && lost % 4 == 0 { 18 } else { 19 };
            assert!(seen >= least, "{begin:?}, {lost} was lost: {seen} modules");
        }
    }
}

/// A gateway that sends the last frames once more makes no scan of them, where the scans are numbered.
#[test]
fn frames_that_come_again_with_the_number_of_their_scan_are_no_scan() {
    let mut device = device(ScanBegin::Counter(field(40, 8)));
    for kind in 0..4 {
        complete(&mut device, frame(f64::from(kind), kind, 7));
    }
    for again in 1..50 {
        for kind in 0..4 {
            let at = 20.0 * f64::from(again) + f64::from(kind);
            assert_eq!(complete(&mut device, frame(at, kind, 7)), [0_usize; 0], "{again}");
        }
    }
    assert_eq!(device.orphans(), 49 * 4);
    let modules: Vec<usize> = (0..4).flat_map(|kind| complete(&mut device, frame(1_000.0, kind, 8))).collect();
    assert_eq!(modules, [0, 1]);
}

#[test]
fn a_frame_that_is_too_short_is_refused_and_changes_nothing() {
    let mut device = device(ScanBegin::Time);
    let short = TimedFrame { time: Time::default(), frame: Frame::of(ID, [0, 9, 9]) };
    let refused = device.on_frame(&short).unwrap_err();
    assert_eq!(refused.to_string(), "frame 00180000 has 3 bytes, expected at least 5");
    assert_eq!(device.counts(0), [0; 4]);
    let other = TimedFrame { frame: Frame::of(CanId::Standard(1), []), ..short };
    assert_eq!(device.on_frame(&other), Ok(None));
}

#[test]
fn a_status_that_is_not_the_good_one_is_told_until_it_is_good_again() {
    let mut device = device(ScanBegin::Time);
    let mut bad = frame(0.0, 0, 1);
    bad.frame = Frame::of(ID, [0, 1, 0, 1, 0, 0, 7]);
    complete(&mut device, bad);
    assert!(!device.is_well());
    complete(&mut device, frame(20.0, 0, 2));
    assert!(device.is_well());
}
