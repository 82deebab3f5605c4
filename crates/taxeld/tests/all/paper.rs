//! `taxeld fit --paper` and `taxeld paper` as shipped.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use taxel_model::{Estimator, FitOptions, Samples};

fn taxeld(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_taxeld")).args(arguments).output().unwrap()
}

/// What it printed; it must have succeeded.
fn ran(arguments: &[&str]) -> String {
    let output = taxeld(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What it says when it must fail.
fn fails(arguments: &[&str]) -> String {
    let output = taxeld(arguments);
    assert!(!output.status.success(), "{arguments:?} succeeded");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

const TAXELS: usize = 12;

/// Pressures of a rise with a noisy gauge and a fall, and counts of 8 bits that follow them with noise and dropouts.
fn rows() -> Vec<(f64, Vec<f64>)> {
    let mut seed = 1_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 40) as f64 / f64::from(1_u32 << 24) - 0.5
    };
    let course = (0..700).map(|k| 0.1 * f64::from(k)).chain((0..300).map(|k| 69.0 - 0.23 * f64::from(k)));
    let mut row = |(scan, p): (usize, f64)| {
        let count = |(taxel, noise): (usize, f64)| {
            let gain = 20.0 + 8.0 * taxel as f64;
            let dropout = (scan + 37 * taxel) % 211 == 0;
            if dropout { 255.0 } else { (240.0 - gain * p / (p + 30.0) + 4.0 * noise).round() }
        };
        let noise: Vec<f64> = (0..TAXELS).map(|_| random()).collect();
        let counts = noise.into_iter().enumerate().map(count).collect();
        // As the file has it.
        (format!("{:.4}", p + 0.1 * random()).parse().unwrap(), counts)
    };
    course.enumerate().map(&mut row).collect()
}

fn write(path: &Path, rows: &[(f64, Vec<f64>)]) {
    let names: Vec<String> = (0..TAXELS).map(|taxel| format!("c{taxel}")).collect();
    let mut file = format!("t_s,pressure_kpa,{}\n", names.join(","));
    for (scan, (p, counts)) in rows.iter().enumerate() {
        let counts: Vec<String> = counts.iter().map(ToString::to_string).collect();
        writeln!(file, "{:.2},{p:.4},{}", 0.05 * scan as f64, counts.join(",")).unwrap();
    }
    std::fs::write(path, file).unwrap();
}

/// The coefficients in the file are those of the plain equation over every sample up to the highest pressure, a
/// recording or a short table; that these are exact is tested against rational numbers in taxel-model.
#[test]
fn fit_with_paper_is_the_plain_equation_over_the_rising_samples() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data.csv"), folder.path().join("models.json"));
    for every in [1, 5] {
        let rows: Vec<_> = rows().into_iter().step_by(every).collect();
        write(&data, &rows);
        let said = ran(&["fit", text(&data), "--paper", "--out", text(&out)]);
        assert!(said.contains("order 5, paper") && !said.contains("repaired"), "{said}");
        let models: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&out).unwrap()).unwrap();
        let top = (0..rows.len()).max_by(|&a, &b| rows[a].0.total_cmp(&rows[b].0)).unwrap();
        for taxel in 0..TAXELS {
            let (kpa, counts): (Vec<f64>, Vec<f64>) = rows[..=top].iter().map(|row| (row.0, row.1[taxel])).unzip();
            let options = FitOptions { estimator: Estimator::Paper, ..FitOptions::default() };
            let alone = taxel_model::fit(&Samples::new(&counts, &kpa), &options);
            let stored = &models["taxels"][taxel];
            assert_eq!((&stored["status"], &stored["estimator"]), (&"ok".into(), &"paper".into()), "{taxel}");
            assert_eq!(stored["quality"]["samples"], kpa.len(), "{taxel}: {}", stored["quality"]);
            for (k, expected) in alone.raw_coefficients.iter().enumerate() {
                let served = stored["coefficients"][k].as_f64().unwrap();
                let error = (served - expected).abs();
                // A short table is read to all its decimals, which f64 is not.
                assert!(error <= 1e-9 * expected.abs(), "taxel {taxel}, C^{k}: {served} for {expected}");
            }
        }
    }
    let said = fails(&["fit", text(&data), "--paper", "--plays", "on", "--out", text(&out)]);
    assert!(said.contains("--plays") && said.contains("cannot be used"), "{said}");
}

/// What `fit --paper` refuses, the figures refuse as well.
#[test]
fn a_recording_in_pascals_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("pascal.csv"), folder.path().join("figures"));
    let pascal: Vec<(f64, Vec<f64>)> = rows().into_iter().map(|(kpa, counts)| (1000.0 * kpa, counts)).collect();
    write(&data, &pascal);
    let said = fails(&["paper", text(&data), "--out", text(&out)]);
    assert!(said.contains("pressure_kpa"), "{said}");
    assert!(!out.exists());
}

#[test]
fn a_recording_without_loads_gives_the_other_figures_and_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data.csv"), folder.path().join("out"));
    write(&data, &rows());
    let said = ran(&["paper", text(&data), "--out", text(&out)]);
    assert!(said.contains("measured against true force: a recording has no known loads"), "{said}");
    assert!(said.contains("repeatability of three runs: 1 run"), "{said}");
    for there in ["raw", "mean-curve", "swing", "baseline", "loop", "fit-typical", "fit-weak"] {
        assert!(out.join(format!("{there}.svg")).exists(), "{there}");
    }
    assert!(!out.join("force.svg").exists() && !out.join("repeatability.svg").exists());
    let loads = folder.path().join("loads.csv");
    std::fs::write(&loads, "kilogram,true_n,measured_n\n0.5,4.9,5.2\n").unwrap();
    let said = ran(&["paper", text(&data), "--out", text(&out), "--loads", text(&loads)]);
    assert!(out.join("force.svg").exists() && said.contains("| 0.500 | 4.90 | 1 | 5.20 |"), "{said}");
}

#[test]
fn what_is_no_data_is_refused_with_what_was_expected() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data"), folder.path().join("out"));
    for (content, says) in [
        ("hello", "neither a recording"),
        ("t_s,c0\n0,1\n", "no column `pressure_kpa`"),
        ("(1600000000.000000) can0 4D0#40F0F0\n", "needs --config"),
    ] {
        std::fs::write(&data, content).unwrap();
        let said = fails(&["paper", text(&data), "--out", text(&out)]);
        assert!(said.contains(says), "{content:?}: {said}");
    }
}
