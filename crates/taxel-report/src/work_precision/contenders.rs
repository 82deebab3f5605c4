//! Who competes: ours and the peers under one face, and whose exact solution each is judged by.

use std::collections::BTreeMap;
use std::hint::black_box;

use taxel_model::reference::Reference;
use taxel_model::{Estimator, FitOptions, MIN_BINNED_SAMPLES, Order, Samples, Shape, TaxelModel, fit};

use super::taxels::{Bits, Recording};
use crate::numbers::timed_us;
use crate::peers::{self, Fitted, Peers, Polynomial};

/// The exact solutions of orders 0 to `order` for a taxel, kPa, of an estimator's problem: one row a sample, or one a bin of
/// pressure with mean count and mean pressure, weighted with the number of samples.
pub(super) fn solve(estimator: Estimator, recording: &Recording, taxel: usize, order: usize) -> Vec<Reference> {
    let mut rows: BTreeMap<i64, (i64, i64, i64)> = BTreeMap::new();
    for (units, count) in recording.units.iter().zip(&recording.taxels[taxel].counts) {
        let count = *count as i64;
        let key = match (estimator, recording.bits) {
            // 1 unit is 1000 times 2^-10 Pa.
            (Estimator::PressureBinned, Bits::Eight) => (units * 1000) >> 19,
            (Estimator::PressureBinned, Bits::Sixteen) => units.div_euclid(512),
            _ => count,
        };
        let row = rows.entry(key).or_default();
        *row = (row.0 + 1, row.1 + count, row.2 + units);
    }
    Reference::of_sums(&rows.into_values().collect::<Vec<_>>(), -10, order)
}

/// What makes the bins of [`solve`]: with 8 bits two of the accumulator's own, whose width is 2^18 units of
/// 2^-10 Pa, with 16 bits half a kPa.
fn bin_width_kpa(bits: Bits) -> f64 {
    match bits {
        Bits::Eight => 0.512,
        Bits::Sixteen => 0.5,
    }
}

/// One line of a diagram.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contender {
    pub name: &'static str,
    /// Whose exact solution it is compared with.
    pub estimator: Estimator,
    /// Ours, and whether with refinement until nothing changes; else a peer.
    ours: Option<bool>,
}

/// A curve as its method serves it.
pub(super) enum Curve {
    Model(Box<TaxelModel>),
    Polynomial(Polynomial),
}

impl Curve {
    /// The count at which the curve is evaluated for `count`, and the pressure there, kPa: ours never leaves the
    /// calibrated range, which for bins ends at their mean counts.
    pub fn evaluate(&self, count: f64) -> (f64, f64) {
        match self {
            Self::Model(model) => {
                let inside = model.range.map_or(count, |[low, high]| count.max(low).min(high));
                (inside, model.evaluate(count).map_or(f64::NAN, |reading| reading.kpa))
            }
            Self::Polynomial(polynomial) => (count, polynomial.evaluate(count)),
        }
    }
}

/// What the daemon does unless it is told otherwise, at order 5.
pub(super) const DEFAULT: &str = "ours, pressure-binned (shipped default)";

/// All in the same order everywhere, so that each looks the same in every diagram.
pub(super) fn contenders(peers: &Peers) -> Vec<Contender> {
    let ours = [
        ("ours, per sample", Estimator::PerSample, Some(false)),
        (DEFAULT, Estimator::PressureBinned, Some(false)),
        ("ours, per sample, exact", Estimator::PerSample, Some(true)),
    ];
    let others = peers.names().into_iter().map(|name| (name, Estimator::PerSample, None));
    ours.into_iter().chain(others).map(|(name, estimator, ours)| Contender { name, estimator, ours }).collect()
}

impl Contender {
    pub fn is_ours(&self) -> bool {
        self.ours.is_some()
    }

    /// Whether it is ours with refinement until nothing changes.
    pub fn is_exact(&self) -> bool {
        self.ours == Some(true)
    }

    /// Fewer scans than this are none of its business.
    pub fn least_scans(&self) -> usize {
        if self.estimator == Estimator::PressureBinned { MIN_BINNED_SAMPLES as usize } else { 0 }
    }

    /// Fits one taxel.
    ///
    /// # Errors
    /// The process of numpy ended. A method that finds no curve is no error.
    pub fn fit(
        &self,
        recording: &Recording,
        taxel: usize,
        order: usize,
        peers: &mut Peers,
    ) -> anyhow::Result<Fitted<Curve>> {
        let Some(exact) = self.ours else {
            let (x, y) = (recording.taxels[taxel].counts.as_slice(), recording.kpa.as_slice());
            let Fitted { us, curve } = peers.fit(self.name, &peers::Samples { x, y, w: None }, order)?;
            return Ok(Fitted { us, curve: curve.map(Curve::Polynomial) });
        };
        let options = self.options(recording.bits, order, exact);
        let (us, model) = timed_us(|| ours(black_box(recording), taxel, &options));
        Ok(Fitted { us, curve: model.curve.is_some().then(|| Curve::Model(Box::new(model))) })
    }

    /// The plain least-squares curve on all counts: to repair a curve that is not monotone, or to leave out rare
    /// counts, is another problem than the one that is compared here.
    fn options(&self, bits: Bits, order: usize, exact: bool) -> FitOptions {
        FitOptions {
            order: Order::Fixed(order as u8),
            estimator: self.estimator,
            exact,
            bin_width_kpa: Some(bin_width_kpa(bits)),
            min_samples_at_ends: 1,
            shape: Shape::Report,
            ..FitOptions::default()
        }
    }
}

/// From samples to the model, as the daemon does it: 8 bits through running sums, more through slices.
fn ours(recording: &Recording, taxel: usize, options: &FitOptions) -> TaxelModel {
    match recording.bits {
        Bits::Eight => recording.sums(taxel).fit(options),
        Bits::Sixteen => fit(&Samples::new(&recording.taxels[taxel].counts, &recording.kpa), options),
    }
}
