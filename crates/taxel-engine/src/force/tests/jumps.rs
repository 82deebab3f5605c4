//! What is told of a force while all taxels of a module jump together.

use super::{Skin, TAXELS, plan, rest, row, set};
use crate::force::owner::{Force, Measured};

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
        assert_eq!(sample.filled, u32::from(faulty.is_some()));
        sample.total_sigma.unwrap().0
    };
    let beyond = |jumps: &[(usize, f32)], faulty| (sigma(jumps, faulty).powi(2) - sigma(&[], faulty).powi(2)).sqrt();
    assert!(beyond(&[(0, 6.0), (5, 6.0)], None).abs() < 1e-9, "nothing touches those");
    // Taxels 28 and 29 are touched of one, 30 to 35 of the other, and one beside each contact may be in it.
    let [one, other] = [2, 3].map(|module| beyond(&[(module, 6.0)], None));
    assert!(one > 0.1 && (2.0..=4.5).contains(&(other / one)), "{one} {other}");
    assert!((beyond(&[(3, 12.0)], None) - 2.0 * other).abs() < 1e-6);
    assert!((beyond(&[(2, 6.0), (3, 6.0)], None) - one.hypot(other)).abs() < 1e-6);
    // A taxel that is filled from its neighbours jumps as they do.
    assert!((beyond(&[(3, 6.0)], Some(33)) / other - 1.0).abs() < 0.1);
}

/// A jump away from load hides as much of a touch; but what was touched is told by the counts as before.
#[test]
fn what_jumps_together_may_hide_a_touch_by_as_much() {
    let measured = |jumps: &[f32]| {
        let mut skin = Skin::new(Some(row(TAXELS))).press(28..36, 20);
        skin.jumps[..jumps.len()].copy_from_slice(jumps);
        skin.measured()
    };
    let (calm, one, two) = (measured(&[]), measured(&[6.0]), measured(&[6.0, 6.0]));
    let floor = |measured: &Measured| measured.sample.detection_floor.unwrap().0;
    let per_count_n: f64 = Skin::new(None).force.newton_per_count().iter().take(10).map(|newton| newton.abs()).sum();
    assert!((floor(&one) - floor(&calm) - 6.0 * per_count_n).abs() < 1e-4, "{} {per_count_n}", floor(&one));
    assert!((floor(&two) - floor(&calm) - 12.0 * per_count_n).abs() < 1e-4);
    assert_eq!(one.told, calm.told);
}
