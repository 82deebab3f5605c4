use std::path::Path;

use taxel_engine::plan::PatchPlan;
use taxel_wire::CanId;

use super::super::examine_text;
use super::*;

/// The plan of a patch: `keys` of `[patch.array]` and `patch` of `[[patch]]`, with a DBC file of these messages.
fn plan(keys: &str, patch: &str, messages: &str) -> Result<PatchPlan, String> {
    let folder = tempfile::tempdir().unwrap();
    let dbc = format!("VERSION \"\"\nNS_ :\nBS_:\nBU_: D\n{messages}");
    std::fs::write(folder.path().join("a.dbc"), dbc).unwrap();
    let text = format!(
        "store.path = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n[[patch]]\nname = \"p\"\nbus = \"b\"\n\
         period_ms = 20\narea_mm2 = 16.0\n{patch}\n[patch.array]\ndbc = \"a.dbc\"\n{keys}\n"
    );
    let path = folder.path().join("t.toml");
    let (_, scene) = examine_text(&path, &text).map_err(|e| e.to_string())?;
    Ok(scene.plan.patches[0].clone())
}

/// A message with signals `name: place`.
fn message(id: u32, name: &str, bytes: u8, sender: &str, signals: &[(&str, &str)]) -> String {
    let signal = |(name, place): &(&str, &str)| format!(" SG_ {name} : {place} (1,0) [0|0] \"\" D\n");
    format!("BO_ {id} {name}: {bytes} {sender}\n{}\n", signals.iter().map(signal).collect::<String>())
}

fn shipped(name: &str) -> PatchPlan {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/arrays");
    let path = folder.join(name).with_extension("toml");
    examine_text(&path, &std::fs::read_to_string(&path).unwrap()).unwrap().1.plan.patches[0].clone()
}

#[test]
fn a_grid_gives_positions_areas_and_normals() {
    let plan = shipped("multiplexed");
    assert!(plan.areas.iter().all(|area| (area.0 - 16.0).abs() < 1e-12));
    let geometry = plan.geometry.unwrap();
    assert_eq!((geometry.normals, geometry.remarks.len()), (taxel_skin::NormalsVerdict::Usable, 0));
    let pose = geometry.poses[9].unwrap();
    assert_eq!(pose.position.map(|m| (m * 1e3).round()), [4.0, 4.0, 0.0]);
    assert_eq!(pose.normal, [0.0, 0.0, 1.0]);
    let wrong = GridSection { rows: 7, columns: 8, pitch_mm: 4.0 };
    assert!(grid(wrong, 64).unwrap_err().contains("7 rows of 8 columns for 64 taxels"));
    assert!(grid(GridSection { rows: 8, pitch_mm: 0.0, ..wrong }, 64).unwrap_err().contains("expected 0.1 to 100"));
}

#[test]
fn scans_begin_by_a_frame_or_a_counter() {
    let plan = shipped("can-fd");
    assert_eq!((plan.patch.taxels().len(), plan.patch.modules().len(), plan.devices[0].frames.len()), (256, 16, 8));
    assert_eq!((plan.devices[0].frames[0].bytes_needed(), plan.patch.counts().per_unit()), (64, 256.0));
    let ScanBegin::Frame(sync) = &plan.devices[0].scans else { panic!("{:?}", plan.devices[0].scans) };
    assert_eq!(sync.id, CanId::Standard(0x180));
    let plan = shipped("rising");
    assert!(matches!(plan.devices[0].scans, ScanBegin::Counter(_)) && plan.gauge.is_some());
    assert_eq!(plan.devices[0].frames[7].frames.id, CanId::Extended(0x18FE_0007));
}

#[test]
fn numbers_that_are_signed_or_longer_than_sixteen_bits_become_counts() {
    let field = |signal: &str, numbers: &str| {
        let plan =
            plan(&format!("taxels = [\"*\"]\n{numbers}"), "", &message(1, "A", 8, "D", &[("T", signal)])).unwrap();
        let field = plan.devices[0].frames[0].counts[0].1;
        (field.low, field.shift, field.top)
    };
    assert_eq!(field("0|12@1-", ""), (-2048, 0, 4095));
    assert_eq!(field("0|24@1+", ""), (0, 8, 65_535));
    assert_eq!(field("0|24@1+", "numbers = [8000000, 8020000]"), (8_000_000, 0, 20_000));
}

/// Two pages of one identifier.
fn paged() -> String {
    let signals = [("M M", "0|8@1+"), ("T1 m0", "16|8@1+"), ("T2 m1", "16|8@1+"), ("S", "20|8@1+"), ("C", "24|4@1+")];
    message(1, "A", 8, "D", &[&signals[..], &[("U", "40|8@1+")]].concat())
}

