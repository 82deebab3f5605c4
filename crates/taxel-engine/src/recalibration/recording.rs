//! Load points of a recording that has its own gauge: stretches in which gauge and skin hold still.

use crate::recalibration::evidence::LoadPoint;
use crate::recalibration::steady::{Steadiness, Stretch, stretches};

/// What counts as steady: a lag of half a second between the logs of skin and gauge does not matter then.
pub const STEADY: Steadiness = Steadiness { span_s: 2.0, share: 0.02, floor: 1.0 };

/// Load points lie above this pressure, kPa: below it a relative error says little.
pub const LEAST_KPA: f64 = 30.0;

/// Around a load point so many seconds are not scored either.
const MARGIN_S: f64 = 1.0;

/// Load points of a recording, and which of its scans they take up.
#[derive(Clone, Debug)]
pub struct RecordedPoints {
    /// The points in kPa, of rising pressure, numbered by their first scan.
    pub points: Vec<LoadPoint>,
    /// Whether a scan belongs to a point or is near one, so that it must not be scored.
    pub taken: Vec<bool>,
}

/// `count` of the steady stretches, evenly spread in the order of their pressure; `area_kpa` is the mean over the taxels.
///
/// # Errors
/// In words: fewer stretches than points.
pub fn points_of(time_s: &[f64], area_kpa: &[f64], gauge_kpa: &[f64], count: usize) -> Result<RecordedPoints, String> {
    let mut found = stretches(time_s, area_kpa, gauge_kpa, STEADY);
    found.retain(|stretch| stretch.known > LEAST_KPA && stretch.read > 0.0);
    if found.len() < count.max(2) {
        return Err(format!(
            "{} stretches above {LEAST_KPA} kPa hold still for {} s, expected {count} or more",
            found.len(),
            STEADY.span_s
        ));
    }
    found.sort_by(|a, b| a.known.total_cmp(&b.known));
    let last = found.len() - 1;
    let even = |k: usize| found[(k as f64 * last as f64 / (count.max(2) - 1) as f64).round() as usize];
    let chosen: Vec<Stretch> = (0..count).map(even).collect();
    let near = |time: &f64| {
        let of = |stretch: &Stretch| (time_s[stretch.scans[0]] - MARGIN_S)..=(time_s[stretch.scans[1]] + MARGIN_S);
        chosen.iter().any(|stretch| of(stretch).contains(time))
    };
    let point = |stretch: &Stretch| LoadPoint {
        number: stretch.scans[0] as u64,
        read: stretch.read,
        read_sigma: 0.0,
        known: stretch.known,
        known_sigma: 0.0,
    };
    Ok(RecordedPoints { points: chosen.iter().map(point).collect(), taken: time_s.iter().map(near).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_spread_over_the_pressures_and_their_scans_are_told() {
        let time_s: Vec<f64> = (0..4_000).map(|i| 0.02 * f64::from(i)).collect();
        // Steps of 5 s, each 25 kPa higher.
        let gauge: Vec<f64> = time_s.iter().map(|t| 25.0 * (t / 5.0).floor()).collect();
        let area: Vec<f64> = gauge.iter().map(|kpa| 0.9 * kpa).collect();
        let found = points_of(&time_s, &area, &gauge, 5).unwrap();
        let known: Vec<f64> = found.points.iter().map(|point| point.known).collect();
        assert_eq!(known, [50.0, 125.0, 225.0, 300.0, 375.0]);
        assert!(found.points.iter().all(|point| (point.read / point.known - 0.9).abs() < 1e-9));
        for (time, taken) in time_s.iter().zip(&found.taken) {
            let of_point = known.iter().any(|kpa| (kpa / 5.0..kpa / 5.0 + 4.99).contains(time));
            assert!(!of_point || *taken, "{time}");
        }
        assert!(found.taken.iter().filter(|taken| !**taken).count() > 1_500);
        assert!(points_of(&time_s, &area, &gauge, 40).unwrap_err().contains("hold still"));
    }
}
