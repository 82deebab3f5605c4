//! What discs that press on the soft layer over the pads do to them, by the distance from their centre.
//!
//! The layer spreads pressure as a half-space does (Boussinesq 1885): what a point load gives at depth h and distance r goes
//! with `(r^2 + h^2)^(-5/2)`. A pad feels the mean over its disc.

use std::f64::consts::PI;

/// The depth of the layer and the radius of a pad, mm: iCub's foam.
const LAYER_MM: f64 = 2.0;
const PAD_MM: f64 = 2.0;
/// Entries of a profile, by the squared distance, mm2 each.
pub(super) const ENTRIES: usize = 512;
pub(super) const ENTRY_MM2: f32 = 2.0;
/// What a point load does is worked out at so many distances, mm apart.
const DISTANCES: usize = 200;
const APART_MM: f64 = 0.25;

/// Pressure of some discs of 1 N each, kPa, by squared distance from their centre.
#[derive(Clone, Debug)]
pub(super) struct Discs<const N: usize>(Box<[[f32; N]]>);

impl<const N: usize> Discs<N> {
    /// Discs of these radii in mm; those whose place is below `hertz` press as a ball does (Hertz 1881), the others alike everywhere.
    pub(super) fn new(radii_mm: [f64; N], hertz: usize) -> Self {
        let spread = spread_by_layer();
        let profiles: [_; N] = std::array::from_fn(|disc| profile(radii_mm[disc], disc < hertz, &spread));
        Self((0..ENTRIES).map(|entry| std::array::from_fn(|disc| profiles[disc][entry])).collect())
    }

    /// Their pressures so many mm2, squared, from the centre; nothing within 32 mm of it is left out.
    pub(super) fn at(&self, distance2_mm2: f32) -> [f32; N] {
        self.0[(distance2_mm2 * (1.0 / ENTRY_MM2)) as usize & (ENTRIES - 1)]
    }
}

/// What a load of 1 N at one point presses on a pad with, kPa, by distance: the mean over the pad of the half-space.
fn spread_by_layer() -> Vec<f64> {
    let point = |r2: f64| (r2 + LAYER_MM * LAYER_MM).powf(-2.5);
    let cells = || (-4..=4).map(|n| 0.25 * PAD_MM * f64::from(n));
    let pad: Vec<[f64; 2]> =
        cells().flat_map(|x| cells().map(move |y| [x, y])).filter(|[x, y]| x.hypot(*y) <= PAD_MM).collect();
    let at = |r: f64| pad.iter().map(|[x, y]| point((r - x).powi(2) + y * y)).sum::<f64>() / pad.len() as f64;
    // Over the plane the half-space adds up to 2 pi / (3 h^3).
    let newton = 1e3 * 1.5 * LAYER_MM.powi(3) / PI;
    (0..DISTANCES).map(|n| newton * at(APART_MM * n as f64)).collect()
}

/// Pressure of a disc of 1 N, kPa, by squared distance from its centre.
pub(super) fn profile(radius_mm: f64, hertz: bool, spread: &[f64]) -> Box<[f32]> {
    let cells = || (-10..=10).map(|n| 0.1 * radius_mm * f64::from(n));
    let all = cells().flat_map(|x| cells().map(move |y| [x, y]));
    let disc: Vec<[f64; 3]> = all
        .filter_map(|[x, y]| {
            let within = 1.0 - (x * x + y * y) / (radius_mm * radius_mm);
            (within >= 0.0).then(|| [x, y, if hertz { within.sqrt() } else { 1.0 }])
        })
        .collect();
    let weight: f64 = disc.iter().map(|[_, _, weight]| weight).sum();
    let at = |r: f64| {
        let of = |&[x, y, weight]: &[f64; 3]| {
            weight * spread.get(((r - x).hypot(y) / APART_MM).round() as usize).copied().unwrap_or(0.0)
        };
        disc.iter().map(of).sum::<f64>() / weight
    };
    (0..ENTRIES).map(|entry| at((f64::from(ENTRY_MM2) * (entry as f64 + 0.5)).sqrt()) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_of_a_newton_presses_with_a_newton() {
        for (radius_mm, hertz) in [(3.5, true), (10.0, true), (13.0, false)] {
            let discs = Discs::new([radius_mm], usize::from(hertz));
            // Rings of equal area, of which each entry is one.
            let newton: f64 =
                (0..ENTRIES).map(|entry| f64::from(discs.0[entry][0]) * PI * f64::from(ENTRY_MM2) * 1e-3).sum();
            assert!((newton - 1.0).abs() < 0.03, "{radius_mm} mm: {newton} N");
        }
    }
}
