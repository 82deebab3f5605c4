//! Contacts: clusters of active taxels that lie within reach of each other.

use nalgebra::Vector3;
use taxel_skin::TaxelPose;

use crate::force::sample::Contact;

/// An active taxel whose position is known.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Its number.
    pub taxel: u16,
    /// Where it is.
    pub pose: TaxelPose,
    /// Its force, N.
    pub force_n: f64,
    /// The area that it stands for, mm2.
    pub area_mm2: f64,
    /// Its pressure, kPa.
    pub kpa: f64,
}

/// Which contact is which from scan to scan.
#[derive(Clone, Debug, Default)]
pub struct ContactIds {
    newest: u32,
    before: Vec<(u32, Vec<u16>)>,
}

impl ContactIds {
    /// Gives each contact the id of the one before that it shares most taxels with, the strongest first, or a new one.
    pub fn give(&mut self, contacts: &mut [Contact]) {
        for contact in contacts.iter_mut() {
            let shared = |taxels: &[u16]| contact.taxels.iter().filter(|t| taxels.binary_search(t).is_ok()).count();
            let best = self.before.iter().enumerate().map(|(place, (_, taxels))| (shared(taxels), place));
            contact.id = match best.filter(|(shared, _)| *shared > 0).max_by_key(|(shared, _)| *shared) {
                Some((_, place)) => self.before.swap_remove(place).0,
                None => {
                    self.newest = self.newest.wrapping_add(1).max(1);
                    self.newest
                }
            };
        }
        self.before.clear();
        self.before.extend(contacts.iter().map(|contact| (contact.id, contact.taxels.clone())));
    }
}

/// Groups taxels: two closer than `reach_m` belong together, and so do their friends. Strongest contact first; ties keep the
/// order of their first taxel.
pub fn clusters(taxels: &[Placed], reach_m: f64) -> Vec<Contact> {
    let mut is_taken = vec![false; taxels.len()];
    let mut contacts: Vec<Contact> = Vec::new();
    for seed in 0..taxels.len() {
        if is_taken[seed] {
            continue;
        }
        is_taken[seed] = true;
        let (mut members, mut looked_at) = (vec![seed], 0);
        while let Some(&member) = members.get(looked_at) {
            looked_at += 1;
            for other in 0..taxels.len() {
                if !is_taken[other] && distance(&taxels[member].pose, &taxels[other].pose) <= reach_m {
                    is_taken[other] = true;
                    members.push(other);
                }
            }
        }
        contacts.push(together(members.into_iter().map(|member| taxels[member])));
    }
    contacts.sort_by(|a, b| b.force_n.total_cmp(&a.force_n));
    contacts
}

/// All of these as one contact.
pub fn together(members: impl Iterator<Item = Placed>) -> Contact {
    let mut contact = Contact::default();
    let (mut weighted, mut resultant, mut moment) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
    for Placed { taxel, pose, force_n, area_mm2, kpa } in members {
        let (position, force) = (Vector3::from(pose.position), -force_n * Vector3::from(pose.normal));
        contact.taxels.push(taxel);
        contact.force_n += force_n;
        contact.area_mm2 += area_mm2;
        contact.peak_kpa = contact.peak_kpa.max(kpa);
        weighted += force_n * position;
        resultant += force;
        moment += position.cross(&force);
    }
    contact.taxels.sort_unstable();
    if contact.force_n > 0.0 {
        contact.centre = (weighted / contact.force_n).into();
    }
    (contact.resultant, contact.moment) = (resultant.into(), moment.into());
    contact
}

fn distance(a: &TaxelPose, b: &TaxelPose) -> f64 {
    (Vector3::from(a.position) - Vector3::from(b.position)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn placed(taxel: u16, position: [f64; 3], force_n: f64) -> Placed {
        Placed {
            taxel,
            pose: TaxelPose { position, normal: [0.0, 0.0, 1.0] },
            force_n,
            area_mm2: 100.0,
            kpa: 10.0 * force_n,
        }
    }

    #[test]
    fn two_fingers_are_two_contacts_with_their_own_centres_and_moments() {
        let taxels = [placed(7, [0.0; 3], 1.0), placed(3, [0.01, 0.0, 0.0], 3.0), placed(9, [0.1, 0.0, 0.0], 10.0)];
        let found = clusters(&taxels, 0.015);
        assert_eq!(found.len(), 2);
        assert_eq!((&found[0].taxels[..], found[0].force_n, found[0].resultant), (&[9][..], 10.0, [0.0, 0.0, -10.0]));
        assert_eq!(found[0].moment, [0.0, 1.0, 0.0]);
        assert_eq!((&found[1].taxels[..], found[1].area_mm2, found[1].peak_kpa), (&[3, 7][..], 200.0, 30.0));
        assert!((found[1].centre[0] - 0.0075).abs() < 1e-15);
    }

    #[test]
    fn a_contact_keeps_its_id_while_it_moves_and_another_one_has_its_own() {
        let mut ids = ContactIds::default();
        let mut given = |contacts: &[&[u16]]| {
            let mut contacts: Vec<Contact> =
                contacts.iter().map(|taxels| Contact { taxels: taxels.to_vec(), ..Contact::default() }).collect();
            ids.give(&mut contacts);
            contacts.iter().map(|contact| contact.id).collect::<Vec<_>>()
        };
        assert_eq!(given(&[&[1, 2, 3], &[10, 11]]), [1, 2]);
        assert_eq!(given(&[&[11, 12], &[3, 4]]), [2, 1], "another is the strongest now");
        assert_eq!(given(&[&[3, 4, 11, 12]]), [1], "the last of those that share as many");
        assert_eq!(given(&[&[3, 4], &[12]]), [1, 3], "it parts");
        assert_eq!((given(&[]), given(&[&[3, 4]])), (vec![], vec![4]), "one that went and came again");
    }

    proptest! {
        #[test]
        fn no_force_is_lost_and_clusters_are_apart(
            points in proptest::collection::vec((prop::array::uniform3(-0.1..0.1_f64), 0.1..5.0_f64), 0..40)
        ) {
            let taxels: Vec<_> = (0..).zip(&points).map(|(taxel, (position, n))| placed(taxel, *position, *n)).collect();
            let found = clusters(&taxels, 0.02);
            let total: f64 = points.iter().map(|p| p.1).sum();
            prop_assert!((found.iter().map(|c| c.force_n).sum::<f64>() - total).abs() < 1e-9);
            prop_assert_eq!(found.iter().map(|c| c.taxels.len()).sum::<usize>(), points.len());
        }
    }
}
