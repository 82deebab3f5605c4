//! What a peer is given, and the polynomial that it gives back.

/// What is fitted: `x`, `y` and, where there are any, the weights `w`, one value a sample.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Abscissae.
    pub x: &'a [f64],
    /// Ordinates.
    pub y: &'a [f64],
    /// Weights; none means that all are 1.
    pub w: Option<&'a [f64]>,
}

impl Samples<'_> {
    pub(crate) fn root_of_weight(&self, k: usize) -> f64 {
        self.w.map_or(1.0, |w| w[k].sqrt())
    }
}

/// The functions that a polynomial is a sum of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// 1, t, t^2, ..
    Powers,
    /// 1, t, 2 t^2 - 1, ..
    Chebyshev,
}

/// What a peer gives: a polynomial in t = (x - centre) / half_width.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    /// What the coefficients belong to.
    pub basis: Basis,
    /// 0 where the abscissa is taken raw.
    pub centre: f64,
    /// 1 where the abscissa is taken raw; above 0.
    pub half_width: f64,
    /// Ascending.
    pub coefficients: Vec<f64>,
}

impl Polynomial {
    /// The value at `x`: Horner's scheme for powers, Clenshaw's for Chebyshev polynomials.
    #[must_use]
    pub fn evaluate(&self, x: f64) -> f64 {
        let (t, terms) = ((x - self.centre) / self.half_width, self.coefficients.iter().rev());
        match self.basis {
            Basis::Powers => terms.fold(0.0, |sum, c| sum * t + c),
            Basis::Chebyshev => {
                let (b1, b2) = terms.fold((0.0, 0.0), |(b1, b2), c| (2.0 * t * b1 - b2 + c, b1));
                b1 - t * b2
            }
        }
    }
}

/// A fit with its time.
#[derive(Clone, Debug)]
pub struct Fitted<Curve = Polynomial> {
    /// By the method's own clock, us.
    pub us: f64,
    /// `None` where the method gives no finite curve.
    pub curve: Option<Curve>,
}
