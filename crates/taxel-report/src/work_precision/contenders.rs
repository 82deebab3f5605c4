//! Who competes: every method under one face.

use super::exact::{Problem, bin_width_kpa};
use super::taxels::{Bits, Recording};
use crate::numpy::Numpy;
use crate::peers::{Polynomial, fit_chebyshev_qr, fit_raw_normal, fit_raw_qr, fit_raw_svd};
use std::hint::black_box;
use std::time::Instant;
use taxel_model::{Accumulator, Estimator, FitOptions, MIN_BINNED_SAMPLES, Order, Samples, Shape, TaxelModel, fit};

type PeerFit = fn(&[f64], &[f64], Option<&[f64]>, usize) -> Option<Polynomial>;

/// How a contender fits.
#[derive(Clone, Copy, Debug)]
enum Method {
    Ours { exact: bool },
    Peer(PeerFit),
    Numpy,
}

/// One line of a diagram.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contender {
    pub name: &'static str,
    /// Whose exact solution it is compared with.
    pub problem: Problem,
    method: Method,
}

/// What a fit gives: its time, and the curve unless it failed.
pub(super) struct Fitted {
    pub us: f64,
    pub curve: Option<Curve>,
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

const PER_SAMPLE: &str = "ours, per sample";
pub(super) const BINNED: &str = "ours, pressure-binned";
pub(super) const SVD: &str = "nalgebra SVD, raw powers";
pub(super) const NUMPY: &str = "numpy.polyfit";

/// All in the same order everywhere, so that each looks the same in every diagram; numpy last, where it is there.
pub(super) fn contenders(numpy: bool) -> Vec<Contender> {
    let new = |name, problem, method| Contender { name, problem, method };
    let peer = |name, fit| new(name, Problem::PerSample, Method::Peer(fit));
    let mut all = vec![
        new(PER_SAMPLE, Problem::PerSample, Method::Ours { exact: false }),
        new(BINNED, Problem::PressureBinned, Method::Ours { exact: false }),
        new("ours, per sample, exact", Problem::PerSample, Method::Ours { exact: true }),
        peer("scaled Chebyshev, nalgebra QR", fit_chebyshev_qr),
        peer("nalgebra QR, raw powers", fit_raw_qr),
        peer(SVD, fit_raw_svd),
        peer("normal equations, raw powers", fit_raw_normal),
        new(NUMPY, Problem::PerSample, Method::Numpy),
    ];
    all.retain(|contender| numpy || !matches!(contender.method, Method::Numpy));
    all
}

impl Contender {
    pub fn is_ours(&self) -> bool {
        matches!(self.method, Method::Ours { .. })
    }

    /// Fewer scans than this are none of its business.
    pub fn least_scans(&self) -> usize {
        if self.problem == Problem::PressureBinned { MIN_BINNED_SAMPLES as usize } else { 0 }
    }

    /// Fits one taxel; `numpy` has loaded the same recording.
    ///
    /// # Errors
    /// The process of numpy ended. A method that finds no curve is no error.
    pub fn fit(
        &self,
        recording: &Recording,
        taxel: usize,
        order: usize,
        numpy: &mut Option<Numpy>,
    ) -> anyhow::Result<Fitted> {
        let start = Instant::now();
        let curve = match self.method {
            Method::Ours { exact } => {
                let options = self.options(recording.bits, order, exact);
                let model = ours(black_box(recording), taxel, &options);
                model.curve.is_some().then(|| Curve::Model(Box::new(model)))
            }
            Method::Peer(fit) => {
                let taxel = &recording.taxels[taxel];
                fit(black_box(&taxel.counts), black_box(&recording.kpa), None, order).map(Curve::Polynomial)
            }
            Method::Numpy => {
                let Some(numpy) = numpy else { anyhow::bail!("numpy takes part without its process") };
                let fitted = numpy.fit(taxel, order)?;
                let raw = |coefficients| Curve::Polynomial(Polynomial::Raw { coefficients });
                return Ok(Fitted { us: fitted.us, curve: fitted.coefficients().map(raw) });
            }
        };
        let curve = black_box(curve);
        Ok(Fitted { us: start.elapsed().as_secs_f64() * 1e6, curve })
    }

    /// The plain least-squares curve on all counts: to repair a curve that is not monotone, or to leave out rare
    /// counts, is another problem than the one that is compared here.
    fn options(&self, bits: Bits, order: usize, exact: bool) -> FitOptions {
        FitOptions {
            order: Order::Fixed(order as u8),
            estimator: match self.problem {
                Problem::PerSample => Estimator::PerSample,
                Problem::PressureBinned => Estimator::PressureBinned,
            },
            exact,
            bin_width_kpa: Some(bin_width_kpa(bits)),
            min_samples_at_ends: 1,
            shape: Shape::Report,
            ..FitOptions::default()
        }
    }
}

/// From samples to the model, as the daemon does it: 8 bits through running sums, more through slices.
pub(super) fn ours(recording: &Recording, taxel: usize, options: &FitOptions) -> TaxelModel {
    match recording.bits {
        Bits::Eight => sums(recording, taxel).fit(options),
        Bits::Sixteen => fit(&Samples::new(&recording.taxels[taxel].counts, &recording.kpa), options),
    }
}

/// The running sums of one taxel of 8 bits.
pub(super) fn sums(recording: &Recording, taxel: usize) -> Accumulator {
    let mut sums = Accumulator::new();
    sums.extend(recording.taxels[taxel].bytes.iter().copied().zip(recording.fixed.iter().copied()), 0);
    sums
}
