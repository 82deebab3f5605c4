use std::path::Path;

use super::*;
use crate::config::resolve::resolve;
use proptest::prelude::*;
use taxel_engine::intake::cells::Device;
use taxel_skin::Time;
use taxel_wire::TimedFrame;

const HEAD: &str = "store.path = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n[[patch]]\nname = \"p\"\nbus = \"b\"\nperiod_ms = 20\n";

/// The plan of a patch with these sections.
fn plan(sections: &str) -> Result<taxel_engine::plan::PatchPlan, String> {
    let path = Path::new("t.toml");
    let area = if sections.contains("rows") { "" } else { "area_mm2 = 16.0\n" };
    let config = crate::config::load::parse(path, &format!("{HEAD}{area}{sections}")).map_err(|e| e.to_string())?;
    let scene = resolve(&config, path).map_err(|e| e.to_string())?;
    Ok(scene.plan.patches[0].clone())
}

/// 64 taxels of 12 bits: sixteen multiplexed frames of four.
const MULTIPLEXED: &str = "
[patch.array]
rows = 8
columns = 8
pitch_mm = 4.0
[[patch.signals]]
id = 0x120
start_bit = 4
length_bits = 12
count = 4
mux = [{ length_bits = 4, value = 0 }]
frames = 16
mux_step = 1
";

#[test]
fn an_array_by_repetition_is_a_device_with_modules_of_whole_rows() {
    let plan = plan(MULTIPLEXED).unwrap();
    let (patch, device) = (&plan.patch, &plan.devices[0]);
    assert_eq!((patch.taxels().len(), patch.boards().len(), patch.modules().len()), (64, 1, 4));
    assert_eq!((patch.counts().top(), patch.counts().per_unit()), (4095, 16.0));
    assert_eq!(device.frames.len(), 16);
    let last = &device.frames[15];
    assert_eq!(last.counts.iter().map(|(taxel, _)| *taxel).collect::<Vec<_>>(), [60, 61, 62, 63]);
    let frame = Frame::of(CanId::Standard(0x120), [0x0F, 0, 0x23, 0xF1, 0xFF, 0, 0, 0]);
    let mut counts = Vec::new();
    last.read(&frame, |taxel, count| counts.push((taxel, count))).unwrap();
    assert!(last.frames.is(&frame) && !device.frames[14].frames.is(&frame));
    assert_eq!(counts, [(60, 0), (61, 0x123), (62, 0xFFF), (63, 0)]);
}

#[test]
fn a_grid_gives_positions_areas_and_normals() {
    let plan = plan(MULTIPLEXED).unwrap();
    assert!(plan.areas.iter().all(|area| (area.0 - 16.0).abs() < 1e-12));
    let geometry = plan.geometry.unwrap();
    assert_eq!((geometry.normals, geometry.remarks.len()), (NormalsVerdict::Usable, 0));
    let pose = geometry.poses[9].unwrap();
    assert_eq!(pose.position.map(|m| (m * 1e3).round()), [4.0, 4.0, 0.0]);
    assert_eq!(pose.normal, [0.0, 0.0, 1.0]);
    let wrong = MULTIPLEXED.replace("rows = 8", "rows = 7");
    let why = self::plan(&wrong).unwrap_err();
    assert!(why.contains("7 rows of 8 columns for 64 taxels"), "{why}");
}

#[test]
fn an_array_over_can_fd_fills_its_frames() {
    let plan = plan(
        "[[patch.signals]]\nid = 0x18FE0000\nextended = true\nlength_bits = 16\ncount = 32\nframes = 8\nid_step = 1\n",
    );
    let plan = plan.unwrap();
    assert_eq!((plan.patch.taxels().len(), plan.patch.modules().len(), plan.devices[0].frames.len()), (256, 16, 8));
    assert_eq!(plan.devices[0].frames[7].frames.id, CanId::Extended(0x18FE_0007));
    assert_eq!((plan.devices[0].frames[0].bytes_needed(), plan.patch.counts().per_unit()), (64, 256.0));
}

