//! What a sum over taxels misses of a contact: pads sample its pressure at points that lie some 6 mm apart.
//!
//! The fewer taxels a contact presses on, the more the sum hangs on where exactly it lies. What counts is how many carry it
//! in effect, `n = (sum P)^2 / sum P^2` over the pressures P of its taxels: n equal ones, or fewer the more one of them
//! stands out.

/// Relative standard uncertainty of the sum by the effective number of taxels. From a simulation of masses, fingers, edges
/// and points anywhere on triangles without holes, pads of 4 mm under 2 mm of soft layer; of one taxel alone nobody knows
/// how much of the contact it feels, or whether it hangs.
const BY_TAXELS: [(f64, f64); 8] =
    [(1.0, 0.5), (2.0, 0.21), (4.0, 0.155), (6.0, 0.105), (8.5, 0.087), (12.0, 0.046), (16.0, 0.024), (1e3, 0.024)];

/// Relative standard uncertainty of what the taxels at the rim of the skin read of a contact. Under the same layer a pad at a
/// straight rim feels 0.90 of a pressure that is the same everywhere on the skin, and one at a corner 0.81: what the layer
/// spreads to beyond the skin is lost to all of them alike.
const AT_RIM: f64 = 0.1;

/// Sums over the taxels of one contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    force_n: f64,
    rim_n: f64,
    kpa: f64,
    kpa2: f64,
}

impl Contact {
    /// A taxel under a pressure with its force, at the rim of the skin or not. Pressures below zero count as none.
    pub fn add(&mut self, kpa: f64, newton: f64, at_rim: bool) {
        let kpa = kpa.max(0.0);
        self.force_n += newton;
        self.rim_n += if at_rim { newton } else { 0.0 };
        self.kpa += kpa;
        self.kpa2 += kpa * kpa;
    }

    /// Standard uncertainty of its force because pads sample it, N.
    pub fn sigma_n(&self) -> f64 {
        let effective = if self.kpa2 > 0.0 { self.kpa * self.kpa / self.kpa2 } else { 1.0 };
        relative_sigma(effective) * self.force_n.abs()
    }

    /// Standard uncertainty of its force because some of it lies at the rim of the skin, N.
    pub fn rim_sigma_n(&self) -> f64 {
        AT_RIM * self.rim_n.abs()
    }
}

/// Between the tabulated numbers as on a line.
fn relative_sigma(taxels: f64) -> f64 {
    let (first, last) = (BY_TAXELS[0], BY_TAXELS[BY_TAXELS.len() - 1]);
    let taxels = taxels.clamp(first.0, last.0);
    let pair = BY_TAXELS.windows(2).find(|pair| taxels <= pair[1].0);
    pair.map_or(last.1, |pair| {
        let [(from, a), (to, b)] = [pair[0], pair[1]];
        a + (taxels - from) / (to - from) * (b - a)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_taxels_under_a_contact_leave_less_uncertainty() {
        let sigma = |taxels: usize| {
            let mut contact = Contact::default();
            (0..taxels).for_each(|_| contact.add(10.0, 0.5, false));
            contact.sigma_n() / (0.5 * taxels as f64)
        };
        assert!((sigma(1) - 0.5).abs() < 1e-12 && (sigma(4) - 0.155).abs() < 1e-12 && (sigma(40) - 0.024).abs() < 1e-9);
        assert!((1..40).all(|taxels| sigma(taxels + 1) < sigma(taxels) + 1e-12));
        assert_eq!(Contact::default().sigma_n(), 0.0, "no contact, no uncertainty");
    }

    #[test]
    fn a_taxel_that_stands_out_counts_for_most_of_its_contact() {
        let mut contact = Contact::default();
        contact.add(100.0, 5.0, false);
        (0..9).for_each(|_| contact.add(1.0, 0.05, false));
        assert!(contact.sigma_n() > 0.4 * 5.45, "{contact:?}");
    }

    #[test]
    fn what_lies_at_the_rim_is_uncertain_together() {
        let sigma = |at_rim: usize| {
            let mut contact = Contact::default();
            (0..20).for_each(|taxel| contact.add(10.0, 0.5, taxel < at_rim));
            assert!((contact.sigma_n() - 0.24).abs() < 1e-12, "{contact:?}");
            contact.rim_sigma_n()
        };
        assert!(sigma(0) == 0.0 && (sigma(8) - 0.4).abs() < 1e-12, "{}", sigma(8));
    }
}
