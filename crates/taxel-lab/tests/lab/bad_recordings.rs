//! `taxel-lab fit` on recordings with cells, times or pressures that cannot be right: told with their place, and refused where
//! no sound answer exists.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use crate::{fails, lab, number, text};

/// What the summary of a fit says of its curves.
const RMSE: &str = "RMSE of the static fit: median ";

const ROWS: usize = 600;

/// A recording as numbers: three falling taxels of 8 bits, 50 scans a second, up to 70 kPa and back.
#[derive(Clone)]
struct Table {
    time_s: Vec<f64>,
    kpa: Vec<f64>,
    counts: [Vec<f64>; 3],
}

impl Table {
    fn new() -> Self {
        let share = |i: usize| 1.0 - (2.0 * i as f64 / (ROWS - 1) as f64 - 1.0).abs();
        let kpa: Vec<f64> = (0..ROWS).map(|i| 70.0 * share(i)).collect();
        let dither = |i: usize, taxel: usize| ((i * 7919 + taxel * 104_729) % 17) as f64 / 17.0 - 0.5;
        let column =
            |taxel: usize| (0..ROWS).map(|i| (240.0 - 1.5 * kpa[i] + 2.0 * dither(i, taxel)).round()).collect();
        let counts = [column(0), column(1), column(2)];
        Self { time_s: (0..ROWS).map(|i| 2.0 * i as f64 / 100.0).collect(), kpa, counts }
    }

    /// The rows in another order, or some of them several times.
    fn rows(&self, order: &[usize]) -> Self {
        let pick = |column: &Vec<f64>| order.iter().map(|&i| column[i]).collect();
        Self { time_s: pick(&self.time_s), kpa: pick(&self.kpa), counts: self.counts.each_ref().map(pick) }
    }

    fn text(&self) -> String {
        let mut text = "t_s,pressure_kpa,c0,c1,c2\n".to_owned();
        for (i, time_s) in self.time_s.iter().enumerate() {
            let [a, b, c] = self.counts.each_ref().map(|column| column[i]);
            writeln!(text, "{time_s},{},{a},{b},{c}", self.kpa[i]).unwrap();
        }
        text
    }
}

/// What `taxel-lab fit` printed, and its complaint if it refused.
fn fit(folder: &Path, table: &Table) -> Result<String, String> {
    let (data, models) = (folder.join("data.csv"), folder.join("models.json"));
    std::fs::write(&data, table.text()).unwrap();
    let output = lab(&["fit", data.to_str().unwrap(), "--out", models.to_str().unwrap()]);
    let errors = text(&output.stderr);
    assert!(!errors.contains("panicked"), "{errors}");
    if output.status.success() { Ok(text(&output.stdout)) } else { Err(errors) }
}

/// What cannot be opened, ends in the middle or is a folder is told once, by its name and its place.
#[test]
fn a_file_that_cannot_be_read_is_named_once_and_where_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fit(folder.path(), &Table::new()).unwrap();
    std::fs::create_dir(at("dir")).unwrap();
    let gzipped = Command::new("gzip").args(["-c", &at("data.csv")]).output().unwrap().stdout;
    std::fs::write(at("cut.csv.gz"), &gzipped[..gzipped.len() / 2]).unwrap();
    let is_told = |name: &str, arguments: &[&str], why: &str| {
        let errors = fails(&lab(arguments));
        assert!(errors.contains(why), "{arguments:?}: {errors}");
        assert_eq!(errors.matches(&at(name)).count(), 1, "{arguments:?}: {errors}");
    };
    let (out, sound, models) = (at("out"), at("data.csv"), at("models.json"));
    let cases = [("dir", ["Is a directory"; 2]), ("none", ["No such file"; 2])];
    for (name, [of_data, of_models]) in cases.into_iter().chain([("cut.csv.gz", ["after line ", "incomplete deflate"])])
    {
        let file = at(name);
        is_told(name, &["fit", &file, "--out", &out], of_data);
        is_told(name, &["apply", &models, &file, "--out", &out], of_data);
        is_told(name, &["apply", &file, &sound, "--out", &out], of_models);
    }
}

