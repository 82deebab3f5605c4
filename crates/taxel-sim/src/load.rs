//! Known masses on the skin: the truth that a calibration is judged by.

use crate::skin::Skin;
use taxel_skin::{Newton, TaxelIndex};
use thiserror::Error;

/// Standard gravity in m/s2 (CGPM 1901).
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// How the pressure of a load is spread over its footprint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Of a round body on an elastic half-space, p ~ sqrt(1 - r^2) (Hertz 1881): 1.5 times the mean at the centre,
    /// nothing at the rim.
    #[default]
    Hertz,
    /// The same everywhere.
    Flat,
}

/// An ellipse on the unrolled surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The taxel near its centre.
    pub centre: TaxelIndex,
    /// Its centre about that taxel in millimetres, around and along the limb.
    pub offset_mm: [f64; 2],
    /// Half its length and half its width in millimetres.
    pub semi_axes_mm: [f64; 2],
    /// Turn of the first axis from the direction around the limb, in radians.
    pub turn: f64,
    /// How its pressure is spread.
    pub profile: Profile,
    /// By how much the pressure grows from its centre to the end of its first axis, relative; -1 to 1.
    pub tilt: f64,
}

impl Footprint {
    /// A disc of `area_mm2` about a taxel. The skin bears about one taxel per 33 mm2.
    #[must_use]
    pub fn disc(centre: TaxelIndex, area_mm2: f64) -> Self {
        let radius = (area_mm2 / std::f64::consts::PI).sqrt();
        Self { centre, offset_mm: [0.0; 2], semi_axes_mm: [radius; 2], turn: 0.0, profile: Profile::Hertz, tilt: 0.0 }
    }

    /// Where its centre lies on the unrolled surface, in millimetres.
    ///
    /// # Errors
    /// [`LoadError::Taxel`] for a taxel that the skin has not.
    pub fn centre_mm(&self, skin: &Skin) -> Result<[f64; 2], LoadError> {
        let (poses, taxel) = (skin.poses(), self.centre.0);
        let pose = poses.get(usize::from(taxel)).ok_or(LoadError::Taxel { taxel, taxels: poses.len() })?;
        Ok([pose.unrolled_mm[0] + self.offset_mm[0], pose.unrolled_mm[1] + self.offset_mm[1]])
    }

    /// Share of its area that lies on the skin, 0 to 1.
    ///
    /// # Errors
    /// [`LoadError::Taxel`] for a taxel that the skin has not.
    pub fn share_on_skin(&self, skin: &Skin) -> Result<f64, LoadError> {
        let [x, y] = self.centre_mm(skin)?;
        let outline = Self { profile: Profile::Flat, tilt: 0.0, ..*self };
        let density = outline.density();
        let (mut all, mut on) = (0_u32, 0_u32);
        for [dx, dy] in outline.grid().filter(|&[dx, dy]| density(dx, dy) > 0.0) {
            all += 1;
            on += u32::from(skin.covers([x + dx, y + dy]));
        }
        Ok(f64::from(on) / f64::from(all.max(1)))
    }

    /// The pressure at points about its centre in millimetres, up to a factor; nothing outside.
    pub(crate) fn density(&self) -> impl Fn(f64, f64) -> f64 + use<> {
        let (in_axes, profile, tilt) = (self.in_axes(), self.profile, self.tilt);
        move |dx, dy| {
            let [u, v] = in_axes(dx, dy);
            // Without a branch, so that several points may be worked out at a time.
            let within = (1.0 - (u.powi(2) + v.powi(2))).max(0.0);
            let pressure = match profile {
                Profile::Hertz => within.sqrt(),
                Profile::Flat => f64::from(u8::from(within > 0.0)),
            };
            pressure * (1.0 + tilt * u)
        }
    }

    /// Points about its centre in units of its half axes.
    fn in_axes(&self) -> impl Fn(f64, f64) -> [f64; 2] + use<> {
        let ([a, b], (sine, cosine)) = (self.semi_axes_mm.map(f64::recip), self.turn.sin_cos());
        move |dx, dy| [a * (cosine * dx + sine * dy), b * (cosine * dy - sine * dx)]
    }

    /// How far points are from its centre in units of its half axes; 1 at the rim.
    pub(crate) fn distance(&self) -> impl Fn(f64, f64) -> f64 + use<> {
        let in_axes = self.in_axes();
        move |dx, dy| {
            let [u, v] = in_axes(dx, dy);
            u.hypot(v)
        }
    }

    /// Points of a square grid about its centre that hold the whole ellipse, in millimetres.
    pub(crate) fn grid(&self) -> impl Iterator<Item = [f64; 2]> + use<> {
        let (steps, step_mm) = (self.half_steps(), self.step_mm());
        let along = move || (-steps..=steps).map(move |n| f64::from(n) * step_mm);
        along().flat_map(move |x| along().map(move |y| [x, y]))
    }

    /// Distance of the grid's points, in millimetres: a twelfth of the smaller half axis, half a millimetre at most.
    pub(crate) fn step_mm(&self) -> f64 {
        (self.semi_axes_mm[0].min(self.semi_axes_mm[1]) / 12.0).clamp(0.05, 0.5)
    }

    fn half_steps(&self) -> i32 {
        // At most a metre across, so that no footprint takes memory or time without end.
        ((self.semi_axes_mm[0].max(self.semi_axes_mm[1]) / self.step_mm()).ceil() as i32).min(2_000)
    }
}

/// A mass that rests on the skin.
///
/// What of it reaches which taxel says [`crate::LoadPath`]. 1 kg on 600 mm2 presses with about 16 kPa in the mean.
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
    /// There is no such taxel.
    #[error("taxel {taxel} is the centre of the footprint, but the skin has {taxels} taxels")]
    Taxel {
        /// The taxel asked for.
        taxel: u16,
        /// How many the skin has.
        taxels: usize,
    },
    /// There is no skin under it.
    #[error("the footprint lies beside the skin: expected at least a part of it on the skin")]
    BesideTheSkin,
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
}