#[test]
fn numbers_that_are_signed_or_longer_than_sixteen_bits_become_counts() {
    let signed = plan("[[patch.signals]]\nid = 1\nlength_bits = 12\nsigned = true\n").unwrap();
    let field = signed.devices[0].frames[0].counts[0].1;
    assert_eq!((field.low, field.shift, field.top), (-2048, 0, 4095));
    let long = plan("[[patch.signals]]\nid = 1\nlength_bits = 24\n").unwrap();
    let field = long.devices[0].frames[0].counts[0].1;
    assert_eq!((field.low, field.shift, field.top), (0, 8, 65_535));
    let part =
        plan("[patch.array]\nnumbers = [8000000, 8020000]\n[[patch.signals]]\nid = 1\nlength_bits = 24\n").unwrap();
    let field = part.devices[0].frames[0].counts[0].1;
    assert_eq!((field.low, field.shift, field.top), (8_000_000, 0, 20_000));
}

#[test]
fn what_cannot_be_is_refused_with_the_key_and_what_was_expected() {
    let signals = |keys: &str| plan(&format!("[[patch.signals]]\n{keys}\n")).unwrap_err();
    for (keys, expected) in [
        ("id = 0x800\nlength_bits = 12", "id 0x800 has more than 11 bits: set extended = true"),
        ("id = 0x20000000\nextended = true\nlength_bits = 12", "has more than 29 bits"),
        ("id = 1\nlength_bits = 3", "length_bits = 3: expected 4 to 24"),
        ("id = 1\nlength_bits = 12\ncount = 43", "taxel 42 of the frame: 12 bits from start bit 504"),
        ("id = 1\nlength_bits = 12\ncount = 2\nstride_bits = 8", "bit 8 of frame 001 is also part of signals 1"),
        (
            "id = 1\nlength_bits = 12\nmux = [{ length_bits = 4, value = 3 }]",
            "bit 0 of frame 001 is also part of what selects the frame",
        ),
        (
            "id = 1\nlength_bits = 12\nstart_bit = 4\nmux = [{ length_bits = 4, value = 16 }]",
            "mux: value 16 does not fit",
        ),
        ("id = 1\nlength_bits = 12\ndevice = 16", "device = 16: expected 1 to 15"),
    ] {
        let why = signals(keys);
        assert!(why.contains(expected), "{keys}: {why}");
    }
    let why = plan("[patch.array]\nscan = \"counter\"\n[[patch.signals]]\nid = 1\nlength_bits = 8\n").unwrap_err();
    assert!(why.contains("array.scan = \"counter\" needs array.counter"), "{why}");
    let why = plan("").unwrap_err();
    assert!(why.contains("expected [[patch.board]], [[patch.signals]] or [patch.push]"), "{why}");
}

/// Two pages of one identifier, with a taxel in both.
const SHARED: &str = "[[patch.signals]]\nid = 1\nstart_bit = 8\nlength_bits = 8\n\
                      [[patch.signals]]\nid = 1\nstart_bit = 16\nlength_bits = 8\nmux = [{ length_bits = 8, value = 0 }]\nframes = 2\nmux_step = 1\n";

#[test]
fn a_taxel_that_is_in_every_page_is_read_from_each_of_them() {
    let plan = plan(SHARED).unwrap();
    let taxels = |n: usize| plan.devices[0].frames[n].counts.iter().map(|(taxel, _)| *taxel).collect::<Vec<_>>();
    assert_eq!((plan.devices[0].frames.len(), taxels(0), taxels(1)), (2, vec![0, 1], vec![0, 2]));
    let mut device = Device::new(&plan.patch, 0, plan.devices[0].clone(), plan.period);
    for scan in 0..3_u8 {
        let complete = [[0, 10 + scan, 1], [1, 20 + scan, 2]].map(|bytes| {
            let time = Time::from_seconds(0.02 * f64::from(scan) + 1e-4 * f64::from(bytes[0]));
            let brought = device.on_frame(&TimedFrame { time, frame: Frame::of(CanId::Standard(1), bytes) });
            brought.unwrap().unwrap().modules
        });
        assert_eq!((complete, device.counts(0)), ([vec![], vec![0]], [20 + u16::from(scan), 1, 2].as_slice()));
    }
}

