//! Load points of a recording that has its own gauge: stretches in which gauge and skin hold still.

use taxel_engine::recalibration::LoadPoint;
use taxel_engine::statistics::mean;

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

/// What counts as steady.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steadiness {
    /// How long a stretch lasts, in seconds.
    pub span_s: f64,
    /// Within it neither quantity may move by more than this share of its mean,
    pub share: f64,
    /// or by so much, whichever is more.
    pub floor: f64,
}

/// Two quantities while both were steady.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// First and last position in the series, both within.
    pub scans: [usize; 2],
    /// Mean of the first quantity.
    pub read: f64,
    /// Mean of the second.
    pub known: f64,
}

/// The longest steady stretches of `read` and `known` at these times, in the order of time, none overlapping another.
/// Values that are no number end a stretch.
#[must_use]
pub fn stretches(time_s: &[f64], read: &[f64], known: &[f64], wanted: Steadiness) -> Vec<Stretch> {
    let count = time_s.len().min(read.len()).min(known.len());
    let (mut found, mut from) = (Vec::new(), 0);
    while from < count {
        let end = end_of_steady(read, known, from, count, wanted);
        let long = end > from && time_s[end - 1] - time_s[from] >= wanted.span_s;
        if long {
            let of = |values: &[f64]| mean(values[from..end].iter().copied()).0;
            found.push(Stretch { scans: [from, end - 1], read: of(read), known: of(known) });
            from = end;
        } else {
            from += 1;
        }
    }
    found
}

/// Where both stop being steady, if they are at `from`: the position after the last value that belongs to it.
fn end_of_steady(read: &[f64], known: &[f64], from: usize, count: usize, wanted: Steadiness) -> usize {
    let (mut spans, mut end) = ([Span::EMPTY; 2], from);
    while end < count && read[end].is_finite() && known[end].is_finite() {
        let next = [spans[0].with(read[end]), spans[1].with(known[end])];
        if next.iter().any(|span| !span.is_steady(wanted)) {
            break;
        }
        (spans, end) = (next, end + 1);
    }
    end
}

/// Least and greatest value so far.
#[derive(Clone, Copy)]
struct Span {
    least: f64,
    most: f64,
}

impl Span {
    const EMPTY: Self = Self { least: f64::INFINITY, most: f64::NEG_INFINITY };

    const fn with(self, value: f64) -> Self {
        Self { least: self.least.min(value), most: self.most.max(value) }
    }

    fn is_steady(self, wanted: Steadiness) -> bool {
        let middle = 0.5 * (self.least + self.most);
        self.most - self.least <= (wanted.share * middle.abs()).max(wanted.floor)
    }
}

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

#[test]
fn only_what_both_hold_is_a_stretch_and_a_lag_between_them_changes_nothing() {
    let time_s: Vec<f64> = (0..1200).map(|i| 0.01 * f64::from(i)).collect();
    let step = |t: f64| {
        if t < 4.0 {
            10.0
        } else if t < 5.0 {
            10.0 + 20.0 * (t - 4.0)
        } else {
            30.0
        }
    };
    let known: Vec<f64> = time_s.iter().map(|t| step(*t)).collect();
    let read: Vec<f64> = time_s.iter().map(|t| 0.9 * step(t - 0.7)).collect();
    let wanted = Steadiness { span_s: 2.0, share: 0.01, floor: 0.0 };
    let found = stretches(&time_s, &read, &known, wanted);
    assert_eq!(found.len(), 2, "{found:?}");
    for (stretch, force) in found.iter().zip([10.0, 30.0]) {
        assert!((stretch.known / force - 1.0).abs() < 2e-3 && (stretch.read / force - 0.9).abs() < 2e-3, "{stretch:?}");
    }
    let mut broken = read.clone();
    broken.iter_mut().step_by(150).for_each(|value| *value = f64::NAN);
    assert!(stretches(&time_s, &broken, &known, wanted).is_empty());
    assert!(stretches(&[], &[], &[], wanted).is_empty());
}
