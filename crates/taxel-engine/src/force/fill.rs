//! What lies on unread taxels under a contact, by made-up contacts that fit the read ones.
//!
//! A mean of the taxels beside one takes the slope of a contact for an error, and levels its peak. So discs of a few sizes at places
//! about the centre of pressure, each scaled to fit best, are weighted by `exp(-chi2 / 2)`: their mean is what an unread taxel bears,
//! and to that comes what they leave of the taxels beside it in the mean. Its standard uncertainty is the spread of the discs that
//! fit, and what they leave beside it. Where no disc fits well, chi2 counts less: contacts are no discs.

use nalgebra::Vector3;
use taxel_skin::{Geometry, TaxelPose};

use crate::force::discs::Discs;

/// Radii of the discs, mm: three after Hertz, and a flat one.
const RADII_MM: [f64; 4] = [5.0, 7.0, 10.0, 13.0];
const HERTZ: usize = 3;
/// How far places lie apart, and from the centre of pressure at most, mm.
const STEP_MM: f32 = 2.0;
const FROM_CENTRE_MM: f32 = 6.0;
/// Taxels within this distance of the centre of pressure are compared, mm.
const REACH_MM: f64 = 17.0;
/// Error of a read pressure in kPa, and as a share of the peak: with it discs fit contacts that are none in the mean.
const NOISE_KPA: f32 = 0.35;
const SHAPE_SHARE: f32 = 0.06;
/// A chi2 that a contact of some twenty taxels leaves though it is a disc.
const CHI2_OF_DISC: f32 = 6.0;
/// Discs of an exponent below this say nothing: exp(-9.2) is 1e-4.
const NO_WEIGHT: f32 = -9.2;
/// An unread taxel bears so many times the most of those beside it at most.
const MOST_OF_BESIDE: f64 = 1.6;

/// A number of each size.
type BySize = [f32; RADII_MM.len()];

/// The made-up contacts.
#[derive(Clone, Debug)]
pub struct MadeUp {
    discs: Discs<{ RADII_MM.len() }>,
    /// Places about the centre of pressure, mm.
    places: Vec<[f32; 2]>,
}

/// A taxel near a contact.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Where, in mm in the plane of the contact, from its centre of pressure.
    pub place_mm: [f32; 2],
    /// What it reads, kPa; `None` for one that cannot be read.
    pub kpa: Option<f64>,
}

impl MadeUp {
    /// Worked out once.
    pub fn new() -> Self {
        let steps = (FROM_CENTRE_MM / STEP_MM) as i16;
        let along = || (-steps..=steps).map(|step| STEP_MM * f32::from(step));
        let all = along().flat_map(|x| along().map(move |y| [x, y]));
        let places = all.filter(|[x, y]| x.hypot(*y) <= FROM_CENTRE_MM).collect();
        Self { discs: Discs::new(RADII_MM, HERTZ), places }
    }

    /// What each of `near` bears by the discs that fit those that are read, and the spread of that, kPa.
    pub fn fit(&self, near: &[Near]) -> Vec<[f64; 2]> {
        let fits = self.scaled(near);
        let least = fits.as_flattened().iter().map(|fit| fit.chi2).fold(f32::INFINITY, f32::min).max(0.0);
        let temper = -0.5 / (least / CHI2_OF_DISC).max(1.0);
        let mut found = vec![[0.0; 2]; near.len()];
        let mut all = 0.0;
        for (place, fits) in self.places.iter().zip(&fits) {
            let exponents = fits.map(|fit| temper * (fit.chi2 - least));
            if exponents.iter().all(|exponent| *exponent < NO_WEIGHT) {
                continue;
            }
            let weights = exponents.map(f32::exp);
            all += weights.iter().sum::<f32>();
            for ([mean, square], taxel) in found.iter_mut().zip(near) {
                for ((weight, fit), shape) in weights.iter().zip(fits).zip(self.shape(place, taxel)) {
                    let kpa = fit.newton * shape;
                    *mean += weight * kpa;
                    *square += weight * kpa * kpa;
                }
            }
        }
        for [mean, square] in &mut found {
            *mean /= all;
            *square = (*square / all - *mean * *mean).max(0.0).sqrt();
        }
        found.into_iter().map(|fit| fit.map(f64::from)).collect()
    }

    /// How the discs of each place fit best.
    fn scaled(&self, near: &[Near]) -> Vec<[DiscFit; RADII_MM.len()]> {
        let read: Vec<(f32, &Near)> = near.iter().filter_map(|taxel| Some((taxel.kpa? as f32, taxel))).collect();
        let peak = read.iter().fold(0.0, |peak, (kpa, _)| kpa.max(peak));
        let per_variance = 1.0 / (NOISE_KPA.powi(2) + (SHAPE_SHARE * peak).powi(2));
        let squares: f32 = read.iter().map(|(kpa, _)| kpa * kpa).sum();
        let of_place = |place: &[f32; 2]| {
            let (mut product, mut own) = (BySize::default(), [1e-9; RADII_MM.len()]);
            for (kpa, taxel) in &read {
                for ((product, own), shape) in product.iter_mut().zip(&mut own).zip(self.shape(place, taxel)) {
                    *product += shape * kpa;
                    *own += shape * shape;
                }
            }
            std::array::from_fn(|size| {
                let newton = (product[size] / own[size]).max(0.0);
                DiscFit { newton, chi2: (squares - newton * product[size]) * per_variance }
            })
        };
        self.places.iter().map(of_place).collect()
    }

    /// What the discs of a place press on a taxel with, kPa for 1 N.
    fn shape(&self, place: &[f32; 2], taxel: &Near) -> BySize {
        let [x, y] = [taxel.place_mm[0] - place[0], taxel.place_mm[1] - place[1]];
        self.discs.at(x * x + y * y)
    }
}

