//! Ways to turn a scan of counts into pressures, all of them safe Rust that the compiler vectorises by itself or not.
//!
//! Every method does the same task: one count per taxel in, one f32 pressure per taxel out, counts beyond the
//! calibrated range held at its ends.

use std::ops::{Add, Mul, Sub};

use crate::live::skin::Taxel;

/// Taxels that are evaluated side by side.
pub const LANES: usize = 16;

/// Entries from one taxel's table to the next, as in `taxel_engine::force`: tables a power of two apart would
/// compete for the same sets of the cache.
const TABLE_STRIDE: usize = 256 + 16;

/// Steps of the fixed-point table in a kilopascal, and the pressure of entry 0: 112 kPa fit 16 bits, and a curve may
/// run a few kPa below zero at rest.
const FIXED_PER_KPA: f64 = 512.0;
const FIXED_LEAST_KPA: f64 = -16.0;

/// A scan of counts to pressures in kPa; both slices have one entry per taxel.
pub trait Method {
    /// Evaluates one scan.
    fn evaluate(&self, counts: &[u8], kpa: &mut [f32]);
}

/// The type that a polynomial is evaluated in.
pub trait Real: Copy + PartialOrd + From<u8> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The nearest number of this type.
    fn nearest(value: f64) -> Self;
    /// The nearest f32.
    fn to_f32(self) -> f32;
}

impl Real for f32 {
    fn nearest(value: f64) -> Self {
        value as Self
    }
    fn to_f32(self) -> f32 {
        self
    }
}

impl Real for f64 {
    fn nearest(value: f64) -> Self {
        value
    }
    fn to_f32(self) -> f32 {
        self as f32
    }
}

/// How a polynomial is written and evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Horner's rule in powers of the raw count.
    RawHorner,
    /// Horner's rule in powers of s = (C - centre) / half width.
    ScaledHorner,
    /// Clenshaw's rule on Chebyshev polynomials of s.
    Clenshaw,
}

const RAW: u8 = Form::RawHorner as u8;
const CLENSHAW: u8 = Form::Clenshaw as u8;

/// [`LANES`] taxels with `N` coefficients each, coefficient by coefficient, so that one load serves all lanes.
#[derive(Clone, Debug)]
struct Block<T, const N: usize> {
    low: [T; LANES],
    high: [T; LANES],
    centre: [T; LANES],
    per_half_width: [T; LANES],
    coefficients: [[T; LANES]; N],
}

impl<T: Real, const N: usize> Block<T, N> {
    fn new(taxels: &[Taxel], form: Form) -> Self {
        let each = |value: &dyn Fn(&Taxel) -> f64| -> [T; LANES] {
            std::array::from_fn(|lane| T::nearest(taxels.get(lane).map_or(0.0, value)))
        };
        let lists: Vec<Vec<f64>> = taxels
            .iter()
            .map(|taxel| match form {
                Form::RawHorner => taxel.raw.clone(),
                Form::ScaledHorner => taxel.scaled(),
                Form::Clenshaw => taxel.curve.chebyshev.clone(),
            })
            .collect();
        let coefficient = |k: usize, lane: usize| lists.get(lane).and_then(|list| list.get(k)).copied().unwrap_or(0.0);
        Self {
            low: each(&|taxel| taxel.range[0]),
            high: each(&|taxel| taxel.range[1]),
            centre: each(&|taxel| taxel.curve.centre),
            per_half_width: each(&|taxel| 1.0 / taxel.curve.half_width),
            coefficients: std::array::from_fn(|k| std::array::from_fn(|lane| T::nearest(coefficient(k, lane)))),
        }
    }

    #[inline]
    fn evaluate<const FORM: u8>(&self, counts: &[u8; LANES]) -> [f32; LANES] {
        let mut x: [T; LANES] = std::array::from_fn(|lane| clamped(counts[lane], self.low[lane], self.high[lane]));
        if FORM != RAW {
            x = std::array::from_fn(|lane| (x[lane] - self.centre[lane]) * self.per_half_width[lane]);
        }
        let value = if FORM == CLENSHAW { self.clenshaw(&x) } else { self.horner(&x) };
        value.map(T::to_f32)
    }

