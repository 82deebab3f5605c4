//! Contacts: clusters of active taxels that lie within reach of each other.

use crate::force::sample::Contact;

/// Groups points `(position in m, force in N)`: two closer than `reach_m` belong together, and so do their friends.
/// Strongest contact first; ties keep the order of their first point.
#[must_use]
pub fn clusters(points: &[([f64; 3], f64)], reach_m: f64) -> Vec<Contact> {
    let mut cluster_of: Vec<Option<usize>> = vec![None; points.len()];
    let mut contacts: Vec<Contact> = Vec::new();
    let mut frontier = Vec::new();
    for seed in 0..points.len() {
        if cluster_of[seed].is_some() {
            continue;
        }
        let cluster = contacts.len();
        let mut contact = Contact::default();
        cluster_of[seed] = Some(cluster);
        frontier.push(seed);
        while let Some(point) = frontier.pop() {
            let (position, force_n) = points[point];
            contact.taxels += 1;
            contact.force_n += force_n;
            for (sum, place) in contact.centre.iter_mut().zip(position) {
                *sum += force_n * place;
            }
            for other in 0..points.len() {
                if cluster_of[other].is_none() && distance(position, points[other].0) <= reach_m {
                    cluster_of[other] = Some(cluster);
                    frontier.push(other);
                }
            }
        }
        if contact.force_n > 0.0 {
            contact.centre = contact.centre.map(|c| c / contact.force_n);
        }
        contacts.push(contact);
    }
    contacts.sort_by(|a, b| b.force_n.total_cmp(&a.force_n));
    contacts
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_fingers_are_two_contacts_with_their_own_centres() {
        let points = [([0.0, 0.0, 0.0], 1.0), ([0.01, 0.0, 0.0], 3.0), ([0.1, 0.0, 0.0], 10.0)];
        let found = clusters(&points, 0.015);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].taxels, found[0].force_n), (1, 10.0));
        assert!((found[1].centre[0] - 0.0075).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn no_force_is_lost_and_clusters_are_apart(
            points in proptest::collection::vec((prop::array::uniform3(-0.1..0.1_f64), 0.1..5.0_f64), 0..40)
        ) {
            let found = clusters(&points, 0.02);
            let total: f64 = points.iter().map(|p| p.1).sum();
            prop_assert!((found.iter().map(|c| c.force_n).sum::<f64>() - total).abs() < 1e-9);
            prop_assert_eq!(found.iter().map(|c| c.taxels as usize).sum::<usize>(), points.len());
        }
    }
}
