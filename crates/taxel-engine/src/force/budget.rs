//! What the standard uncertainty of a force is made of.
//!
//! Terms are independent of each other. What is correlated over taxels is added up within its term, so that the uncertainty of the
//! total is the root of the sum of the squares (GUM 5.1.2). It is the uncertainty of a single scan.

use taxel_skin::Newton;

use crate::names::named;

named! {
    /// A source of uncertainty.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Term {
        /// Noise, rounding and fit of each taxel's reading. Type A, from the calibration's left-out readings. Independent over taxels.
        Readings = "readings",
        /// A light touch may be noise: unless a taxel reads two to three times its threshold. Type A, from the noise of the zero.
        Choice = "choice",
        /// The zero may be off. Type A, from untouched taxels. Common to all taxels, as temperature is.
        Zero = "zero",
        /// How a load came is not known (`hysteresis.rs`). Type B, half of what it may be off by. A contact has one history.
        Hysteresis = "hysteresis",
        /// A load decreases (`unloading.rs`): it is read too high, so this is of the lower end of the interval alone. Type A, from falling
        /// pressure, else type B. A contact has one history.
        Unloading = "unloading",
        /// What the calibration leaves open of the curve. Type B. Neighbouring taxels are made alike.
        Curve = "curve",
        /// Counts beyond the calibrated range. Type B: half of what the curve's extension adds. Common: the skin's stiffness.
        BeyondRange = "beyond range",
        /// Offset and gain of the gauge. Type B, from the configuration. Common to all taxels.
        Gauge = "gauge",
        /// The skin's gain differs from day to day. Type A, from recordings of one skin on several days. Common to all.
        GainOfDay = "gain of the day",
        /// The area that a taxel stands for. Type B, from the configuration or from known loads. Common to all.
        Area = "area",
        /// Pads sample the pressure at points. Type A, from simulated contacts (`sampling.rs`). Independent over contacts.
        Sampling = "sampling",
        /// A pad at the rim of the skin feels less. Type A, from the same simulation. Common to the taxels at the rim.
        Rim = "rim",
        /// What lies under the edge of a touch without a count that shows it (`dead_zone.rs`). Type A, from simulated contacts.
        /// Independent over taxels.
        DeadZone = "dead zone",
        /// Taxels under a contact that cannot be read. Type B (`coverage.rs`): half of the most that may lie there,
        /// or the spread of the contacts that fit (`fill.rs`).
        Unread = "unread taxels",
        /// All taxels of a module jump together. Type A, from the watch of the module. Common within a module.
        Flicker = "flicker",
    }
}

/// The standard uncertainty of one force, N, by its terms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Budget([f64; Term::ALL.len()]);

impl Budget {
    /// The same with another value of a term.
    #[must_use]
    pub const fn with(mut self, term: Term, newton: f64) -> Self {
        self.0[term as usize] = newton;
        self
    }

    /// One term.
    #[must_use]
    pub const fn of(&self, term: Term) -> Newton {
        Newton(self.0[term as usize])
    }

    /// Every term that is there, with its standard uncertainty.
    pub fn terms(&self) -> impl Iterator<Item = (Term, Newton)> + '_ {
        Term::ALL.into_iter().map(|term| (term, self.of(term))).filter(|(_, newton)| newton.0 != 0.0)
    }

    /// Root of the sum of the squares.
    #[must_use]
    pub fn sigma(&self) -> Newton {
        Newton(self.0.iter().map(|newton| newton * newton).sum::<f64>().sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_uncertainty_is_the_root_of_the_sum_of_the_squared_terms() {
        let budget = Budget::default().with(Term::Readings, 0.3).with(Term::Sampling, 0.4);
        assert!((budget.sigma().0 - 0.5).abs() < 1e-15);
        let terms: Vec<_> = budget.terms().map(|(term, newton)| (term.name(), newton.0)).collect();
        assert_eq!(terms, [("readings", 0.3), ("sampling", 0.4)]);
        assert!(Term::ALL.iter().enumerate().all(|(place, term)| *term as usize == place));
    }
}