#[test]
fn a_description_by_which_no_scan_is_ever_whole_is_refused() {
    let array = |keys: &str| format!("[patch.array]\n{keys}\n{SHARED}");
    let also = |runs: &str| SHARED.replace("value = 0 }", &format!("value = 0, also = {runs} }}"));
    let counter = "scan = \"counter\"\ncounter = { start_bit = ";
    for (text, expected) in [
        (also("[[5, 5]]"), "signals 2 and signals 2 are together in some frames 001 and not in others"),
        (
            SHARED.replace("value = 0 }", "value = 0 }, { length_bits = 8, value = 7 }"),
            "mux: no number of bit 0 selects the frame",
        ),
        (also("[[5, 3]]"), "mux: no number is from 5 to 3"),
        (array("scan = \"frame\"\nsync = { id = 1 }"), "array.sync: frames 001 also come in the middle of a scan"),
        (
            array(&format!("{counter}0, length_bits = 4 }}")),
            "array.counter: bit 0 of frame 001 is also part of what selects",
        ),
        (
            array(&format!("{counter}20, length_bits = 8 }}")),
            "array.counter: bit 20 of frame 001 is also part of signals 2",
        ),
    ] {
        let why = plan(&text).unwrap_err();
        assert!(why.contains(expected), "{why}");
    }
    for keys in [
        "scan = \"frame\"\nsync = { id = 1, mux = [{ length_bits = 8, value = 0 }] }",
        &format!("{counter}24, length_bits = 8 }}"),
    ] {
        plan(&array(keys)).unwrap();
    }
}

#[test]
fn a_slow_array_has_the_time_that_its_period_takes() {
    let at = |ms: &str| {
        let path = Path::new("t.toml");
        let text = format!("{}area_mm2 = 16.0\n[[patch.signals]]\nid = 1\nlength_bits = 8\n", HEAD.replace("= 20", ms));
        resolve(&crate::config::load::parse(path, &text).unwrap(), path).map(|scene| scene.plan.patches[0].clone())
    };
    let plan = at("= 5000").unwrap();
    let limits = [plan.live.stale_after, plan.live.power_cycle_after, plan.tare.duration];
    assert_eq!(limits.map(|limit| limit.as_secs()), [15, 15, 50], "three periods, and ten scans for a zero");
    assert_eq!(plan.intake().faults.stale_after_s, 25.0, "as of the slowest board, by its period");
    assert!(at("= 5001").unwrap_err().to_string().contains("period_ms = 5001: expected 1 to 5000"));
}

#[test]
fn devices_are_boards_of_their_own_with_commands_of_their_own() {
    let text = "[patch.array]\nscan = \"frame\"\nsync = { id = 9 }\ncommand = [{ id = 5, data = \"01 ff\", after_ms = 30, device = 2 }]\n\
                [[patch.signals]]\nid = 1\nlength_bits = 8\ncount = 8\n[[patch.signals]]\nid = 2\nlength_bits = 8\ncount = 8\ndevice = 2\n";
    let plan = plan(text).unwrap();
    assert_eq!((plan.patch.boards().len(), plan.patch.counts()), (2, CountRange::BYTE));
    assert_eq!(plan.devices[0].commands, []);
    let command = Frame::of(CanId::Standard(5), [1, 255]);
    assert_eq!(plan.devices[1].commands, [(Duration::from_millis(30), command)]);
    assert!(plan.configures());
    let listening = self::plan(&format!("listen_only = true\n{text}")).unwrap();
    assert_eq!(listening.devices[1].commands, [(Duration::from_millis(30), command)], "somebody else sends them");
    assert!(!listening.configures());
}

proptest! {
    #[test]
    fn no_description_panics(
        id: u32, extended: bool, start: u16, length in 0..40_u16, count: u16, frames: u16, stride: u16, step: u32, big: bool,
    ) {
        let order = if big { "big" } else { "little" };
        let text = format!(
            "[[patch.signals]]\nid = {id}\nextended = {extended}\nstart_bit = {start}\nlength_bits = {length}\ncount = {count}\n\
             frames = {frames}\nstride_bits = {stride}\nid_step = {step}\nbyte_order = \"{order}\"\n"
        );
        let _ = plan(&text);
    }
}

const PUSHED: &str = "
[patch.push]
taxels = 64
count_max = 4095
pressure = true
[patch.array]
rows = 8
columns = 8
pitch_mm = 4.0
";

/// The same on a bus without frames.
fn pushed_plan(sections: &str) -> Result<taxel_engine::plan::PatchPlan, String> {
    let path = Path::new("t.toml");
    let head = HEAD.replace("interface = \"can0\"", "source = \"push\"\n[[bus]]\nname = \"c\"\ninterface = \"can0\"");
    let config = crate::config::load::parse(path, &format!("{head}{sections}")).map_err(|e| e.to_string())?;
    let scene = resolve(&config, path).map_err(|e| e.to_string())?;
    Ok(scene.plan.patches[0].clone())
}

