//! A synthetic skin to evaluate: fitted models, the exact pressure of every count, and streams of counts.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use taxel_model::{Accumulator, Curve, Dd, FitOptions, FixedPressure, Order, TaxelModel};

/// Count at rest, as the boards' tare makes it.
pub const REST_COUNT: f64 = 240.0;

/// Samples of one taxel's calibration: a ramp to 70 kPa at a step of 0.1 kPa.
const RAMP_SAMPLES: u32 = 700;
const RAMP_STEP_KPA: f64 = 0.1;

/// Standard deviation of a count, as of iCub's boards.
const NOISE_COUNTS: f64 = 0.7;

/// Scans that a stream of counts consists of: enough for a walk to differ from scan to scan, and few enough that the
/// counts themselves stay in the second-level cache.
pub const SCANS: usize = 16;

/// What a polynomial on a range needs to be evaluated, whatever its form.
#[derive(Clone, Debug)]
pub struct Taxel {
    /// The curve as the daemon keeps it.
    pub curve: Curve,
    /// The same in powers of the raw count, each coefficient correctly rounded.
    pub raw: Vec<f64>,
    /// Ends of the calibrated range, counts.
    pub range: [f64; 2],
}

impl Taxel {
    /// The pressure at `count`, held at the ends of the range, to about 30 digits, kPa.
    ///
    /// Clenshaw's rule in double-double arithmetic on the coefficients as they are.
    #[must_use]
    pub fn exact(&self, count: u8) -> Dd {
        let inside = f64::from(count).max(self.range[0]).min(self.range[1]);
        let s = Dd::sum(inside, -self.curve.centre).div_f64(self.curve.half_width);
        let (mut b1, mut b2) = (Dd::ZERO, Dd::ZERO);
        for &c in self.curve.chebyshev.iter().skip(1).rev() {
            (b1, b2) = ((s * b1).scale_exact(2.0) - b2 + Dd::from(c), b1);
        }
        s * b1 - b2 + Dd::from(self.curve.chebyshev.first().copied().unwrap_or(0.0))
    }

    /// Coefficients in powers of s = (C - centre) / half width, kPa.
    #[must_use]
    pub fn scaled(&self) -> Vec<f64> {
        let n = self.curve.chebyshev.len();
        let mut powers = vec![0.0; n];
        // Powers of T_{k-1} and T_k; T_{k+1} = 2 s T_k - T_{k-1}.
        let (mut last, mut this) = (vec![0.0; n], vec![0.0; n]);
        this[0] = 1.0;
        for (k, c) in self.curve.chebyshev.iter().enumerate() {
            powers.iter_mut().zip(&this).for_each(|(power, t)| *power += c * t);
            let factor = if k == 0 { 1.0 } else { 2.0 };
            let next = (0..n).map(|j| factor * if j > 0 { this[j - 1] } else { 0.0 } - last[j]).collect();
            (last, this) = (this, next);
        }
        powers
    }
}

/// `taxels` models of one order, fitted as the daemon fits them, every taxel with a response of its own: counts fall by
/// 40 to 180 and by half of that at 15 to 65 kPa.
#[must_use]
pub fn models(taxels: usize, order: u8, seed: u64) -> Vec<TaxelModel> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let options = FitOptions { order: Order::Fixed(order), ..FitOptions::default() };
    let model = |_| {
        let (swing, half_kpa) = (random.random_range(40.0..180.0), random.random_range(15.0..65.0));
        let mut sums = Accumulator::new();
        let samples = (0..RAMP_SAMPLES).map(|step| {
            let kpa = f64::from(step) * RAMP_STEP_KPA;
            let count = REST_COUNT - swing * kpa / (kpa + half_kpa) + NOISE_COUNTS * normal(&mut random);
            (count.round().clamp(0.0, 255.0) as u8, FixedPressure::from_kpa(kpa))
        });
        sums.extend(samples, 0);
        sums.fit(&options)
    };
    (0..taxels).map(model).collect()
}

/// The taxels of `models` that have a curve.
#[must_use]
pub fn taxels(models: &[TaxelModel]) -> Vec<Taxel> {
    let of = |model: &TaxelModel| {
        let (curve, raw) = (model.curve.clone()?, model.raw_coefficients.clone());
        Some(Taxel { curve, raw, range: model.range? })
    };
    models.iter().filter_map(of).collect()
}

/// How counts go on from scan to scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Every count moves by -1, 0 or 1.
    Walk,
    /// Every count is drawn anew.
    Independent,
    /// Counts at rest but for their noise of a count; one run of twenty taxels in twenty is pressed and walks.
    Touch,
}

/// [`SCANS`] scans of one count per taxel, all within the taxels' ranges.
#[must_use]
pub fn stream(taxels: &[Taxel], course: Course, seed: u64) -> Vec<Vec<u8>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let ends = |taxel: &Taxel| (taxel.range[0].ceil() as u8, taxel.range[1].floor() as u8);
    let mut draw = |taxel: &Taxel| {
        let (low, high) = ends(taxel);
        random.random_range(low..=high.max(low))
    };
    let mut counts: Vec<u8> = taxels.iter().map(&mut draw).collect();
    // Rest may lie beyond the calibrated range.
    let rest = |taxel: usize| course == Course::Touch && !(taxel / 20).is_multiple_of(20);
    let mut scans = Vec::with_capacity(SCANS);
    let mut steps = ChaCha8Rng::seed_from_u64(seed ^ 1);
    for _ in 0..SCANS {
        match course {
            Course::Independent => counts = taxels.iter().map(&mut draw).collect(),
            Course::Walk | Course::Touch => {
                for (at, (count, taxel)) in counts.iter_mut().zip(taxels).enumerate() {
                    let (low, high) = ends(taxel);
                    let step = steps.random_range(-1_i16..=1);
                    let walked = (i16::from(*count) + step).clamp(i16::from(low), i16::from(high.max(low)));
                    *count = if rest(at) { REST_COUNT as i16 + step } else { walked } as u8;
                }
            }
        }
        scans.push(counts.clone());
    }
    scans
}

/// Standard normal (Box and Muller 1958).
fn normal(random: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random_range(0.0..1.0_f64)).ln()).sqrt();
    radius * random.random_range(0.0..std::f64::consts::TAU).cos()
}
