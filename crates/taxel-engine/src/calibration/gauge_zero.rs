//! What the gauge of a session reads while nothing presses: its own zero, which is taken off its readings.
//!
//! A taxel's zero is what it reads in the vented bag, so its curve has to pass through no pressure there. A gauge that
//! reads 5 kPa at that moment is off by 5 kPa, or the bag still stands at them; the daemon cannot tell. In the first case
//! the pressures are right once the 5 kPa are off. In the second they are those beyond what the skin was zeroed at, and a
//! skin that is steeper or flatter there reads wrong by a part of the 5 kPa. So they stay in the uncertainty.

use crate::calibration::samples::{RampBaseline, Sample, SessionSamples};

/// The stated intervals are of so many standard deviations, and hold what was taken off.
const COVERAGE_FACTOR: f64 = 3.0;

/// Less is not worth a word, kPa: the last digit of many gauges.
const TOLD_FROM_KPA: f64 = 0.1;

/// The gauge's zeros of a session, one per ramp.
#[derive(Clone, Debug, Default)]
pub(super) struct GaugeZero(Vec<(u16, f64)>);

impl GaugeZero {
    /// Those of the ramps whose zero is known; the others are left as they were read.
    pub fn of(ramps: &[RampBaseline]) -> Self {
        let finite = |ramp: &RampBaseline| ramp.gauge_kpa.filter(|kpa| kpa.is_finite()).map(|kpa| (ramp.ramp, kpa));
        Self(ramps.iter().filter_map(finite).collect())
    }

    /// The pressure of a sample, kPa, beyond what the gauge read before its ramp.
    pub fn pressure_kpa(&self, sample: &Sample) -> f64 {
        let zero = self.0.iter().find(|(ramp, _)| *ramp == sample.ramp);
        sample.pressure_kpa - zero.map_or(0.0, |(_, kpa)| *kpa)
    }

    /// Least standard deviation of the gauge's offset, kPa.
    pub fn doubt_kpa(&self) -> f64 {
        self.greatest_kpa() / COVERAGE_FACTOR
    }

    /// In words, for the method of a set; nothing where it is as good as none.
    pub fn told(&self) -> String {
        let zeros: Vec<String> = self.0.iter().map(|(_, kpa)| format!("{kpa:.1}")).collect();
        if self.greatest_kpa() < TOLD_FROM_KPA {
            return String::new();
        }
        format!(", less {} kPa that the gauge read at rest", zeros.join(" and "))
    }

    fn greatest_kpa(&self) -> f64 {
        self.0.iter().map(|(_, kpa)| kpa.abs()).fold(0.0, f64::max)
    }
}

impl SessionSamples {
    /// The pressure of each sample beyond what the gauge read when its ramp began, kPa: what models are fitted to.
    #[must_use]
    pub fn pressures_kpa(&self) -> Vec<f64> {
        let zero = GaugeZero::of(&self.ramps);
        self.samples.iter().map(|sample| zero.pressure_kpa(sample)).collect()
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
        let zero =
            GaugeZero::of(&[begun(0, Some(-0.3)), begun(1, None), begun(2, Some(6.0)), begun(3, Some(f64::NAN))]);
        let pressures = [0, 1, 2, 3, 4].map(|ramp| zero.pressure_kpa(&read(ramp, 20.0)));
        assert_eq!(pressures, [20.3, 20.0, 14.0, 20.0, 20.0]);
        assert_eq!(zero.doubt_kpa(), 2.0);
        assert_eq!(zero.told(), ", less -0.3 and 6.0 kPa that the gauge read at rest");
    }

    #[test]
    fn of_a_gauge_that_reads_nothing_at_rest_nothing_is_told() {
        for ramps in [vec![], vec![begun(0, None)], vec![begun(0, Some(0.05))]] {
            let zero = GaugeZero::of(&ramps);
            assert!(zero.told().is_empty() && zero.doubt_kpa() < 0.02, "{ramps:?}");
        }
    }
}
