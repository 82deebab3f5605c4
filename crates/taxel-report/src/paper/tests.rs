//! What the figures and the table must hold, on a skin whose answers are known.

use super::*;

/// Twenty taxels that lose a count a kilopascal on the way up, and stay two counts behind on the way down; the last two
/// hardly move.
fn skin(runs: usize, falls: bool) -> Data {
    let up = || (0..700).map(|k| 0.1 * f64::from(k));
    let down = || (1..700).rev().map(|k| 0.1 * f64::from(k));
    let rest = || std::iter::repeat_n(0.0, 50);
    let one: Vec<(f64, bool)> = rest().chain(up()).map(|p| (p, true)).chain(down().map(|p| (p, false))).collect();
    let one: Vec<(f64, bool)> = one.into_iter().filter(|(_, rises)| *rises || falls).collect();
    let all = one.repeat(runs);
    let count = |taxel: usize, (p, rises): (f64, bool)| {
        let gain = if taxel >= 18 { 0.05 } else { 1.0 };
        240.0 - taxel as f64 - (gain * if rises { p } else { (p + 2.0).min(70.0) }).round()
    };
    let counts = (0..20).map(|taxel| all.iter().map(|&scan| count(taxel, scan)).collect()).collect();
    Data::of_scans("a test".to_owned(), all.iter().map(|scan| scan.0).collect(), counts)
}

fn load(true_n: f64, measured_n: f64) -> Weighing {
    Weighing { kilogram: None, true_n, measured_n }
}

const ALL: [&str; 10] = [
    "raw",
    "mean-curve",
    "swing",
    "baseline",
    "repeatability",
    "repeatability-difference",
    "loop",
    "fit-typical",
    "fit-weak",
    "force",
];

fn names_of(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_simulator_gives_every_figure_and_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let data = simulate(1, 10.0).unwrap();
    let tables = write(folder.path(), &data, 10.0).unwrap();
    let mut expected: Vec<String> = ALL.iter().map(|id| format!("{id}.svg")).collect();
    expected.extend(["index.html", "table.json", "table.md"].map(str::to_owned));
    expected.sort();
    assert_eq!(names_of(folder.path()), expected);
    let page = std::fs::read_to_string(folder.path().join("index.html")).unwrap();
    for id in ALL {
        let picture = std::fs::read_to_string(folder.path().join(format!("{id}.svg"))).unwrap();
        assert!(page.contains(picture.trim_end()) && picture.contains("font-weight=\"bold\""), "{id}");
        assert!(!picture.contains("NaN") && !picture.contains("inf"), "{id}");
    }
    assert!(tables.left_out.is_empty(), "{:?}", tables.left_out);
    let calibration = &tables.calibration;
    assert_eq!((calibration.taxels, calibration.runs), (230, 3));
    assert!((5..=20).contains(&calibration.excluded_by_swing), "about 5 %: {calibration:?}");
    assert!(calibration.repeatability_counts.unwrap() < 1.0 && calibration.hysteresis_counts.unwrap() > 0.5);
    assert!(calibration.pressure_kpa[1] < 71.0, "{:?}", calibration.pressure_kpa);
    for errors in &tables.errors {
        assert_eq!(errors.rows.iter().map(|row| (row.kilogram, row.loads)).collect::<Vec<_>>().len(), 5);
        assert!((0.1..25.0).contains(&errors.mean_absolute_percent), "{errors:?}");
    }
    assert_eq!(tables.errors.len(), 2);
}

#[test]
fn what_the_data_cannot_draw_is_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let tables = write(folder.path(), &skin(1, false).without_loads("nobody weighed"), 10.0).unwrap();
    let left_out: Vec<&str> = tables.left_out.iter().map(|left_out| left_out.figure).collect();
    let expected = [
        "repeatability of three runs",
        "differences between three runs",
        "loop of both branches",
        "measured against true force",
    ];
    assert_eq!(left_out, expected);
    let names = names_of(folder.path());
    for id in ["repeatability", "repeatability-difference", "loop", "force"] {
        assert!(!names.contains(&format!("{id}.svg")), "{id}");
    }
    for file in ["index.html", "table.md", "table.json"] {
        let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
        assert!(text.contains("nobody weighed") && text.contains("loop of both branches"), "{file}: {text}");
    }
}

#[test]
fn the_tables_figures_are_those_of_the_skin() {
    let loads = vec![load(2.0, 1.8), load(2.0, 2.4), load(5.0, 5.0)];
    let by = "by hand | here".to_owned();
    let data = skin(3, true).with_loads(vec![Weighings { by, all: loads }]);
    let models = data.models(10.0);
    let tables = Tables::new(&data, &models, 10.0, Vec::new());
    let calibration = &tables.calibration;
    assert_eq!((calibration.usable, calibration.excluded_by_swing, calibration.without_curve), (18, 2, 0));
    assert_eq!((calibration.runs, calibration.scans, calibration.rising_scans), (3, 4347, 2250));
    assert_eq!(calibration.repeatability_counts, Some(0.0), "equal runs");
    let width = calibration.hysteresis_counts.unwrap();
    assert!((1.8..=2.0).contains(&width), "{width}");
    let [light, heavy] = tables.errors[0].rows.as_slice() else { panic!("{:?}", tables.errors) };
    assert_eq!((light.loads, heavy.loads, heavy.scatter_n), (2, 1, None));
    assert!((light.mean_percent - 5.0).abs() < 1e-9 && (light.mean_absolute_percent - 15.0).abs() < 1e-9);
    assert!((tables.errors[0].mean_absolute_percent - 10.0).abs() < 1e-9);
    // The models are the paper's over the rising samples alone.
    let (kpa, counts): (Vec<f64>, Vec<f64>) = data.risen(3).unzip();
    assert_eq!(models[3].quality.samples, counts.len() as u64);
    assert!(kpa.iter().zip(&counts).all(|(p, c)| (237.0 - p - c).abs() <= 0.5 + 1e-9));
}

#[test]
fn no_data_at_all_is_a_page_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let nothing = Data::of_scans(String::new(), vec![f64::NAN; 3], vec![vec![1.0; 3]; 2]).without_loads("none");
    let tables = write(folder.path(), &nothing, 10.0).unwrap();
    assert_eq!(tables.calibration.usable, 0);
    assert!(tables.left_out.len() >= 6, "{:?}", tables.left_out);
}
