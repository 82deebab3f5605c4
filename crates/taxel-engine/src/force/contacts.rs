//! Contacts: touched taxels that are connected (`Neighbours::grow`), as readers see them.

use nalgebra::Vector3;
use taxel_skin::TaxelPose;

use crate::force::sample::Contact;

/// An active taxel whose position is known.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Its number.
    pub taxel: u16,
    /// The label of its contact.
    pub contact: u16,
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

/// Each contact by itself, the strongest first; ties in the order of their labels.
pub fn apart(mut taxels: Vec<Placed>) -> Vec<Contact> {
    taxels.sort_by_key(|taxel| taxel.contact);
    let labelled = taxels.chunk_by(|a, b| a.contact == b.contact);
    let mut contacts: Vec<Contact> = labelled.map(|members| together(members.iter().copied())).collect();
    contacts.sort_by(|a, b| b.force_n.total_cmp(&a.force_n));
    contacts
}

/// All of these as one contact.
pub fn together(members: impl Iterator<Item = Placed>) -> Contact {
    let mut contact = Contact::default();
    let (mut weighted, mut resultant, mut moment) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
    for Placed { taxel, pose, force_n, area_mm2, kpa, .. } in members {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(taxel: u16, contact: u16, position: [f64; 3], force_n: f64) -> Placed {
        Placed {
            taxel,
            contact,
            pose: TaxelPose { position, normal: [0.0, 0.0, 1.0] },
            force_n,
            area_mm2: 100.0,
            kpa: 10.0 * force_n,
        }
    }

    #[test]
    fn two_fingers_are_two_contacts_with_their_own_centres_and_moments() {
        let x = |x: f64| [x, 0.0, 0.0];
        let taxels = vec![placed(7, 1, x(0.0), 1.0), placed(9, 2, x(0.1), 10.0), placed(3, 1, x(0.01), 3.0)];
        let found = apart(taxels);
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
}
