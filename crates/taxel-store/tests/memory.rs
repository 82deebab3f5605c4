//! What reading a MODELS.json may cost, whatever it says: measured from outside, in a process of its own for each text.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test's helpers fail as the test does

use std::env;
use std::fs;
use std::process::Command;

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::model_set::ModelSet;
use taxel_model::{Accumulator, FitOptions, FixedPressure};
use taxel_store::models_json::{content_id, from_json, to_json};

/// The largest text that the service takes.
const TEXT_BYTES: usize = 16 << 20;

/// Most memory of a process that reads such a text, the text itself included, and of nothing else: five times the text.
const PEAK_BYTES_MAX: usize = 80 << 20;

/// Names the text that a child process reads.
const CASE: &str = "TAXEL_STORE_MEMORY_CASE";

/// A text of [`TEXT_BYTES`], of `head`, `entry` as often as it fits, separated by commas, and `tail`.
fn filled(head: &str, entry: &str, tail: &str) -> String {
    let mut text = String::with_capacity(TEXT_BYTES);
    text += head;
    while text.len() + entry.len() + tail.len() < TEXT_BYTES {
        text += entry;
        text.push(',');
    }
    text.pop();
    text + tail
}

/// A good set of `taxels` taxels as text.
fn good(taxels: usize) -> String {
    let mut sums = Accumulator::new();
    for k in 0..700 {
        let kpa = f64::from(k) / 10.0;
        sums.add((240.0 - 80.0 * kpa / (kpa + 40.0)).round() as u8, FixedPressure::from_kpa(kpa), 0);
    }
    let mut set = ModelSet {
        id: String::new(),
        patch: "left_forearm".to_owned(),
        created_wall_ns: 1,
        session: None,
        method: "order 5".to_owned(),
        board_settings: Vec::new(),
        baseline: vec![TaxelBaseline { mean: 240.0, noise: 0.7 }; taxels],
        pressure_max_kpa: 69.9,
        gauge_gain_rel: 0.0,
        gauge_offset_kpa: 0.0,
        taxels: vec![sums.fit(&FitOptions::default()); taxels],
        recorded: None,
        recalibrated: None,
        maker: taxel_engine::model_set::Maker::default(),
    };
    set.id = content_id(&set);
    to_json(&set).unwrap()
}

/// The text of this name, and what reading it says; nothing if it is a good set.
fn case(name: &str) -> (String, &'static str) {
    const KIND: &str = r#"{"format":"taxeld-models","version":1,"#;
    let head = |fields: &str| format!("{KIND}{fields}");
    let letters = "x".repeat(TEXT_BYTES - 100);
    let one = good(1);
    let around = |field: &str| {
        let (before, after) = one.split_once(field).unwrap();
        (format!("{before}{field}"), after.to_owned())
    };
    let without_id = |text: &str| {
        let (before, after) = text.split_once(r#""id":"#).unwrap();
        format!("{before}{}", after.split_once(',').unwrap().1)
    };
    match name {
        "a good set" => (good(TEXT_BYTES / 20 * 19 / (good(2).len() - good(1).len())), ""),
        "a method without end" => (head(&format!(r#""method":"{letters}"}}"#)), "line 1: the bytes of a string"),
        "a key without end" => (head(&format!(r#""{letters}":1}}"#)), "line 1: the bytes of a string"),
        "escapes without end" => (head(&format!(r#""method":"{}"}}"#, r"\u0000".repeat(2 << 20))), "bytes of a string"),
        "numbers" => (filled(&head(r#""taxels":["#), "0", "]}"), "line 1: the values so far are more than"),
        "nothing but nulls" => (filled(&head(r#""baseline":["#), "null       ", "]}"), "more than 65535 entries"),
        "lists in lists" => (head(&format!(r#""x":{}"#, "[".repeat(TEXT_BYTES - 100))), "within each other"),
        "board settings" => {
            (filled(&head(r#""board_settings":["#), &format!("{:?}", "x".repeat(1000)), "]}"), "more than 256 entries")
        }
        "a curve of many terms" => {
            let (before, after) = around(r#""chebyshev":["#);
            (filled(&before, "1.000000000", &format!(",{after}")), "more than 11 entries")
        }
        "a profile of many knots" => {
            let (before, after) = around(r#""sigma_kpa":["#);
            (filled(&before, "1.000000000", &format!(",{after}")), "more than 1025 entries")
        }
        "flags" => {
            let (before, after) = around(r#""flags":["#);
            (filled(&before, r#"{"Dropouts":{"samples":1}}"#, &after), "more than 64 entries")
        }
        "as many taxels as fit" => {
            let entry = r#"{"taxel":0,"status":"no_data","order":0,"coefficients":null,"range":null,"sign":"rising","curve":null,"sigma":null,"estimator":"paper","repaired":false,"gauge":{"gain_rel":0,"offset_kpa":0,"noise_kpa":0},"quality":{"samples":0,"distinct_counts":0,"swing_counts":0,"rank":0,"dof":0,"rmse_kpa":0,"pure_error_kpa":null,"press_kpa":null,"press_by_order":[],"max_leverage":0,"lack_of_fit_f":null,"repeatability_kpa":null,"interval_kpa":null,"interval_share":null},"flags":[]}"#;
            let text = without_id(&one);
            let (before, _) = text.split_once(r#""taxels":["#).unwrap();
            (filled(&format!(r#"{before}"taxels":["#), entry, "]}"), "taxel 1: its entry says `taxel` 0, expected 1")
        }
        other => panic!("there is no case `{other}`"),
    }
}

const CASES: [&str; 12] = [
    "a good set",
    "a method without end",
    "a key without end",
    "escapes without end",
    "numbers",
    "nothing but nulls",
    "lists in lists",
    "board settings",
    "a curve of many terms",
    "a profile of many knots",
    "flags",
    "as many taxels as fit",
];

/// What a child process does: reads the text from a file and nothing else.
#[test]
fn a_child_process_reads_the_text_of_its_case() {
    let Some(path) = env::var_os(CASE) else { return };
    let text = fs::read_to_string(path).unwrap();
    match from_json(&text) {
        Ok(set) => println!("read {} taxels", set.taxels.len()),
        Err(error) => println!("refused: {error}"),
    }
    println!("{}", fs::read_to_string("/proc/self/status").unwrap());
}

#[test]
fn no_text_of_the_largest_size_takes_more_than_five_times_its_size() {
    let dir = tempfile::tempdir().unwrap();
    for name in CASES {
        let (text, refused) = case(name);
        assert!(text.len() <= TEXT_BYTES && text.len() > TEXT_BYTES / 2, "{name}: {} bytes", text.len());
        let path = dir.path().join("models.json");
        fs::write(&path, text).unwrap();
        let child = Command::new(env::current_exe().unwrap())
            .args(["--exact", "a_child_process_reads_the_text_of_its_case", "--nocapture"])
            .env(CASE, &path)
            .output()
            .unwrap();
        let said = String::from_utf8(child.stdout).unwrap();
        let expected = if refused.is_empty() { "read " } else { refused };
        let line =
            said.lines().find(|line| line.starts_with("read ") || line.starts_with("refused: ")).unwrap_or(&said);
        assert!(line.contains(expected) && line.len() < 600, "{name}: {line}, expected {expected}");
        let peak = said.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")).unwrap();
        let peak_bytes = peak.parse::<usize>().unwrap() << 10;
        println!("{name}: {} MB", peak_bytes / 1_000_000);
        assert!(peak_bytes <= PEAK_BYTES_MAX, "{name}: {peak_bytes} bytes");
    }
}
