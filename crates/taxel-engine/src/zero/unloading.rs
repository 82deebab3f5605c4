//! A skin that becomes lighter than its zero was not at rest when the zero was taken.

use std::fmt;
use std::ops::Range;

use crate::baseline::TaxelBaseline;
use crate::zero::rest::limits::RestLimits;
use crate::zero::rest::moves::Moves;
use crate::zero::rest::statistics::RestStatistics;

/// The skin became lighter than its zero: the zero was taken under a load, or is another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unloading {
    /// How much lighter the median taxel is, counts.
    pub median: f64,
    /// The module that is lightest against its zero.
    pub module: Option<usize>,
    /// How much lighter its median taxel is, counts.
    pub module_median: f64,
    /// How much lighter the third taxel of some module is, counts.
    pub third: f64,
}

impl Unloading {
    /// In words, with the modules by the names that they have for whoever looks for them.
    #[must_use]
    pub fn told(&self, name: impl Fn(usize) -> String) -> String {
        let by_module = |module| format!(", {} by {:.2}", name(module), self.module_median);
        let module = self.module.map(by_module).unwrap_or_default();
        format!(
            "the skin is {:.2} counts lighter than its zero in the median{module}, three taxels of a module by {:.2} and more",
            self.median, self.third
        )
    }
}

impl fmt::Display for Unloading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.told(|module| format!("module {module}")))
    }
}

/// How much lighter than its zero the skin is now, if by more than a true zero allows: then the zero was taken under a
/// load that has gone since. True zeros of recordings stay within 0.07 counts in the median, where a load of 30 kPa
/// leaves 0.9.
///
/// `later` is a later window of scans, as long as that of the zero; who has a whole file asks for each of its windows.
/// `sign` is as in [`Moves::against`].
#[must_use]
pub fn unloading(
    zero: &[TaxelBaseline],
    later: &RestStatistics,
    sign: &[i8],
    limits: &RestLimits,
) -> Option<Unloading> {
    let later = Later { seen: &later.baseline(), scans: later.count(), modules: later.modules() };
    later.unloaded(zero, sign, limits)
}

/// What was seen of each taxel in a window of scans after the zero.
#[derive(Clone, Copy, Debug)]
pub struct Later<'a> {
    /// Mean and noise, one per taxel.
    pub seen: &'a [TaxelBaseline],
    /// Scans of the window.
    pub scans: u64,
    /// Which taxels form each module.
    pub modules: &'a [Range<usize>],
}

impl Later<'_> {
    /// As [`unloading`].
    #[must_use]
    pub fn unloaded(&self, zero: &[TaxelBaseline], sign: &[i8], limits: &RestLimits) -> Option<Unloading> {
        if self.scans < limits.scans_min {
            return None;
        }
        let lighter = Moves::between(zero, self.seen, self.scans, sign).reversed();
        if !lighter.are_enough(limits.sound_share_min) {
            return None;
        }
        let median = lighter.median();
        let (module, module_median) = lighter.worst_module(self.modules, 0.0);
        let (_, third) = lighter.worst_third(self.modules, 0.0);
        let found =
            median > limits.lift_median_max || module_median > limits.lift_module_max || third > limits.lift_third_max;
        found.then_some(Unloading { median, module, module_median, third })
    }
}
