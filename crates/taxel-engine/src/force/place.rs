//! What a sum over taxels reads of a contact, by where it lies between the pads and how large it is.
//!
//! Pads are points some 6 mm apart. A fingertip on top of one is read too high, one between three too low, by a tenth and more. How large
//! a contact is follows from how many taxels carry it in effect (`sampling.rs`): it is the disc that as many carry. Where it lies
//! follows from its centre of pressure, which pads draw towards themselves as they do that of the disc. What the taxels read of a newton
//! of that disc is what they read of one of the contact. Long contacts are no discs and keep their sum. So do large ones: many pads
//! sample them well, and they may hang over the rim of the skin, where what lies beyond is no force on it.
//!
//! It holds where pads and layer are those of iCub's triangles. What the areas of all taxels are is not asked here: a disc that covers
//! many is read as what it is.

use nalgebra::Vector3;
use taxel_skin::{Geometry, SquareMillimetre};

use crate::force::discs::Discs;
use crate::force::sampling::Contact;

/// Radii of the discs, mm.
const RADII_MM: [f64; SIZES] = [3.5, 4.5, 5.5, 6.5, 8.0, 10.0, 13.0, 18.0];
const SIZES: usize = 8;
/// The disc that is read alike wherever it lies on the inner tenth of a skin.
const EVEN: usize = 6;
/// From this disc on contacts are large and keep their sum.
const LARGE: usize = 5;
/// Taxels within this distance of the centre feel a disc, mm.
const REACH_MM: f32 = 24.0;
/// A taxel that bears less than this share of the peak of a disc does not carry it.
const CARRIES: f32 = 0.03;
/// A contact lies at most so far from where its centre seems to be, mm.
const OFF_MAX_MM: f32 = 2.0;
/// A contact is read at so many times its sum at least and at most.
const FACTORS: [f64; 2] = [0.7, 1.6];

/// A number of each disc.
type BySize = [f32; SIZES];

/// The pads of a skin under made-up discs.
#[derive(Clone, Debug)]
pub struct Places {
    discs: Discs<SIZES>,
    /// Place in mm and N per kPa of every taxel that has a place.
    taxels: Vec<([f32; 3], f32)>,
}

/// Discs of 1 N as the taxels show them.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    /// Force that they read, N.
    newton: BySize,
    /// How many of them carry it in effect.
    carry: BySize,
    /// How far the centre of what they carry lies from the disc's, mm, by axis.
    off_mm: [BySize; 3],
}

impl Places {
    /// Of the taxels with a place; `areas` has one entry a taxel.
    pub fn new(geometry: &Geometry, areas: &[SquareMillimetre]) -> Self {
        let placed = geometry.poses.iter().zip(areas).filter_map(|(pose, area)| Some(((*pose)?.position, area.0)));
        let taxel = |(at, mm2): ([f64; 3], f64)| (at.map(|metre| (1e3 * metre) as f32), (1e-3 * mm2) as f32);
        let taxels: Vec<_> = placed.map(taxel).collect();
        let mut places = Self { discs: Discs::new(RADII_MM, SIZES), taxels };
        // Areas that leave out the gaps, or are not known well, are not this model's to mend.
        let mut even: Vec<f32> = places.taxels.iter().map(|(at, _)| places.under_discs(*at).newton[EVEN]).collect();
        even.sort_by(f32::total_cmp);
        let even = even.get(even.len() * 9 / 10).copied().filter(|read| *read > 0.0).unwrap_or(1.0);
        places.taxels.iter_mut().for_each(|(_, newton_per_kpa)| *newton_per_kpa /= even);
        places
    }