#[test]
fn a_time_or_a_pressure_that_is_none_is_refused_with_its_place() {
    let table = Table::new();
    let scaled = |by: f64| Table { time_s: table.time_s.iter().map(|t| by * t).collect(), ..table.clone() };
    let pressure = |of: &dyn Fn(f64) -> f64| Table { kpa: table.kpa.iter().map(|p| of(*p)).collect(), ..table.clone() };
    let reversed: Vec<usize> = (0..ROWS).rev().collect();
    let shuffled: Vec<usize> = (0..ROWS).map(|i| i * 77 % ROWS).collect();
    let twice: Vec<usize> = (0..ROWS).chain(0..ROWS).collect();
    let mut spike = table.clone();
    spike.kpa[100] = 5000.0;
    let folder = tempfile::tempdir().unwrap();
    for (bad, says) in [
        (table.rows(&reversed), ["line 3: t_s goes from 11.98 to 11.96", "seconds that rise"]),
        (table.rows(&shuffled), ["line 10: t_s goes from 10.78 to 0.32", "are not later than all before"]),
        (table.rows(&twice), ["line 602: t_s goes from 11.98 to 0", "expected one recording"]),
        (scaled(0.0), ["line 3: t_s goes from 0 to 0", "expected one recording with seconds that rise"]),
        (scaled(1000.0), ["rises by 20.000000 a row", "if these are milliseconds, divide by 1000"]),
        (scaled(1e-4), ["rises by 2.0e-6 a row", "expected seconds, 0.0001 at least"]),
        (pressure(&|p| -p - 0.5), ["line 301: pressure_kpa is -70.38", "change the sign"]),
        (pressure(&|p| 0.4 - p), ["pressure_kpa is -69.48", "positive under load"]),
        (pressure(&|p| 1000.0 * p), ["line 7: pressure_kpa is 1168", "if these are pascals, divide by 1000"]),
        (spike, ["line 102: pressure_kpa is 5000", "if it is a single wrong value, empty its cell"]),
    ] {
        let refused = fit(folder.path(), &bad).unwrap_err();
        assert!(says.iter().all(|words| refused.contains(words)), "expected {says:?} in: {refused}");
        assert!(refused.contains("data.csv"), "{refused}");
    }
}

#[test]
fn a_row_out_of_time_or_a_gap_is_counted_and_named_and_changes_nothing_else() {
    let table = Table::new();
    let folder = tempfile::tempdir().unwrap();
    let clean = fit(folder.path(), &table).unwrap();
    assert!(!clean.contains("left out") && !clean.contains("gap"), "{clean}");
    let order: Vec<usize> = (0..ROWS).collect();
    let twice = table.rows(&[&order[..5], &[4], &order[5..]].concat());
    let late = table.rows(&[&order[..20], &[21, 20], &order[22..]].concat());
    let mut gap = table.clone();
    gap.time_s[300..].iter_mut().for_each(|t| *t += 3600.0);
    for (name, odd, says) in [
        ("twice", twice, "1 rows left out that have a t_s that is not later than all before (first: line 7, t_s 0.08)"),
        ("late", late, "1 rows left out that have a t_s that is not later than all before (first: line 23, t_s 0.4)"),
        ("an hour's pause", gap, "1 gaps of more than 5 s in t_s (first: line 302)"),
    ] {
        let said = fit(folder.path(), &odd).unwrap();
        assert!(said.contains(says), "{name}: expected `{says}` in: {said}");
        assert!(said.contains("3 of 3 usable") && said.contains("monotone, order"), "{name}: {said}");
        assert!((number(&said, RMSE) / number(&clean, RMSE) - 1.0).abs() < 0.03, "{name}: {said} {clean}");
    }
}

/// A recording of other counts obeys the options that it can, and refuses those that only one of 8 bits has.
#[test]
fn of_wide_counts_the_rising_pressure_alone_is_fitted_where_that_is_asked_for_and_what_is_not_looked_for_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let (data, models) = (folder.path().join("wide.csv"), folder.path().join("models.json"));
    // 400 counts lower while the pressure falls.
    let mut table = "t_s,pressure_kpa,c0,c1\n".to_owned();
    for row in 0..800_i32 {
        let kpa = 0.1 * f64::from(400 - (row - 400).abs());
        let count = 40_000.0 - 300.0 * kpa - if row > 400 { 400.0 } else { 0.0 };
        writeln!(table, "{},{kpa:.2},{count:.0},{count:.0}", 0.05 * f64::from(row)).unwrap();
    }
    std::fs::write(&data, table).unwrap();
    let fit = |options: &[&str]| {
        let files = ["fit", data.to_str().unwrap(), "--out", models.to_str().unwrap()];
        let output = lab(&[&files, options].concat());
        (output.status.success(), text(&output.stdout) + &text(&output.stderr))
    };
    let (both, rising) = (fit(&[]), fit(&["--branch", "rising"]));
    assert!(both.0 && rising.0, "{both:?} {rising:?}");
    assert!(both.1.contains("plays: 2 taxels") && !rising.1.contains("plays:"), "{both:?} {rising:?}");
    assert!(number(&rising.1, RMSE) < 0.05, "{rising:?}");
    let why = "faults are not looked for and nothing is averaged over time, because c0 is 40000 in line 2";
    assert!(both.1.contains(why), "{both:?}");
    let set = std::fs::read_to_string(&models).unwrap();
    assert!(set.contains(", rising\""), "{}", &set[..300]);
    let (succeeds, said) = fit(&["--module-size", "10"]);
    assert!(!succeeds && said.contains("--module-size needs a recording of a skin"), "{said}");
}
