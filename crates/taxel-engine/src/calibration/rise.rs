//! What gauge and taxels did since a rise began: by that an operator learns why nothing enters any more.

use std::time::Duration;

use crate::calibration::limits::SessionLimits;
use crate::counts::SharedCounts;

/// A gauge that moved by less than this stood still.
const STILL_KPA: f64 = 1.0;
/// A pressure that fell by more than this has escaped.
const FELL_KPA: f64 = 2.0;

/// What was seen of one rise.
#[derive(Debug, Default)]
pub struct Rise {
    gauge_kpa: Option<(f64, f64)>,
    counts: Option<(SharedCounts, SharedCounts)>,
}

impl Rise {
    /// The gauge reads so much now.
    pub fn on_gauge(&mut self, kpa: f64) {
        let (low, high) = self.gauge_kpa.get_or_insert((kpa, kpa));
        (*low, *high) = (low.min(kpa), high.max(kpa));
    }

    /// A whole scan came, whether or not it enters.
    pub fn on_scan(&mut self, counts: &SharedCounts) {
        self.counts.get_or_insert_with(|| (counts.clone(), counts.clone())).1 = counts.clone();
    }

    /// Why nothing has entered for so long, in words; the gauge reads `kpa` now.
    pub fn why(&self, kpa: f64, patience: Duration, limits: &SessionLimits) -> String {
        let (target_kpa, seconds) = (limits.target.0, patience.as_secs());
        if kpa >= target_kpa {
            return format!(
                "nothing entered for {seconds} s: the gauge reads {kpa:.1} kPa, beyond the target of {target_kpa:.1} kPa; the \
                 rise was too fast, or the gauge's scale is wrong"
            );
        }
        let cause = self.cause(kpa, f64::from(limits.responding_counts));
        format!(
            "the pressure did not rise for {seconds} s: it is {kpa:.1} kPa, the target is {target_kpa:.1} kPa; {cause}"
        )
    }

    fn cause(&self, kpa: f64, responding_counts: f64) -> String {
        let (low, high) = self.gauge_kpa.unwrap_or((kpa, kpa));
        let (moved, all) = self.moved(responding_counts);
        if high - kpa > FELL_KPA {
            format!("it has been {high:.1} kPa: the bag leaks, or the pump has stopped")
        } else if high - low > STILL_KPA {
            "as much leaks into the bag as the pump takes out, or the pump has stopped".to_owned()
        } else if 2 * moved > all {
            format!(
                "{moved} of {all} taxels have moved, and the gauge only from {low:.3} to {high:.3} kPa: it is not in this bag, \
                 or its scale is wrong"
            )
        } else {
            format!("{moved} of {all} taxels have moved: is the bag closed, and does the pump run?")
        }
    }

    fn moved(&self, least: f64) -> (usize, usize) {
        let Some((first, last)) = &self.counts else { return (0, 0) };
        let pairs = first.counts().iter_units().zip(last.counts().iter_units());
        pairs.fold((0, 0), |(moved, all), (a, b)| (moved + usize::from((a - b).abs() >= least), all + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Rise {
        fn told(&self, kpa: f64) -> String {
            let limits = SessionLimits { responding_counts: 4, ..SessionLimits::default() };
            self.why(kpa, Duration::from_secs(60), &limits)
        }
    }

    fn rise(gauge_kpa: &[f64], counts: [u16; 2]) -> Rise {
        let mut rise = Rise::default();
        gauge_kpa.iter().for_each(|kpa| rise.on_gauge(*kpa));
        counts.iter().for_each(|count| rise.on_scan(&SharedCounts::from(vec![*count; 4])));
        rise
    }

    #[test]
    fn what_is_said_of_a_rise_changes_at_what_can_be_told_from_noise() {
        let says = |gauge_kpa: &[f64], counts: [u16; 2]| {
            let last = gauge_kpa[gauge_kpa.len() - 1];
            rise(gauge_kpa, counts).told(last)
        };
        // 2 kPa below its highest the pressure has escaped.
        assert!(says(&[0.0, 32.0, 29.9], [200, 160]).contains("it has been 32.0 kPa: the bag leaks"));
        assert!(says(&[0.0, 32.0, 30.1], [200, 160]).contains("as much leaks into the bag"));
        // By 1 kPa the gauge has moved.
        assert!(says(&[5.0, 6.1], [200, 160]).contains("as much leaks into the bag"));
        assert!(says(&[5.0, 5.9], [200, 160]).contains("it is not in this bag"));
        assert!(says(&[0.0, 70.0], [200, 160]).contains("70.0 kPa, beyond the target of 70.0 kPa"));
        // Four counts are a taxel that responds, to either side.
        assert!(says(&[5.0, 5.0], [200, 196]).contains("4 of 4 taxels have moved, and the gauge only"));
        assert!(says(&[5.0, 5.0], [200, 197]).contains("0 of 4 taxels have moved: is the bag closed"));
    }

    #[test]
    fn a_gauge_is_only_suspect_where_most_taxels_have_moved() {
        let says = |moved: u16| {
            let mut rise = rise(&[5.0, 5.0], [200, 200]);
            rise.on_scan(&[0, 1, 2, 3].map(|taxel| if taxel < moved { 180 } else { 200 }).into());
            rise.told(5.0)
        };
        assert!(says(2).contains("2 of 4 taxels have moved: is the bag closed"), "{}", says(2));
        assert!(says(3).contains("3 of 4 taxels have moved, and the gauge only"), "{}", says(3));
    }
}
