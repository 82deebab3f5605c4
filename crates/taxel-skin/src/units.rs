//! Physical quantities that must not be mixed up.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Sub};

/// Differential pressure in kilopascal: ambient minus bag for a calibration, contact pressure live.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Kilopascal(pub f64);

/// Force in newton.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Newton(pub f64);

/// Area in square millimetres.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct SquareMillimetre(pub f64);

impl SquareMillimetre {
    /// The area that one taxel of an iCub triangle stands for: 24 mm x 27 mm / 2 / 10,
    /// the constant of IIT's published insole calibration (Belli et al. 2023).
    pub const ICUB_TAXEL: Self = Self(32.4);
}

impl Kilopascal {
    /// The normal force of this pressure on `area`: 1 kPa on 1 mm2 is 1e-3 N.
    #[must_use]
    pub fn on(self, area: SquareMillimetre) -> Newton {
        Newton(self.0 * area.0 * 1e-3)
    }
}

impl Add for Newton {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl AddAssign for Newton {
    fn add_assign(&mut self, other: Self) {
        self.0 += other.0;
    }
}

impl Sum for Newton {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self(0.0), Add::add)
    }
}

impl Sub for Kilopascal {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}
