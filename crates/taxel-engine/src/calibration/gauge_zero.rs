//! What the gauge of a session reads while nothing presses: its own zero, which is taken off its readings.
//!
//! A taxel's zero is what it reads in the vented bag, so its curve has to pass through no pressure there. A gauge that
//! reads 5 kPa at that moment is off by 5 kPa, or the bag still stands at them; the daemon cannot tell. In the first case
//! the pressures are right once the 5 kPa are off. In the second they are those beyond what the skin was zeroed at, and a
//! skin whose counts move s times as much per kPa at rest as at a pressure reads wrong there by (s - 1) times the 5 kPa. So
//! they stay in the uncertainty, as the half-width of a rectangle (GUM 4.3.7): three standard deviations hold an s of 2.7, and for
//! a skin of more it is raised ([`steeper_at_rest`]).

use taxel_model::TaxelModel;

use crate::baseline::TaxelBaseline;
use crate::calibration::samples::{RampBaseline, Sample, SessionSamples};
use crate::model_set::ModelSet;
use crate::statistics::{mean, quantile};

/// A curve that is flat at rest by its fit's whim says nothing.
const STEEPER_MAX: f64 = 10.0;

/// Less is not worth a word, kPa: the last digit of many gauges.
const TOLD_FROM_KPA: f64 = 0.1;

/// The gauge's zeros of a session.
#[derive(Clone, Debug, Default)]
pub(crate) struct GaugeZero {
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

    /// One for all readings.
    pub fn of_all(kpa: f64) -> Self {
        Self { ramps: vec![(0, Some(kpa))], mean_kpa: kpa }
    }

    /// The pressure of a sample, kPa, beyond what the gauge read before its ramp.
    pub fn pressure_kpa(&self, sample: &Sample) -> f64 {
        let zero = self.ramps.iter().find(|(ramp, _)| *ramp == sample.ramp);
        sample.pressure_kpa - zero.and_then(|(_, kpa)| *kpa).unwrap_or(self.mean_kpa)
    }

    /// Standard uncertainty of what was taken off, kPa: that of a rectangle as wide as the greatest.
    pub fn sigma_kpa(&self) -> f64 {
        self.greatest_kpa() / 3.0_f64.sqrt()
    }

    /// In words, for the method of a set; nothing where it is as good as none.
    pub fn in_words(&self) -> String {
        let zeros = || self.ramps.iter().filter_map(|(_, kpa)| *kpa);
        let (least, greatest) = (zeros().fold(f64::INFINITY, f64::min), zeros().fold(f64::NEG_INFINITY, f64::max));
        let zero = if least == greatest { format!("{least:.1}") } else { format!("{least:.1} to {greatest:.1}") };
        let is_worth_it = self.greatest_kpa() >= TOLD_FROM_KPA;
        if is_worth_it { format!(", less {zero} kPa that the gauge read at rest") } else { String::new() }
    }

    fn greatest_kpa(&self) -> f64 {
        self.ramps.iter().filter_map(|(_, kpa)| *kpa).map(f64::abs).fold(0.0, f64::max)
    }
}

/// By how much the uncertainty of the zero is to be raised for what it makes of the upper end of the range: (s - 1) / sqrt(3), s being
/// how many times as many counts a kPa moves at rest as at the upper end, over secants of a fifth of the range. Nine taxels of ten
/// have no more; at least 1.
pub(crate) fn steeper_at_rest(models: &[TaxelModel], rest: &[TaxelBaseline]) -> f64 {
    let of = |(model, rest): (&TaxelModel, &TaxelBaseline)| {
        let [low, high] = model.range.filter(|_| model.is_usable())?;
        let (from, to) = if (rest.mean - low).abs() < (rest.mean - high).abs() { (low, high) } else { (high, low) };
        let kpa = |part: f64| model.evaluate(from + part * (to - from)).map(|reading| reading.kpa);
        Some((kpa(1.0)? - kpa(0.8)?) / (kpa(0.2)? - kpa(0.0)?)).filter(|s| s.is_finite() && *s > 0.0)
    };
    let steeper = quantile(models.iter().zip(rest).filter_map(of).collect(), 0.9).unwrap_or(1.0);
    ((steeper - 1.0) / 3.0_f64.sqrt()).clamp(1.0, STEEPER_MAX)
}

impl SessionSamples {
    /// The pressure of each sample beyond what the gauge read when its ramp began, kPa: what models are fitted to.
    #[must_use]
    pub fn pressures_kpa(&self) -> Vec<f64> {
        let zero = GaugeZero::of(&self.ramps);
        self.samples.iter().map(|sample| zero.pressure_kpa(sample)).collect()
    }

    /// Standard uncertainty that the models of a set have because of what was taken off the pressures that they are fitted to,
    /// kPa. The set has it in its offset.
    #[must_use]
    pub fn gauge_zero_sigma_kpa(&self, set: &ModelSet) -> f64 {
        GaugeZero::of(&self.ramps).sigma_kpa() * steeper_at_rest(&set.taxels, &set.baseline)
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
    fn each_ramp_is_taken_from_its_own_zero_and_the_farthest_stays_uncertain() {
        let zero = GaugeZero::of(&[begun(0, Some(-0.3)), begun(1, Some(6.0))]);
        assert_eq!([0, 1].map(|ramp| zero.pressure_kpa(&read(ramp, 20.0))), [20.3, 14.0]);
        assert!((zero.sigma_kpa() - 6.0 / 3.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(zero.in_words(), ", less -0.3 to 6.0 kPa that the gauge read at rest");
        let several: Vec<RampBaseline> = (0..).zip([5.2, 5.9, 5.0, 5.4]).map(|(n, kpa)| begun(n, Some(kpa))).collect();
        assert_eq!(GaugeZero::of(&several).in_words(), ", less 5.0 to 5.9 kPa that the gauge read at rest");
    }

    #[test]
    fn a_ramp_whose_zero_is_not_known_has_the_mean_of_the_others() {
        let zero = GaugeZero::of(&[begun(0, None), begun(1, Some(5.0)), begun(2, Some(6.0)), begun(3, Some(f64::NAN))]);
        let pressures = [0, 1, 2, 3].map(|ramp| zero.pressure_kpa(&read(ramp, 20.0)));
        assert_eq!(pressures, [14.5, 15.0, 14.0, 14.5]);
    }
}
