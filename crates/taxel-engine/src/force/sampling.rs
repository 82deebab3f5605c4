//! What a sum over taxels misses of a contact: pads sample its pressure at points that lie some 6 mm apart.
//!
//! The fewer taxels a contact presses on, the more the sum hangs on where exactly it lies. What counts is how many carry it
//! in effect, `n = (sum P)^2 / sum P^2` over the pressures P of its taxels: n equal ones, or fewer the more one of them
//! stands out. And a long one, as an edge is, lies between the pads where a round one of as many taxels does not: how long it is is the
//! greatest standard deviation of P over place, beside the `0.293 sqrt(n A)` that round ones have on pads of the area A.

use nalgebra::{Matrix3, Vector3};

/// Effective taxels, and the relative standard uncertainty of the sum of a round contact and of a long one. From 11,000 made-up
/// contacts anywhere on triangles without holes, pads of 4 mm under 1 to 3 mm of soft layer: fingers that are round, ellipses or
/// skewed, flat discs of 6 to 20 mm, masses, two fingers, edges of 2 mm (`tests/physics/contacts.py --errors`). Of one taxel alone
/// nobody knows how much of the contact it feels, or whether it hangs.
const BY_TAXELS: [[f64; 3]; 12] = [
    [1.0, 0.5, 0.5],
    [1.4, 0.27, 0.27],
    [2.0, 0.155, 0.27],
    [3.0, 0.115, 0.22],
    [4.0, 0.088, 0.165],
    [5.0, 0.072, 0.12],
    [6.0, 0.066, 0.09],
    [7.5, 0.05, 0.06],
    [9.0, 0.041, 0.048],
    [12.0, 0.034, 0.036],
    [16.0, 0.028, 0.03],
    [1e3, 0.028, 0.03],
];

/// The length of round contacts, in roots of the area that presses in effect, and how many times as long one is that is no longer
/// round, and one that is long.
const ROUND: f64 = 0.293;
const LONG: [f64; 2] = [1.1, 1.3];

/// Relative standard uncertainty of what the taxels at the rim of the skin read of a contact. Under the same layer a pad at a
/// straight rim feels 0.90 of a pressure that is the same everywhere on the skin, and one at a corner 0.81: what the layer
/// spreads to beyond the skin is lost to all of them alike.
const AT_RIM: f64 = 0.1;

/// A taxel of a contact.
#[derive(Clone, Copy, Debug)]
pub struct Pressed {
    /// Its pressure, kPa; below zero counts as none.
    pub kpa: f64,
    /// Its force, N.
    pub newton: f64,
    /// The area that it stands for, mm2.
    pub area_mm2: f64,
    /// Where it is, mm; `None` without positions.
    pub place_mm: Option<Vector3<f64>>,
    /// Whether it lies at the rim of the skin.
    pub at_rim: bool,
}

/// Sums over the taxels of one contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    force_n: f64,
    rim_n: f64,
    kpa: f64,
    kpa2: f64,
    /// Pressure times area, and pressure times place and its square; NaN where a place is not known.
    kpa_mm2: f64,
    kpa_mm: Vector3<f64>,
    kpa_squares: Matrix3<f64>,
}

impl Contact {
    /// One more taxel.
    pub fn add(&mut self, taxel: Pressed) {
        let (kpa, newton) = (taxel.kpa.max(0.0), taxel.newton);
        let place_mm = taxel.place_mm.unwrap_or_else(|| Vector3::repeat(f64::NAN));
        self.force_n += newton;
        self.rim_n += if taxel.at_rim { newton } else { 0.0 };
        self.kpa += kpa;
        self.kpa2 += kpa * kpa;
        self.kpa_mm2 += kpa * taxel.area_mm2;
        self.kpa_mm += kpa * place_mm;
        self.kpa_squares += kpa * (place_mm * place_mm.transpose());
    }

    /// Standard uncertainty of its force because pads sample it, N.
    pub fn sigma_n(&self) -> f64 {
        relative_sigma(self.taxels(), self.long_share()) * self.force_n.abs()
    }

    /// How many taxels carry it in effect.
    pub fn taxels(&self) -> f64 {
        if self.kpa2 > 0.0 { self.kpa * self.kpa / self.kpa2 } else { 1.0 }
    }

    /// Its centre of pressure, mm; not finite where a place is not known, or nothing presses.
    pub fn centre_mm(&self) -> Vector3<f64> {
        self.kpa_mm / self.kpa
    }

    /// How long it is: 0 for a round contact, 1 for a long one and where nobody knows.
    pub fn long_share(&self) -> f64 {
        let centre = self.centre_mm();
        let spread = self.kpa_squares / self.kpa - centre * centre.transpose();
        if !spread.sum().is_finite() {
            return 1.0;
        }
        let length_mm = spread.symmetric_eigenvalues().max().max(0.0).sqrt();
        let times = length_mm / (ROUND * (self.taxels() * self.kpa_mm2 / self.kpa).sqrt());
        ((times - LONG[0]) / (LONG[1] - LONG[0])).clamp(0.0, 1.0)
    }

