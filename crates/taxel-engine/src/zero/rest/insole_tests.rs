//! Seconds of a recorded skin at rest: the noise of a real converter is not that of a simulated one.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;

use super::limits::UNLIKENESS_MAX;
use super::window::RestWindow;

const RECORDINGS: [&str; 3] = ["left_calibration", "left_validation", "left_steps"];
const SCANS_PER_SECOND: usize = 49;
/// What the chamber holds when nothing is asked of it, kPa.
const REST_KPA_MAX: f64 = 8.0;
/// Counts beyond are those of a dead or of a hanging taxel.
const SOUND_COUNTS: std::ops::Range<f64> = 5.0..252.0;

/// Pressure and counts, scan by scan; `None` where the recordings are absent.
fn scans(recording: &str) -> Option<Vec<(f64, Vec<f64>)>> {
    let data = std::env::var_os("TAXELD_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")), PathBuf::from);
    let path = data.join("insole").join(format!("{recording}.csv.gz"));
    let file = match File::open(&path) {
        Ok(file) => file,
        Err(error) => {
            eprintln!("SKIPPED: cannot open {}: {error}; set TAXELD_DATA to the data folder", path.display());
            return None;
        }
    };
    let lines = BufReader::new(flate2::read::GzDecoder::new(file)).lines().skip(1);
    let numbers = lines.map(|line| line.unwrap().split(',').map(|n| n.parse().unwrap()).collect::<Vec<f64>>());
    Some(numbers.map(|numbers| (numbers[1], numbers[2..].to_vec())).collect())
}

fn unlikeness(second: &[(f64, Vec<f64>)]) -> f64 {
    let modules: Vec<_> = (0..28).map(|module| 10 * module..10 * module + 10).collect();
    let mut window = RestWindow::new(280, &modules);
    for (scan, (_, counts)) in second.iter().enumerate() {
        let late = 2 * scan >= second.len();
        window.push(late, counts.iter().map(|&count| SOUND_COUNTS.contains(&count).then_some(count)));
    }
    window.unlikeness().unwrap()
}

/// Variance of the mean of each module's taxels over what it would be if they were independent, for modules that are all
/// sound.
fn variances(second: &[(f64, Vec<f64>)]) -> Vec<f64> {
    let of = |values: &dyn Fn(&[f64]) -> f64| {
        let mut moments = crate::zero::rest::RestStatistics::new(1);
        second.iter().for_each(|(_, counts)| moments.push([Some(values(counts))]));
        moments.baseline()[0].noise.powi(2)
    };
    let ratio = |module: usize| {
        let taxels = 10 * module..10 * module + 10;
        let sound = second.iter().all(|(_, counts)| counts[taxels.clone()].iter().all(|c| SOUND_COUNTS.contains(c)));
        let of_mean = of(&|counts: &[f64]| counts[taxels.clone()].iter().sum::<f64>() / 10.0);
        let independent = taxels.clone().map(|taxel| of(&|counts: &[f64]| counts[taxel])).sum::<f64>() / 100.0;
        sound.then_some(of_mean / independent).filter(|ratio| ratio.is_finite())
    };
    (0..28).filter_map(ratio).collect()
}

#[test]
fn the_modules_of_a_recorded_skin_at_rest_move_alike() {
    let (mut seconds, mut ratios) = (Vec::new(), Vec::new());
    for recording in RECORDINGS {
        let Some(scans) = scans(recording) else { return };
        let at_rest = |second: &&[(f64, Vec<f64>)]| {
            let (first, last) = (second[0].0, second[second.len() - 1].0);
            second.iter().all(|scan| scan.0 < REST_KPA_MAX) && (last - first).abs() < 1.0
        };
        for second in scans.chunks_exact(SCANS_PER_SECOND).filter(at_rest) {
            seconds.push(unlikeness(second));
            ratios.extend(variances(second));
        }
    }
    ratios.sort_by(f64::total_cmp);
    let ratio = ratios[ratios.len() / 2];
    eprintln!("the mean of ten taxels has {ratio:.2} times the variance of ten that are independent, in the median");
    assert!(ratio > 1.2, "a module's noise is its own");
    seconds.sort_by(f64::total_cmp);
    let greatest = seconds[seconds.len() - 1];
    let median = seconds[seconds.len() / 2];
    eprintln!("{} seconds at rest: {median:.1} in the median, at most {greatest:.1}", seconds.len());
    assert!(seconds.len() > 50 && greatest < UNLIKENESS_MAX, "{seconds:?}");
}