#[test]
fn a_description_by_which_no_scan_is_ever_whole_is_refused() {
    let all = "taxels = [\"A.T*\"]";
    for (keys, expected) in [
        (
            "taxels = [\"A.T*\", \"A.U\"]",
            "signal A.T1 and signal A.U are together in some frames 001 and not in others",
        ),
        ("taxels = [\"A.T*\"]\nsync = \"A.C\"", "array.sync: frames 001 also come in the middle of a scan"),
        ("taxels = [\"A.T*\"]\ncounter = \"A.M\"", "array.counter: bit 0 of frame 001 is also part of what selects"),
        ("taxels = [\"A.T*\"]\ncounter = \"A.S\"", "array.counter: bit 20 of frame 001 is also part of A.T1"),
        ("taxels = [\"A.T*\"]\ncounter = \"A.T1\"", "expected a counter of all taxels"),
        ("taxels = [\"A.T*\"]\ncounter = \"A.C\"\nsync = \"A.T1\"", "expected one"),
    ] {
        let why = plan(keys, "", &paged()).unwrap_err();
        assert!(why.contains(expected), "{why}");
    }
    plan(&format!("{all}\nsync = \"A.T1\""), "", &paged()).unwrap();
    plan(&format!("{all}\ncounter = \"A.C\""), "", &paged()).unwrap();
}

#[test]
fn what_cannot_be_is_refused_with_the_key_and_what_was_expected() {
    let all = "taxels = [\"*.T*\"]";
    let one = |place: &str| message(1, "A", 8, "D", &[("T", place)]);
    for (keys, messages, expected) in [
        (all, one("0|3@1+"), "signal A.T: a taxel of 3 bits, expected 4 to 24"),
        (
            all,
            message(1, "A", 8, "D", &[("T1", "0|12@1+"), ("T2", "8|12@1+")]),
            "bit 8 of frame 001 is also part of A.T1",
        ),
        (
            "taxels = [\"*.T*\"]\nnumbers = [0, 256]",
            one("0|8@1+"),
            "array.numbers = [0, 256]: expected two of 0 to 255",
        ),
        ("taxels = []", one("0|8@1+"), "array.numbers"),
        ("taxels = [\"*.T*\"]\nstatus = \"A.T = x\"", one("0|8@1+"), "expected a number behind ="),
        ("taxels = [\"*.T*\"]\ncommands = [\"12#01\"]", one("0|8@1+"), "expected a frame as candump writes it"),
        ("taxels = [\"*.U*\"]", one("0|8@1+"), "a.dbc: no signal is named `*.U*`"),
    ] {
        let why = plan(keys, "", &messages).unwrap_err();
        assert!(why.contains(expected), "{keys}: {why}");
    }
    let why = plan(all, "geometry = \"a\"", &one("0|8@1+")).unwrap_err();
    assert!(why.contains("an array has a grid and no position file"), "{why}");
    let why = plan(all, "gauge = { signal = \"A.T\" }", &one("0|8@1+")).unwrap_err();
    assert!(why.contains("gauge.unit is missing: expected one of Pa"), "{why}");
    let why = plan("taxels = [\"A.T*\"]", "gauge = { signal = \"A.T1\", unit = \"Pa\" }", &paged()).unwrap_err();
    assert!(why.contains("signal A.T1: it is multiplexed"), "{why}");
}

#[test]
fn each_sender_is_a_device_of_its_own() {
    let messages =
        message(1, "A", 8, "D", &[("T", "0|8@1+")]) + &message(2, "B", 8, "E", &[("T", "0|8@1+"), ("S", "8|8@1+")]);
    let keys = "taxels = [\"A.T\", \"B.T\"]\nstatus = \"B.S = 1\"\ncommands = [\"(0.030) 005#01fF\", \"18FF0010#\"]";
    let plan = self::plan(keys, "", &messages).unwrap();
    assert_eq!((plan.patch.boards().len(), plan.patch.counts()), (2, CountRange::BYTE));
    let after = Duration::from_millis(30);
    let frames = [
        (after, Frame::of(CanId::Standard(5), [1, 255])),
        (Duration::ZERO, Frame::data(CanId::Extended(0x18FF_0010), &[]).unwrap()),
    ];
    assert!(plan.devices.iter().all(|device| device.commands == frames));
    assert_eq!(plan.devices[1].status.as_ref().unwrap().1, 1);
    assert!(plan.configures());
    let listening = self::plan(keys, "listen_only = true", &messages).unwrap();
    assert_eq!(listening.devices[1].commands, frames, "somebody else sends them");
    assert!(!listening.configures());
    let again = messages + &message(3, "C", 8, "D", &[("T", "0|8@1+")]);
    let why = self::plan("taxels = [\"*.T\"]", "", &again).unwrap_err();
    assert!(why.contains("C.T: taxels of D are before it and others between"), "{why}");
}
