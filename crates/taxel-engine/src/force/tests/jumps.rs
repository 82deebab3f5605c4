//! What is told of a force while all taxels of a module jump together.

use super::{Skin, TAXELS, plan, rest, row, set};
use crate::force::owner::Force;

/// Half of the way that a module jumps is in the uncertainty of a force on it, and of no other.
#[test]
fn what_jumps_together_is_uncertain_by_half_of_the_jump() {
    let sigma = |jumps: &[(usize, f32)], faulty: Option<usize>| {
        let mut skin = Skin::new(Some(row(TAXELS))).press(28..36, 20);
        let mut plan = plan(TAXELS, Some(row(TAXELS)));
        plan.layout.outputs.fill = true;
        skin.force = Force::new(plan);
        skin.force.set_models(set(TAXELS), 0.0);
        skin.force.set_zero(Some(&rest(TAXELS)), 0.0);
        if let Some(taxel) = faulty {
            skin = skin.fault(taxel);
        }
        jumps.iter().for_each(|&(module, counts)| skin.jumps[module] = counts);
        let sample = skin.measured().sample;
        (sample.total_sigma.unwrap().0, sample.total.unwrap().0)
    };
    let beyond =
        |jumps: &[(usize, f32)], faulty| (sigma(jumps, faulty).0.powi(2) - sigma(&[], faulty).0.powi(2)).sqrt();
    assert!(beyond(&[(0, 6.0), (5, 6.0)], None).abs() < 1e-9, "nothing touches those");
    // Taxels 28 and 29 are touched of one, 30 to 35 of the other, and one beside each contact may be in it.
    let [one, other] = [2, 3].map(|module| beyond(&[(module, 6.0)], None));
    assert!(one > 0.1 && (2.0..=4.5).contains(&(other / one)), "{one} {other}");
    assert!((beyond(&[(3, 12.0)], None) - 2.0 * other).abs() < 1e-6);
    assert!((beyond(&[(2, 6.0), (3, 6.0)], None) - one.hypot(other)).abs() < 1e-6);
    // A taxel that is filled from its neighbours jumps as they do, by what it bears.
    let more = sigma(&[], Some(33)).1 / sigma(&[], None).1;
    assert!((beyond(&[(3, 6.0)], Some(33)) / (more * other) - 1.0).abs() < 0.1);
}