    /// Standard uncertainty of its force because some of it lies at the rim of the skin, N.
    pub fn rim_sigma_n(&self) -> f64 {
        AT_RIM * self.rim_n.abs()
    }
}

/// Between the tabulated numbers as on a line.
fn relative_sigma(taxels: f64, long: f64) -> f64 {
    let taxels = taxels.clamp(BY_TAXELS[0][0], BY_TAXELS[BY_TAXELS.len() - 1][0]);
    let of = |[_, round, edge]: [f64; 3]| round + long * (edge - round);
    let pair = BY_TAXELS.windows(2).find(|pair| taxels <= pair[1][0]);
    pair.map_or(of(BY_TAXELS[0]), |pair| {
        let part = (taxels - pair[0][0]) / (pair[1][0] - pair[0][0]);
        of(pair[0]) + part * (of(pair[1]) - of(pair[0]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A contact with these pressures at these places.
    fn contact(taxels: impl IntoIterator<Item = (f64, [f64; 2])>) -> Contact {
        let mut contact = Contact::default();
        for (kpa, [x, y]) in taxels {
            let place_mm = Some(Vector3::new(100.0 + x, 50.0 + y, 0.0));
            contact.add(Pressed { kpa, newton: 0.05 * kpa, area_mm2: 42.0, place_mm, at_rim: false });
        }
        contact
    }

    /// So many equal ones about a centre, from the inside out.
    fn round(taxels: usize) -> Contact {
        let rows = (-4..=4).flat_map(|row: i32| (-4..=4).map(move |k: i32| (row, k)));
        let mut places: Vec<[f64; 2]> = rows
            .map(|(row, k)| [6.5 * (f64::from(k) + 0.5 * f64::from(row.abs() % 2)), 5.63 * f64::from(row)])
            .collect();
        places.sort_by(|a, b| a[0].hypot(a[1]).total_cmp(&b[0].hypot(b[1])));
        contact(places.into_iter().take(taxels).map(|place| (10.0, place)))
    }

    fn relative(contact: &Contact) -> f64 {
        contact.sigma_n() / contact.force_n
    }

    #[test]
    fn more_taxels_under_a_contact_leave_less_uncertainty() {
        assert!((relative(&round(1)) - 0.5).abs() < 1e-12 && (relative(&round(7)) - 0.055).abs() < 0.005);
        assert!((relative(&round(37)) - 0.028).abs() < 1e-9);
        assert!((3..37).all(|taxels| relative(&round(taxels + 1)) < relative(&round(taxels)) + 0.02));
        assert_eq!(Contact::default().sigma_n(), 0.0, "no contact, no uncertainty");
    }

    #[test]
    fn an_edge_is_more_uncertain_than_a_fingertip_on_as_many_taxels_and_so_is_what_has_no_place() {
        let edge = contact((0..4).map(|k| (10.0, [6.5 * f64::from(k), 0.0])));
        assert!((relative(&edge) - 0.165).abs() < 1e-9, "{}", relative(&edge));
        // As many in effect: a fingertip on one taxel and those about it.
        let about = (0..6).map(|k| f64::from(k).to_radians() * 60.0).map(|a| (2.0, [6.5 * a.cos(), 6.5 * a.sin()]));
        let fingertip = contact(about.chain([(10.0, [0.0, 0.0])]));
        assert!(relative(&fingertip) < 0.1, "{}", relative(&fingertip));
        let mut unplaced = round(3);
        unplaced.add(Pressed { kpa: 10.0, newton: 0.5, area_mm2: 42.0, place_mm: None, at_rim: false });
        assert!((relative(&unplaced) - 0.165).abs() < 1e-9, "{}", relative(&unplaced));
    }

    #[test]
    fn a_taxel_that_stands_out_counts_for_most_of_its_contact() {
        let mut pressed = vec![(100.0, [0.0, 0.0])];
        pressed.extend((0..6).map(|k| f64::from(k).to_radians() * 60.0).map(|a| (1.0, [6.5 * a.cos(), 6.5 * a.sin()])));
        assert!(relative(&contact(pressed)) > 0.35);
    }

    #[test]
    fn what_lies_at_the_rim_is_uncertain_together() {
        let sigma = |at_rim: usize| {
            let mut contact = Contact::default();
            let of = |taxel| Pressed { kpa: 10.0, newton: 0.5, area_mm2: 42.0, place_mm: None, at_rim: taxel < at_rim };
            (0..20).for_each(|taxel| contact.add(of(taxel)));
            contact.rim_sigma_n()
        };
        assert!(sigma(0) == 0.0 && (sigma(8) - 0.4).abs() < 1e-12, "{}", sigma(8));
    }
}