    #[inline]
    fn horner(&self, x: &[T; LANES]) -> [T; LANES] {
        let mut value = self.coefficients[N - 1];
        for coefficients in self.coefficients[..N - 1].iter().rev() {
            value = std::array::from_fn(|lane| value[lane] * x[lane] + coefficients[lane]);
        }
        value
    }

    #[inline]
    fn clenshaw(&self, s: &[T; LANES]) -> [T; LANES] {
        let twice: [T; LANES] = std::array::from_fn(|lane| s[lane] + s[lane]);
        let (mut b1, mut b2) = (self.coefficients[N - 1], [T::nearest(0.0); LANES]);
        for coefficients in self.coefficients[1..N - 1].iter().rev() {
            let b = std::array::from_fn(|lane| twice[lane] * b1[lane] - b2[lane] + coefficients[lane]);
            (b1, b2) = (b, b1);
        }
        std::array::from_fn(|lane| s[lane] * b1[lane] - b2[lane] + self.coefficients[0][lane])
    }
}

#[inline]
fn clamped<T: Real>(count: u8, low: T, high: T) -> T {
    let count = T::from(count);
    let count = if count > low { count } else { low };
    if count < high { count } else { high }
}

/// A polynomial of `N` coefficients per taxel, evaluated in `T` by the rule `FORM`.
struct Polynomial<T, const N: usize, const FORM: u8>(Vec<Block<T, N>>);

impl<T: Real, const N: usize, const FORM: u8> Method for Polynomial<T, N, FORM> {
    fn evaluate(&self, counts: &[u8], kpa: &mut [f32]) {
        let (counts, counts_left) = counts.as_chunks::<LANES>();
        let (kpa, kpa_left) = kpa.as_chunks_mut::<LANES>();
        for ((block, counts), kpa) in self.0.iter().zip(counts).zip(kpa) {
            *kpa = block.evaluate::<FORM>(counts);
        }
        if let Some(block) = self.0.last().filter(|_| !counts_left.is_empty()) {
            let mut padded = [0; LANES];
            padded[..counts_left.len()].copy_from_slice(counts_left);
            kpa_left.copy_from_slice(&block.evaluate::<FORM>(&padded)[..counts_left.len()]);
        }
    }
}

/// The polynomials of `taxels` in form `form`, evaluated in `T`; `None` for an order other than 3, 5 and 9.
#[must_use]
pub fn polynomial<T: Real + 'static>(taxels: &[Taxel], order: u8, form: Form) -> Option<Box<dyn Method>> {
    match order {
        3 => Some(with_coefficients::<T, 4>(taxels, form)),
        5 => Some(with_coefficients::<T, 6>(taxels, form)),
        9 => Some(with_coefficients::<T, 10>(taxels, form)),
        _ => None,
    }
}

fn with_coefficients<T: Real + 'static, const N: usize>(taxels: &[Taxel], form: Form) -> Box<dyn Method> {
    let blocks: Vec<Block<T, N>> = taxels.chunks(LANES).map(|taxels| Block::new(taxels, form)).collect();
    match form {
        Form::RawHorner => Box::new(Polynomial::<T, N, { Form::RawHorner as u8 }>(blocks)),
        Form::ScaledHorner => Box::new(Polynomial::<T, N, { Form::ScaledHorner as u8 }>(blocks)),
        Form::Clenshaw => Box::new(Polynomial::<T, N, { Form::Clenshaw as u8 }>(blocks)),
    }
}

/// One taxel after the other, sum of c_k C^k with `powi`, in f64: what most would write first.
pub struct Naive(Vec<Taxel>);

impl Naive {
    /// The taxels as they are.
    #[must_use]
    pub fn new(taxels: &[Taxel]) -> Self {
        Self(taxels.to_vec())
    }
}

impl Method for Naive {
    fn evaluate(&self, counts: &[u8], kpa: &mut [f32]) {
        for ((taxel, &count), kpa) in self.0.iter().zip(counts).zip(kpa) {
            let count = f64::from(count).max(taxel.range[0]).min(taxel.range[1]);
            *kpa = taxel.raw.iter().enumerate().map(|(k, c)| c * count.powi(k as i32)).sum::<f64>() as f32;
        }
    }
}