/// A disc that is scaled to what is read.
#[derive(Clone, Copy, Debug)]
struct DiscFit {
    newton: f32,
    chi2: f32,
}

/// The taxels near the centre of pressure of a contact that has `pressed` on taxels with so many kPa, ascending, and what `read` says
/// they read; those that are `of_another` are left out. `None` without normals.
pub fn near(
    geometry: &Geometry,
    pressed: impl Iterator<Item = (usize, f64)>,
    of_another: impl Fn(usize) -> bool,
    read: impl Fn(usize) -> Option<f64>,
) -> Option<(Vec<usize>, Vec<Near>)> {
    let (mut centre, mut normal, mut all) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for (taxel, kpa) in pressed {
        let TaxelPose { position, normal: up } = geometry.poses.get(taxel).copied().flatten()?;
        centre += kpa * Vector3::from(position);
        normal += kpa * Vector3::from(up);
        all += kpa;
    }
    let normal = normal.try_normalize(0.5 * all)?;
    let across = if normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    let along = normal.cross(&across).normalize();
    let (centre, across) = (centre / all, normal.cross(&along));
    let near = geometry.poses.iter().enumerate().filter_map(|(taxel, pose)| {
        let from_mm = 1e3 * (Vector3::from((*pose)?.position) - centre);
        let is_near = from_mm.norm_squared() < REACH_MM * REACH_MM && !of_another(taxel);
        is_near.then(|| {
            (taxel, Near { place_mm: [from_mm.dot(&along) as f32, from_mm.dot(&across) as f32], kpa: read(taxel) })
        })
    });
    Some(near.unzip())
}

/// What an unread taxel bears and its standard uncertainty, kPa, where discs have `fit` it so; `beside` are what those beside it read
/// and what the discs say there.
pub fn of_unread([mean, spread]: [f64; 2], beside: impl Iterator<Item = [f64; 2]>) -> (f64, f64) {
    let (mut left, mut squares, mut most, mut n) = (0.0, 0.0, 0.0_f64, 0.0);
    for [kpa, disc] in beside {
        left += kpa - disc;
        squares += (kpa - disc).powi(2);
        most = most.max(kpa);
        n += 1.0;
    }
    let n = f64::max(n, 1.0);
    let kpa = (mean + left / n).max(0.0);
    let bounded = kpa.min(MOST_OF_BESIDE * most);
    (bounded, spread.hypot(kpa - bounded).hypot((squares / n).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pads 6.5 mm apart about the centre of a disc that is not one of the library, and what they read of it.
    fn pressed(radius_mm: f64, centre_mm: [f32; 2], kpa: f64) -> Vec<Near> {
        let disc = Discs::new([radius_mm], 1);
        let peak = f64::from(disc.at(0.0)[0]);
        let rows = (-3..=3).flat_map(|row: i16| (-3..=3).map(move |k: i16| (row, k)));
        let places = rows.map(|(row, k)| [6.5 * (f32::from(k) + 0.5 * f32::from(row)), 5.63 * f32::from(row)]);
        let read = |[x, y]: [f32; 2]| {
            let at = disc.at((x - centre_mm[0]).powi(2) + (y - centre_mm[1]).powi(2));
            kpa * f64::from(at[0]) / peak
        };
        places
            .filter(|[x, y]| f64::from(x.hypot(*y)) < REACH_MM)
            .map(|place_mm| Near { place_mm, kpa: Some(read(place_mm)) })
            .collect()
    }

    #[test]
    fn an_unread_taxel_is_told_by_the_discs_that_fit_those_about_it_better_than_by_their_mean() {
        let discs = MadeUp::new();
        let (mut error, mut of_mean, mut sigma) = (0.0, 0.0, 0.0);
        for (radius_mm, centre_mm) in [(6.0, [1.3, -0.8]), (8.0, [-2.0, 1.0]), (6.5, [0.0, 3.0])] {
            let all = pressed(radius_mm, centre_mm, 30.0);
            for unread in 0..all.len() {
                let mut near = all.clone();
                let Some(truth) = near[unread].kpa.take() else { continue };
                let fit = discs.fit(&near);
                let apart = |n: &usize| {
                    let [a, b] = [near[*n].place_mm, near[unread].place_mm];
                    *n != unread && (a[0] - b[0]).hypot(a[1] - b[1]) < 8.0
                };
                let beside: Vec<[f64; 2]> =
                    (0..near.len()).filter(apart).map(|n| [near[n].kpa.unwrap(), fit[n][0]]).collect();
                let mean = beside.iter().map(|[kpa, _]| kpa).sum::<f64>() / beside.len() as f64;
                let (kpa, sigma_kpa) = of_unread(fit[unread], beside.into_iter());
                error += (kpa - truth).powi(2);
                of_mean += (mean - truth).powi(2);
                sigma += sigma_kpa.powi(2);
            }
        }
        assert!(error < 0.25 * of_mean, "{error} {of_mean}");
        assert!(sigma > 0.5 * error, "{sigma} {error}");
    }

    #[test]
    fn nothing_that_is_read_is_nothing_on_what_is_not() {
        let near: Vec<Near> =
            pressed(6.0, [0.0; 2], 0.0).into_iter().chain([Near { place_mm: [1.0, 1.0], kpa: None }]).collect();
        let fit = MadeUp::new().fit(&near);
        assert!(fit.iter().flatten().all(|kpa| *kpa == 0.0), "{fit:?}");
        assert_eq!(of_unread([5.0, 1.0], [[0.0, 0.0]].into_iter()).0, 0.0, "bounded by those beside it");
    }
}