    /// Discs of 1 N about a place in mm, as the taxels show them.
    fn under_discs(&self, centre_mm: [f32; 3]) -> Shown {
        let least = self.discs.at(0.0).map(|peak| CARRIES * peak);
        let (mut shown, mut squares) = (Shown::default(), [0.0; SIZES]);
        for (place_mm, newton_per_kpa) in &self.taxels {
            let apart: [f32; 3] = std::array::from_fn(|axis| place_mm[axis] - centre_mm[axis]);
            let distance2 = apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2];
            if distance2 >= REACH_MM * REACH_MM {
                continue;
            }
            let kpa = self.discs.at(distance2);
            let carried: BySize = std::array::from_fn(|disc| if kpa[disc] > least[disc] { kpa[disc] } else { 0.0 });
            add(&mut shown.newton, *newton_per_kpa, &kpa);
            add(&mut shown.carry, 1.0, &carried);
            add(&mut squares, 1.0, &carried.map(|kpa| kpa * kpa));
            shown.off_mm.iter_mut().zip(apart).for_each(|(off_mm, apart)| add(off_mm, apart, &carried));
        }
        for (disc, squares) in squares.into_iter().enumerate() {
            let sum = shown.carry[disc].max(f32::MIN_POSITIVE);
            (0..3).for_each(|axis| shown.off_mm[axis][disc] /= sum);
            shown.carry[disc] *= sum / f32::max(squares, f32::MIN_POSITIVE);
        }
        shown
    }

    /// How many times its sum a contact is.
    pub fn factor(&self, contact: &Contact) -> f64 {
        let (taxels, centre_mm) = (contact.taxels(), contact.centre_mm());
        let round = 1.0 - contact.long_share();
        if round <= 0.0 || !centre_mm.iter().all(|mm| mm.is_finite()) {
            return 1.0;
        }
        let (taxels, seen_mm): (f32, [f32; 3]) = (taxels as f32, Vector3::map(&centre_mm, |mm| mm as f32).into());
        let off_mm = self.under_discs(seen_mm).of_as_many(taxels).1;
        let off = off_mm.iter().map(|mm| mm * mm).sum::<f32>().sqrt();
        let back = -(OFF_MAX_MM / off.max(OFF_MAX_MM));
        let true_mm = std::array::from_fn(|axis| seen_mm[axis] + back * off_mm[axis]);
        let (newton, _) = self.under_discs(true_mm).of_as_many(taxels);
        1.0 + round * ((1.0 / f64::from(newton)).clamp(FACTORS[0], FACTORS[1]) - 1.0)
    }
}

/// Adds so many times each of them.
fn add(sums: &mut BySize, times: f32, numbers: &BySize) {
    sums.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += times * number);
}

