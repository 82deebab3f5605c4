//! Known masses on the skin: the truth that a calibration is judged by.

use crate::skin::Skin;
use taxel_skin::{Newton, TaxelIndex};
use thiserror::Error;

/// Standard gravity in m/s2 (CGPM 1901).
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// An ellipse on the unrolled surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The taxel under its centre.
    pub centre: TaxelIndex,
    /// Half its length and half its width in millimetres.
    pub semi_axes_mm: [f64; 2],
    /// Turn of the first axis from the direction around the limb, in radians.
    pub turn: f64,
}

impl Footprint {
    /// A disc of `area_mm2` about a taxel. The skin bears about one taxel per 33 mm2.
    #[must_use]
    pub fn disc(centre: TaxelIndex, area_mm2: f64) -> Self {
        let radius = (area_mm2 / std::f64::consts::PI).sqrt();
        Self { centre, semi_axes_mm: [radius; 2], turn: 0.0 }
    }
}

/// A mass that rests on the skin.
///
/// Its weight is spread over the covered taxels like the pressure of a round body on an elastic half-space,
/// p ~ sqrt(1 - r^2) (Hertz 1881): 1.5 times the mean at the centre, nothing at the rim. The pressures times the taxel
/// areas add up to the weight exactly. 1 kg on 600 mm2 presses with about 16 kPa in the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass {
    /// The mass in kilogram.
    pub kilogram: f64,
    /// Where it lies.
    pub footprint: Footprint,
}

/// Why a mass cannot lie there.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LoadError {
    /// A mass presses with a finite force, inward.
    #[error("a mass of {0} kg: expected more than 0 and at most 1000")]
    Mass(f64),
    /// The footprint needs an extent.
    #[error("a footprint of semi-axes {0} mm and {1} mm: expected both above 0, and finite")]
    Footprint(f64, f64),
    /// There is no such taxel.
    #[error("taxel {taxel} is the centre of the footprint, but the skin has {taxels} taxels")]
    Taxel {
        /// The taxel asked for.
        taxel: u16,
        /// How many the skin has.
        taxels: usize,
    },
}

impl Mass {
    /// A mass on a round area; see [`Footprint::disc`].
    #[must_use]
    pub fn on_disc(kilogram: f64, centre: TaxelIndex, area_mm2: f64) -> Self {
        Self { kilogram, footprint: Footprint::disc(centre, area_mm2) }
    }

    /// Its weight.
    #[must_use]
    pub fn weight(&self) -> Newton {
        Newton(self.kilogram * STANDARD_GRAVITY)
    }

    /// The mean pressure on each covered taxel in kPa, with the taxel's index; never empty.
    ///
    /// # Errors
    /// [`LoadError`] for a mass or footprint that is no positive finite number, or a centre that does not exist.
    pub fn pressures(&self, skin: &Skin) -> Result<Vec<(usize, f64)>, LoadError> {
        if !(self.kilogram > 0.0 && self.kilogram <= 1000.0) {
            return Err(LoadError::Mass(self.kilogram));
        }
        let [a, b] = self.footprint.semi_axes_mm;
        if !(a > 0.0 && b > 0.0 && a.is_finite() && b.is_finite() && self.footprint.turn.is_finite()) {
            return Err(LoadError::Footprint(a, b));
        }
        let (poses, taxel) = (skin.poses(), self.footprint.centre.0);
        let centre = poses.get(usize::from(taxel)).ok_or(LoadError::Taxel { taxel, taxels: poses.len() })?;
        Ok(self.spread(skin, centre.unrolled_mm))
    }

    /// The same with its centre anywhere on the unrolled surface. Where it covers no taxel, the nearest one bears all.
    pub(crate) fn spread(&self, skin: &Skin, centre_mm: [f64; 2]) -> Vec<(usize, f64)> {
        let ([a, b], poses) = (self.footprint.semi_axes_mm, skin.poses());
        let (sine, cosine) = self.footprint.turn.sin_cos();
        let away = |index: usize| {
            let [x, y] = poses[index].unrolled_mm;
            let (dx, dy) = (x - centre_mm[0], y - centre_mm[1]);
            ((cosine * dx + sine * dy) / a).powi(2) + ((cosine * dy - sine * dx) / b).powi(2)
        };
        let inside = |index: usize| {
            let square = away(index);
            (square < 1.0).then(|| (index, (1.0 - square).sqrt()))
        };
        let mut covered: Vec<(usize, f64)> = (0..poses.len()).filter_map(inside).collect();
        if covered.is_empty() {
            let nearest = (0..poses.len()).min_by(|&i, &j| away(i).total_cmp(&away(j)));
            covered.extend(nearest.map(|index| (index, 1.0)));
        }
        let total: f64 = covered.iter().map(|(_, weight)| weight).sum();
        let kpa_per_weight = self.weight().0 / (total * skin.taxel_area().0 * 1e-3);
        covered.into_iter().map(|(index, weight)| (index, weight * kpa_per_weight)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use taxel_skin::Kilopascal;

    proptest! {
        #[test]
        fn pressures_add_up_to_the_weight(
            kilogram in 0.05_f64..5.0, taxel in 0_u16..230, area in 40.0_f64..2500.0, stretch in 0.4_f64..2.5, turn in -3.0_f64..3.0,
        ) {
            let skin = Skin::forearm().unwrap();
            let mut mass = Mass::on_disc(kilogram, TaxelIndex(taxel), area);
            mass.footprint.semi_axes_mm[0] *= stretch;
            mass.footprint.turn = turn;
            let pressures = mass.pressures(&skin).unwrap();
            let force: Newton = pressures.iter().map(|(_, p)| Kilopascal(*p).on(skin.taxel_area())).sum();
            prop_assert!((force.0 - kilogram * STANDARD_GRAVITY).abs() < 1e-9 * force.0);
            prop_assert!(pressures.iter().all(|(_, p)| *p > 0.0));
        }
    }

    #[test]
    fn a_kilogram_on_a_small_disc_stays_in_the_calibrated_range() {
        let skin = Skin::forearm().unwrap();
        for centre in 0..230 {
            let pressures = Mass::on_disc(1.0, TaxelIndex(centre), 700.0).pressures(&skin).unwrap();
            let mean = pressures.iter().map(|(_, p)| p).sum::<f64>() / pressures.len() as f64;
            // At a corner of the skin most of the disc hangs over.
            assert!((6..=26).contains(&pressures.len()), "taxel {centre}: {} taxels", pressures.len());
            let corner = pressures.len() < 12;
            assert!((10.0..if corner { 55.0 } else { 28.0 }).contains(&mean), "taxel {centre}: {mean} kPa");
            assert!(corner || pressures.iter().all(|(_, p)| *p < 60.0), "taxel {centre}");
        }
    }

    #[test]
    fn impossible_loads_are_refused() {
        let skin = Skin::forearm().unwrap();
        let refused = |mass: Mass| mass.pressures(&skin).unwrap_err();
        assert!(matches!(refused(Mass::on_disc(f64::NAN, TaxelIndex(0), 100.0)), LoadError::Mass(_)));
        assert!(matches!(refused(Mass::on_disc(1.0, TaxelIndex(230), 100.0)), LoadError::Taxel { .. }));
        assert!(matches!(refused(Mass::on_disc(1.0, TaxelIndex(0), -1.0)), LoadError::Footprint(..)));
    }
}
