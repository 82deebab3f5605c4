//! The legs of a recording's pressure: up, down and up again.

use taxel_model::skin;
pub use taxel_model::skin::Leg;

use crate::calibration::fit::smooth::running_median;

/// Gauges give single readings that are off by 8 to 14 kPa: a median over 0.3 s takes them out.
pub(crate) const GAUGE_MEDIAN_SCANS: usize = 15;

/// On the way up a sample may lie behind the furthest pressure so far by this share of the range.
const BAND_SHARE: f64 = 0.01;

/// All legs, in order; together they are all scans. NaN is no pressure.
///
/// A rise that nothing follows goes on to the end of the recording, a hold at its top included.
#[must_use]
pub fn legs(kpa: &[f64]) -> Vec<Leg> {
    let course = running_median(kpa, GAUGE_MEDIAN_SCANS);
    let known: Vec<usize> = (0..kpa.len()).filter(|&scan| course[scan].is_finite()).collect();
    let mut legs = skin::legs(&known.iter().map(|&scan| course[scan]).collect::<Vec<f64>>());
    let mut begin = 0;
    for leg in &mut legs {
        let end = match known.get(leg.scans.end) {
            None => kpa.len(),
            Some(_) if leg.rising => highest_near(kpa, known[leg.scans.end - 1]) + 1,
            Some(turn) => *turn,
        };
        leg.scans = begin..end;
        begin = end;
    }
    legs
}

/// Whether each scan belongs to rising pressure: on a leg upwards, and not in a dip of it. `legs` are those of `kpa`.
#[must_use]
pub fn rising(kpa: &[f64], legs: &[Leg]) -> Vec<bool> {
    let course = running_median(kpa, GAUGE_MEDIAN_SCANS);
    let band = BAND_SHARE * range_of(&course);
    let mut rising = vec![false; kpa.len()];
    for leg in legs.iter().filter(|leg| leg.rising) {
        let mut furthest = f64::NEG_INFINITY;
        for i in leg.scans.clone() {
            furthest = furthest.max(course[i]);
            rising[i] = course[i] >= furthest - band;
        }
    }
    rising
}

fn range_of(kpa: &[f64]) -> f64 {
    let finite = || kpa.iter().copied().filter(|p| p.is_finite());
    (finite().fold(f64::NEG_INFINITY, f64::max) - finite().fold(f64::INFINITY, f64::min)).max(0.0)
}

/// The first scan with the highest pressure about `turn`, as near to it as the median may have moved it.
fn highest_near(kpa: &[f64], turn: usize) -> usize {
    let near = turn.saturating_sub(GAUGE_MEDIAN_SCANS)..(turn + GAUGE_MEDIAN_SCANS + 1).min(kpa.len());
    near.filter(|&i| kpa[i].is_finite())
        .fold(turn, |best, i| if kpa[i] > kpa[best] || (kpa[i] == kpa[best] && i < best) { i } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(from: f64, to: f64, scans: usize) -> impl Iterator<Item = f64> {
        (0..scans).map(move |k| from + (to - from) * k as f64 / scans as f64)
    }

    #[test]
    fn a_ramp_up_and_down_turns_at_its_highest_scan() {
        let kpa: Vec<f64> = ramp(0.0, 70.0, 700).chain(ramp(70.0, 0.0, 350)).collect();
        let legs = legs(&kpa);
        let expected = [Leg { scans: 0..701, rising: true }, Leg { scans: 701..1050, rising: false }];
        assert_eq!(legs, expected);
        assert_eq!(rising(&kpa, &legs).iter().filter(|r| **r).count(), 701);
    }

    /// A range does not begin at nothing.
    #[test]
    fn what_is_a_dip_and_what_is_a_turn_goes_by_the_range() {
        let way =
            |points: &[f64]| -> Vec<f64> { points.windows(2).flat_map(|two| ramp(two[0], two[1], 200)).collect() };
        // Of 70 kPa a quarter is 17.5 kPa.
        assert_eq!(
            [18.0, 17.0].map(|back| legs(&way(&[100.0, 160.0, 160.0, 160.0 - back, 160.0 - back, 170.0])).len()),
            [3, 1]
        );
        let falls = way(&[170.0, 100.0]);
        assert_eq!(legs(&falls), [Leg { scans: 0..falls.len(), rising: false }]);
        // A hundredth is 0.7 kPa: more than that behind is no rise.
        let dips = |back: f64| {
            let kpa = way(&[100.0, 160.0, 160.0, 160.0 - back, 160.0 - back, 170.0]);
            rising(&kpa, &legs(&kpa))[700]
        };
        assert_eq!([0.6, 0.8].map(dips), [true, false]);
    }

    #[test]
    fn what_has_no_course_has_no_turn() {
        for kpa in [vec![], vec![f64::NAN; 5], vec![3.0; 40]] {
            assert_eq!(legs(&kpa), [Leg { scans: 0..kpa.len(), rising: true }]);
            assert_eq!(rising(&kpa, &legs(&kpa)).len(), kpa.len());
        }
    }
}