impl Shown {
    /// Of the disc that so many taxels carry what they read, N, all of it of a large one, and how far its centre seems off, mm: between
    /// two discs as on a line, of the least or the greatest beyond these.
    fn of_as_many(&self, taxels: f32) -> (f32, [f32; 3]) {
        let larger = self.carry.iter().position(|carry| *carry >= taxels).unwrap_or(SIZES - 1);
        let smaller = larger.saturating_sub(1);
        let apart = (self.carry[larger] - self.carry[smaller]).max(f32::MIN_POSITIVE);
        let part = ((taxels - self.carry[smaller]) / apart).clamp(0.0, 1.0);
        let between = |of: &BySize| of[smaller] + part * (of[larger] - of[smaller]);
        let newton = std::array::from_fn(|disc| if disc < LARGE { self.newton[disc] } else { 1.0 });
        (between(&newton), self.off_mm.each_ref().map(between))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::sampling::Pressed;
    use taxel_skin::{NormalsVerdict, TaxelPose};

    /// Pads 6.5 mm apart, each of which stands for so much.
    fn skin(area_mm2: f64) -> (Geometry, Vec<SquareMillimetre>) {
        let rows = (-12..=12).flat_map(|row: i32| (-12..=12).map(move |k: i32| (row, k)));
        let at =
            |(row, k): (i32, i32)| [6.5e-3 * (f64::from(k) + 0.5 * f64::from(row)), 5.629e-3 * f64::from(row), 0.0];
        let poses: Vec<_> =
            rows.map(|place| Some(TaxelPose { position: at(place), normal: [0.0, 0.0, 1.0] })).collect();
        let areas = vec![SquareMillimetre(area_mm2); poses.len()];
        (Geometry { poses, normals: NormalsVerdict::Usable, remarks: Vec::new() }, areas)
    }

    /// What the taxels of such a skin show of a disc of 1 N, and their sum, N.
    fn pressed(geometry: &Geometry, area_mm2: f64, radius_mm: f64, centre_mm: [f64; 2]) -> (Contact, f64) {
        let (disc, mut contact, mut sum_n) = (Discs::new([radius_mm], 1), Contact::default(), 0.0);
        for pose in geometry.poses.iter().flatten() {
            let place_mm = 1e3 * Vector3::from(pose.position);
            let apart2 = (place_mm.x - centre_mm[0]).powi(2) + (place_mm.y - centre_mm[1]).powi(2);
            let kpa = if apart2 < 900.0 { f64::from(disc.at(apart2 as f32)[0]) } else { 0.0 };
            sum_n += 1e-3 * area_mm2 * kpa;
            if kpa > 0.3 {
                let newton = 1e-3 * area_mm2 * kpa;
                contact.add(Pressed { kpa, newton, area_mm2, place_mm: Some(place_mm), at_rim: false });
            }
        }
        (contact, sum_n)
    }

    /// Centres all over a cell of the lattice.
    fn centres() -> impl Iterator<Item = [f64; 2]> {
        (0..25).map(|n| [1.3 * f64::from(n % 5) - 0.4, 1.1 * f64::from(n / 5) + 0.2])
    }

    #[test]
    fn a_fingertip_is_read_by_where_it_lies_and_what_areas_leave_out_stays_left_out() {
        for left_out in [1.0, 0.75] {
            let area_mm2 = left_out * 36.59;
            let (geometry, areas) = skin(area_mm2);
            let places = Places::new(&geometry, &areas);
            for (radius_mm, least) in [(6.0, 0.02), (14.0, 0.0)] {
                let [mut by_place, mut by_sum] = [0.0_f64; 2];
                for centre in centres() {
                    let (contact, sum_n) = pressed(&geometry, area_mm2, radius_mm, centre);
                    by_place += (sum_n * places.factor(&contact) / left_out - 1.0).powi(2) / 25.0;
                    by_sum += (sum_n / left_out - 1.0).powi(2) / 25.0;
                }
                let [by_place, by_sum] = [by_place, by_sum].map(f64::sqrt);
                let mended = by_place < 0.6 * by_sum || by_place.max(by_sum) < 0.02;
                assert!(mended && by_sum > least, "{radius_mm} mm, {left_out}: {by_place} of {by_sum}");
            }
        }
    }

    #[test]
    fn what_hangs_over_the_rim_is_no_force_on_the_skin() {
        let (geometry, areas) = skin(36.59);
        let (contact, _) = pressed(&geometry, 36.59, 14.0, [37.7, 12.5 * 5.629]);
        assert_eq!(Places::new(&geometry, &areas).factor(&contact), 1.0);
    }

    #[test]
    fn a_long_contact_and_one_without_a_place_keep_their_sums() {
        let (geometry, areas) = skin(36.59);
        let places = Places::new(&geometry, &areas);
        let taxel = |place_mm| Pressed { kpa: 10.0, newton: 0.4, area_mm2: 36.59, place_mm, at_rim: false };
        let mut edge = Contact::default();
        (0..4).for_each(|k| edge.add(taxel(Some(Vector3::new(6.5 * f64::from(k), 0.0, 0.0)))));
        let mut unplaced = Contact::default();
        unplaced.add(taxel(None));
        assert_eq!([edge, unplaced, Contact::default()].map(|contact| places.factor(&contact)), [1.0; 3]);
    }
}