#[test]
fn without_a_grid_the_area_of_a_taxel_must_be_said() {
    let of = |sections: &str| {
        let path = Path::new("t.toml");
        let text = format!("{HEAD}{sections}");
        resolve(&crate::config::load::parse(path, &text).unwrap(), path).map_err(|e| e.to_string())
    };
    assert!(of(MULTIPLEXED).is_ok());
    let without = MULTIPLEXED.split("[[patch.signals]]").nth(1).unwrap();
    let why = of(&format!("[[patch.signals]]{without}")).unwrap_err();
    assert!(why.contains("patch `p`: area_mm2: expected, or a grid"), "{why}");
}

#[test]
fn a_pushed_patch_has_modules_a_grid_and_no_frames() {
    let plan = pushed_plan(PUSHED).unwrap();
    assert_eq!((plan.patch.taxels().len(), plan.patch.modules().len(), plan.patch.counts().top()), (64, 4, 4095));
    assert_eq!((plan.devices.len(), plan.devices[0].ids().count()), (1, 0));
    assert!(plan.has_gauge() && plan.gauge.is_none() && !plan.configures() && plan.geometry.is_some());
    let without = pushed_plan(&PUSHED.replace("pressure = true", "")).unwrap();
    assert!(!without.has_gauge());
    let stated = "pressure = true\npressure_gain_uncertainty = 0.01\npressure_offset_uncertainty_kpa = 0.2\npressure_noise_kpa = 0.03";
    let stated = pushed_plan(&PUSHED.replace("pressure = true", stated)).unwrap().fit.gauge;
    assert_eq!([stated.gain_rel, stated.offset_kpa, stated.noise_kpa], [0.01, 0.2, 0.03]);
    let gauge = "[patch.gauge]\nbus = \"c\"\nid = 0x200\nlength_bits = 32\nunit = \"Pa\"\n";
    assert!(pushed_plan(&format!("{}{gauge}", PUSHED.replace("pressure = true", ""))).unwrap().gauge.is_some());
}

#[test]
fn what_cannot_be_pushed_is_refused_with_key_and_value() {
    let gauge = "[patch.gauge]\nid = 0x200\nlength_bits = 32\nunit = \"Pa\"\n";
    for (sections, says) in [
        (PUSHED.replace("taxels = 64", "taxels = 0"), "push.taxels = 0: expected 1 to 4080"),
        (PUSHED.replace("taxels = 64", "taxels = 5000"), "push.taxels = 5000: expected 1 to 4080"),
        (PUSHED.replace("taxels = 64", "taxels = 63"), "8 rows of 8 columns for 63 taxels"),
        (PUSHED.replace("4095", "0"), "push.count_max = 0"),
        (
            PUSHED.replace("= true", "= true\npressure_noise_kpa = -1"),
            "push.pressure_noise_kpa = -1: expected 0 to 100",
        ),
        (
            PUSHED.replace("= true", "= false\npressure_noise_kpa = 1"),
            "pressure_noise_kpa is stated, but push.pressure",
        ),
        (format!("{PUSHED}scan = \"counter\"\n"), "and no other key"),
        (format!("{PUSHED}[[patch.board]]\naddress = 1\nmodules = \"0\"\n"), "expected it alone"),
        (format!("{PUSHED}{gauge}"), "gauge.bus: a gauge sends over a CAN bus"),
        (format!("{PUSHED}{gauge}bus = \"c\"\n"), "push.pressure and [patch.gauge] are both there"),
        ("[[patch.board]]\naddress = 1\nmodules = \"0\"\n".to_owned(), "expected [patch.push]"),
        (format!("{PUSHED}[[patch]]\nname = \"q\"\nbus = \"b\"\n{PUSHED}"), "expected one patch on it"),
    ] {
        let why = pushed_plan(&sections).unwrap_err();
        assert!(why.contains(says), "{sections}\n{why}");
    }
    let why = plan(PUSHED).unwrap_err();
    assert!(why.contains("[patch.push] needs a bus with source = \"push\", and `b` has none"), "{why}");
}
