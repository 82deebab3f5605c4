//! What the gauge of a session reads while nothing presses: its own zero, which is taken off its readings.
//!
//! A taxel's zero is what it reads in the vented bag, so its curve has to pass through no pressure there. A gauge that
//! reads 5 kPa at that moment is off by 5 kPa, or the bag still stands at them; the daemon cannot tell. In the first case
//! the pressures are right once the 5 kPa are off. In the second they are those beyond what the skin was zeroed at, and a
//! skin whose counts move s times as much per kPa at rest as at a pressure reads wrong there by (s - 1) times the 5 kPa. So
//! they stay in the uncertainty, as the half-width of a rectangle (GUM 4.3.7): three standard deviations hold an s of 2.7.

use crate::calibration::samples::{RampBaseline, Sample, SessionSamples};
use crate::statistics::mean;

/// Less is not worth a word, kPa: the last digit of many gauges.
const TOLD_FROM_KPA: f64 = 0.1;

/// The gauge's zeros of a session.
#[derive(Clone, Debug, Default)]
pub(super) struct GaugeZero {
    /// By ramp; `None` where it is not known.
    ramps: Vec<(u16, Option<f64>)>,
    /// Mean of those that are known, for the others: a gauge that is off stays so for days.
    mean_kpa: f64,
}

impl GaugeZero {
    /// Those of the ramps.
    pub fn of(ramps: &[RampBaseline]) -> Self {
        let known = |ramp: &RampBaseline| (ramp.ramp, ramp.gauge_kpa.filter(|kpa| kpa.is_finite()));
        let ramps: Vec<(u16, Option<f64>)> = ramps.iter().map(known).collect();
        let (mean_kpa, _) = mean(ramps.iter().filter_map(|(_, kpa)| *kpa));
        Self { ramps, mean_kpa: if mean_kpa.is_finite() { mean_kpa } else { 0.0 } }
    }

    /// The pressure of a sample, kPa, beyond what the gauge read before its ramp.
    pub fn pressure_kpa(&self, sample: &Sample) -> f64 {
        let zero = self.ramps.iter().find(|(ramp, _)| *ramp == sample.ramp);
        sample.pressure_kpa - zero.and_then(|(_, kpa)| *kpa).unwrap_or(self.mean_kpa)
    }

    /// Standard uncertainty of what was taken off, kPa: that of a rectangle as wide as the greatest, and all of it where a ramp
    /// has the zero of the others.
    pub fn doubt_kpa(&self) -> f64 {
        let share = if self.ramps.iter().all(|(_, kpa)| kpa.is_some()) { 3.0_f64.sqrt().recip() } else { 1.0 };
        share * self.greatest_kpa()
    }

    /// In words, for the method of a set; nothing where it is as good as none.
    pub fn told(&self) -> String {
        let zeros: Vec<String> = self.ramps.iter().filter_map(|(_, kpa)| *kpa).map(|kpa| format!("{kpa:.1}")).collect();
        if self.greatest_kpa() < TOLD_FROM_KPA {
            return String::new();
        }
        let unknown = self.ramps.len() - zeros.len();
        let unknown = if unknown > 0 {
            format!(", their mean in {unknown} ramps where that is not known")
        } else {
            String::new()
        };
        format!(", less {} kPa that the gauge read at rest{unknown}", zeros.join(" and "))
    }

    fn greatest_kpa(&self) -> f64 {
        self.ramps.iter().filter_map(|(_, kpa)| *kpa).map(f64::abs).fold(0.0, f64::max)
    }
}

impl SessionSamples {
    /// The pressure of each sample beyond what the gauge read when its ramp began, kPa: what models are fitted to.
    #[must_use]
    pub fn pressures_kpa(&self) -> Vec<f64> {
        let zero = GaugeZero::of(&self.ramps);
        self.samples.iter().map(|sample| zero.pressure_kpa(sample)).collect()
    }

    /// Standard uncertainty that these pressures have because of what was taken off them, kPa.
    #[must_use]
    pub fn gauge_zero_doubt_kpa(&self) -> f64 {
        GaugeZero::of(&self.ramps).doubt_kpa()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun(ramp: u16, gauge_kpa: Option<f64>) -> RampBaseline {
        RampBaseline { ramp, taxels: Vec::new(), gauge_kpa }
    }

    fn read(ramp: u16, pressure_kpa: f64) -> Sample {
        Sample { ramp, time_ns: 0, pressure_kpa, counts: [].as_slice().into() }
    }

    #[test]
    fn each_ramp_is_taken_from_its_own_zero_and_the_farthest_stays_in_doubt() {
        let zero = GaugeZero::of(&[begun(0, Some(-0.3)), begun(1, Some(6.0))]);
        assert_eq!([0, 1].map(|ramp| zero.pressure_kpa(&read(ramp, 20.0))), [20.3, 14.0]);
        assert!((zero.doubt_kpa() - 6.0 / 3.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(zero.told(), ", less -0.3 and 6.0 kPa that the gauge read at rest");
    }

    #[test]
    fn a_ramp_whose_zero_is_not_known_has_that_of_the_others_and_all_of_it_in_doubt() {
        let zero = GaugeZero::of(&[begun(0, None), begun(1, Some(5.0)), begun(2, Some(6.0)), begun(3, Some(f64::NAN))]);
        let pressures = [0, 1, 2, 3].map(|ramp| zero.pressure_kpa(&read(ramp, 20.0)));
        assert_eq!((pressures, zero.doubt_kpa()), ([14.5, 15.0, 14.0, 14.5], 6.0));
        let told = ", less 5.0 and 6.0 kPa that the gauge read at rest, their mean in 2 ramps where that is not known";
        assert_eq!(zero.told(), told);
    }

    #[test]
    fn of_a_gauge_that_reads_nothing_at_rest_nothing_is_told() {
        for ramps in [vec![], vec![begun(0, None)], vec![begun(0, Some(0.05))]] {
            let zero = GaugeZero::of(&ramps);
            assert!(zero.told().is_empty() && zero.doubt_kpa() < 0.03, "{ramps:?}");
            assert!((zero.pressure_kpa(&read(0, 20.0)) - 20.0).abs() < 0.06, "{ramps:?}");
        }
    }
}