/// A table of 256 pressures per taxel, as the engine keeps its forces.
pub struct FullTable(Vec<[f32; TABLE_STRIDE]>);

impl FullTable {
    /// The nearest f32 of every pressure.
    #[must_use]
    pub fn new(exact_kpa: &[[f64; 256]]) -> Self {
        let table = |exact: &[f64; 256]| {
            let mut table = [0.0; TABLE_STRIDE];
            table.iter_mut().zip(exact).for_each(|(entry, kpa)| *entry = *kpa as f32);
            table
        };
        Self(exact_kpa.iter().map(table).collect())
    }
}

impl Method for FullTable {
    fn evaluate(&self, counts: &[u8], kpa: &mut [f32]) {
        for ((table, &count), kpa) in self.0.iter().zip(counts).zip(kpa) {
            *kpa = table[usize::from(count)];
        }
    }
}

/// The same in 16 bits of 1/512 kPa: half the memory.
pub struct FixedTable(Vec<[u16; TABLE_STRIDE]>);

impl FixedTable {
    /// The nearest step of every pressure.
    #[must_use]
    pub fn new(exact_kpa: &[[f64; 256]]) -> Self {
        let table = |exact: &[f64; 256]| {
            let mut table = [0; TABLE_STRIDE];
            table.iter_mut().zip(exact).for_each(|(entry, kpa)| {
                *entry = ((kpa - FIXED_LEAST_KPA) * FIXED_PER_KPA).round() as u16;
            });
            table
        };
        Self(exact_kpa.iter().map(table).collect())
    }
}

impl Method for FixedTable {
    fn evaluate(&self, counts: &[u8], kpa: &mut [f32]) {
        const KPA: f32 = (1.0 / FIXED_PER_KPA) as f32;
        for ((table, &count), kpa) in self.0.iter().zip(counts).zip(kpa) {
            *kpa = f32::from(table[usize::from(count)]) * KPA + FIXED_LEAST_KPA as f32;
        }
    }
}

/// Where the entries of a trimmed table lie.
#[derive(Clone, Copy, Debug)]
struct Span {
    first: u32,
    low: u8,
    high: u8,
}

/// Tables of the calibrated range alone, one after the other.
pub struct TrimmedTable {
    spans: Vec<Span>,
    kpa: Vec<f32>,
}

impl TrimmedTable {
    /// The entries of `taxels` from one end of the range to the other, and one beyond each end that is not whole.
    #[must_use]
    pub fn new(taxels: &[Taxel], exact_kpa: &[[f64; 256]]) -> Self {
        let mut trimmed = Self { spans: Vec::with_capacity(taxels.len()), kpa: Vec::new() };
        for (taxel, exact) in taxels.iter().zip(exact_kpa) {
            let (low, high) = (taxel.range[0].floor() as u8, taxel.range[1].ceil() as u8);
            trimmed.spans.push(Span { first: trimmed.kpa.len() as u32, low, high });
            trimmed.kpa.extend(exact[usize::from(low)..=usize::from(high)].iter().map(|kpa| *kpa as f32));
        }
        trimmed
    }
}

impl Method for TrimmedTable {
    fn evaluate(&self, counts: &[u8], kpa: &mut [f32]) {
        for ((span, &count), kpa) in self.spans.iter().zip(counts).zip(kpa) {
            let entry = span.first as usize + usize::from(count.max(span.low).min(span.high) - span.low);
            // The bound is always kept; the check costs less than what would follow from a wrong one.
            *kpa = self.kpa.get(entry).copied().unwrap_or(f32::NAN);
        }
    }
}

/// No pressure at all: every count is loaded, converted and stored. Nothing that reads counts is faster.
pub struct Floor;

impl Method for Floor {
    fn evaluate(&self, counts: &[u8], kpa: &mut [f32]) {
        for (&count, kpa) in counts.iter().zip(kpa) {
            *kpa = f32::from(count);
        }
    }
}
