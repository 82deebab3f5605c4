//! What is known of the force and of each taxel at one moment.

use std::sync::Arc;
use taxel_skin::{Newton, Time};

use crate::force::budget::{Budget, Term};
use crate::force::reason::{Reason, in_words};
use crate::intake::faults::fault::FaultSet;

/// How far a force can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum ForceState {
    /// Every activated taxel is calibrated, fresh and in range.
    Ok,
    /// A force with named shortcomings.
    Degraded,
    /// No force: too much of the skin is silent.
    Stale,
    /// No force: the zero is not proven.
    TareInvalid,
    /// No force: no model set is in use.
    #[default]
    Uncalibrated,
}

/// Standard uncertainties from a force to the end of its 95 % interval.
const INTERVAL_SIGMAS: f64 = 1.96;

/// The force that may be there without being detected: below the activation thresholds, and what the zero may hide.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Undetected {
    /// What the counts say of it, N.
    pub newton: f64,
    /// Its standard uncertainty, N.
    pub sigma_n: f64,
}

impl Undetected {
    /// The most that is there, to 95 %.
    #[must_use]
    pub fn at_most(self) -> Newton {
        Newton(self.newton + INTERVAL_SIGMAS * self.sigma_n)
    }
}

/// The total normal force and what is known of it.
#[derive(Clone, Debug, Default)]
pub struct ForceSample {
    /// How far it can be trusted.
    pub state: ForceState,
    /// Why it is not `Ok`, most important first.
    pub reasons: Vec<Reason>,
    /// Sum of area x pressure over active taxels; absent unless the state is `Ok` or `Degraded`.
    pub total: Option<Newton>,
    /// Standard uncertainty of the total, of this scan.
    pub total_sigma: Option<Newton>,
    /// What that uncertainty is made of.
    pub budget: Budget,
    /// What may be there in addition.
    pub undetected: Option<Undetected>,
    /// Nothing bounds the force above: a part of the skin is not read, or reads more than was calibrated.
    pub unbounded: bool,
    /// One more for each zero taken or lost.
    pub zero_epoch: u64,
    /// By how much the total jumped at the last change of zero or model set; absent if there was no force before or after it.
    pub step: Option<Newton>,
    /// Sum of -area x pressure x outward normal: the force that acts on the skin, in N, patch frame.
    pub resultant: Option<[f64; 3]>,
    /// Its moment about the patch origin, in N m.
    pub moment: Option<[f64; 3]>,
    /// Force-weighted mean position of active taxels, in m.
    pub centre_of_pressure: Option<[f64; 3]>,
    /// Clusters of active taxels, strongest first.
    pub contacts: Vec<Contact>,
    /// Taxels above their activation threshold that count in the total.
    pub active: u32,
    /// Taxels without a usable model or with a fault.
    pub excluded: u32,
    /// Taxels of silent modules.
    pub stale: u32,
    /// Active taxels beyond the calibrated range.
    pub out_of_range: u32,
    /// Id of the active model set.
    pub model_set: Option<Arc<str>>,
}

impl ForceSample {
    /// The least that the force is by so many standard uncertainties, 0 or more; `None` without a force.
    #[must_use]
    pub fn least(&self, sigmas: f64) -> Option<Newton> {
        Some(Newton((self.total?.0 - sigmas * self.total_sigma?.0).max(0.0)))
    }

    /// The most that it is, whatever bounds it: total and undetected force with the uncertainties of both.
    #[must_use]
    pub fn most(&self, sigmas: f64) -> Option<Newton> {
        let Undetected { newton, sigma_n } = self.undetected?;
        let above_n2 = (self.total_sigma?.0.powi(2) - self.budget.of(Term::Unloading).0.powi(2)).max(0.0);
        Some(Newton(self.total?.0 + newton + sigmas * above_n2.sqrt().hypot(sigma_n)))
    }

    /// Lower end of the 95 % interval.
    #[must_use]
    pub fn low(&self) -> Option<Newton> {
        self.least(INTERVAL_SIGMAS)
    }

    /// Upper end of the 95 % interval; `None` where nothing bounds it.
    #[must_use]
    pub fn high(&self) -> Option<Newton> {
        self.most(INTERVAL_SIGMAS).filter(|_| !self.unbounded)
    }

    /// Why it is not `Ok`, in one line.
    #[must_use]
    pub fn why(&self) -> String {
        in_words(&self.reasons)
    }
}

/// Touched taxels that are connected through their neighbours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contact {
    /// The same as long as it shares taxels with itself one scan before, 1 or more.
    pub id: u32,
    /// Sum of area x pressure, in N.
    pub force_n: f64,
    /// The area that its taxels stand for, in mm2.
    pub area_mm2: f64,
    /// The greatest pressure of a taxel, in kPa.
    pub peak_kpa: f64,
    /// Force-weighted mean position, in m.
    pub centre: [f64; 3],
    /// Sum of -area x pressure x outward normal: the force that acts on the skin, in N, patch frame.
    pub resultant: [f64; 3],
    /// Its moment about the patch origin, in N m.
    pub moment: [f64; 3],
    /// The numbers of its taxels, ascending.
    pub taxels: Vec<u16>,
}

/// One taxel at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaxelState {
    /// The raw count as last received.
    pub count: u16,
    /// When it was received; meaningless while `seen` is false.
    pub time: Time,
    /// Whether it ever was.
    pub seen: bool,
    /// Whether its module is silent.
    pub stale: bool,
    /// Whether its count is beyond its activation threshold.
    pub active: bool,
    /// Whether it has a usable model.
    pub calibrated: bool,
    /// Below, in or above the calibrated range.
    pub range: RangeFlag,
    /// What is wrong with it now.
    pub faults: FaultSet,
    /// Pressure in kPa, present if calibrated, tared and fresh; beyond the calibrated range by the curve's extension.
    pub pressure_kpa: Option<f32>,
    /// Standard uncertainty of the pressure in kPa.
    pub sigma_kpa: Option<f32>,
}

/// Where a count lies against the calibrated range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RangeFlag {
    /// In the calibrated range.
    #[default]
    In,
    /// Less pressure than was calibrated; read as the low end.
    Below,
    /// More pressure than was calibrated; read by the curve's extension.
    Above,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a load that decreases is read too high by.
    #[test]
    fn unloading_lowers_the_least_alone() {
        let of = |unloading_n: f64| {
            let budget = Budget::default().with(Term::Readings, 0.3).with(Term::Unloading, unloading_n);
            let (total, undetected) = (Some(Newton(5.0)), Some(Undetected { newton: 0.1, sigma_n: 0.4 }));
            let sample =
                ForceSample { total, total_sigma: Some(budget.sigma()), budget, undetected, ..ForceSample::default() };
            [sample.least(2.0), sample.most(2.0)].map(|newton| newton.unwrap().0)
        };
        let ([least, most], [without, same]) = (of(0.4), of(0.0));
        assert!((least - 4.0).abs() < 1e-12 && (without - 4.4).abs() < 1e-12, "{least} {without}");
        assert!((most - 6.1).abs() < 1e-12 && (same - 6.1).abs() < 1e-12, "{most} {same}");
    }
}
