//! The simulated skin against the figures of the real one.

use taxel_sim::STANDARD_GRAVITY;

use crate::common::*;

#[test]
fn counts_are_spread_as_in_the_paper() {
    for seed in 0..12 {
        let mut world = streaming(seed);
        advance(&mut world, 1.0);
        let rest_frames = advance(&mut world, 3.0);
        let rest = taxel_means(&world, &rest_frames);
        world.pump(ramp(70.3, 4.0));
        advance(&mut world, 24.0);
        let pressed_frames = advance(&mut world, 26.0);
        let pressed = taxel_means(&world, &pressed_frames);
        assert!((world.true_pressure().0 - 70.2).abs() < 0.3);

        let swing: Vec<f64> = rest.iter().zip(&pressed).map(|(r, p)| r - p).collect();
        let ((rest_mean, rest_sd), (_, pressed_sd), (swing_mean, _)) =
            (mean_and_sd(&rest), mean_and_sd(&pressed), mean_and_sd(&swing));
        eprintln!("seed {seed}: SD {rest_sd:.1} at rest, {pressed_sd:.1} at 70 kPa; mean swing {swing_mean:.1} counts");
        assert!((238.0..242.0).contains(&rest_mean), "{rest_mean}");
        assert!((0.75..1.25).contains(&(rest_sd / 5.9)), "seed {seed}: {rest_sd} at rest");
        assert!((0.75..1.25).contains(&(pressed_sd / 25.6)), "seed {seed}: {pressed_sd} at 70 kPa");
        assert!((80.0..120.0).contains(&swing_mean), "seed {seed}: mean swing {swing_mean}");
        let weak = swing.iter().filter(|s| **s < 10.0).count();
        assert!((8..=15).contains(&weak), "seed {seed}: {weak} of 230 taxels hardly respond");
    }
}

#[test]
fn pads_feel_the_temperature_and_not_the_pressure() {
    let mut config = Config::seeded(4);
    config.boards.start_streaming = true;
    config.boards.drift_gain = 0;
    config.thermal.warm_up_k = 8.0;
    config.thermal.warm_up_s = 60.0;
    config.thermal.swing_k = 0.0;
    let mut world = World::new(Skin::forearm().unwrap(), config.clone());
    let split = |world: &World, frames: &[_]| {
        let means = module_means(world, frames);
        let pads: Vec<f64> = means.iter().flat_map(|values| [values[6], values[10]]).collect();
        (mean_and_sd(&pads).0, mean_and_sd(&taxel_means(world, frames)).0)
    };
    let cold_frames = advance(&mut world, 2.0);
    let cold = split(&world, &cold_frames);
    advance(&mut world, 400.0);
    let warm_frames = advance(&mut world, 402.0);
    let warm = split(&world, &warm_frames);
    assert!((7.0..8.5).contains(&(cold.0 - warm.0)), "pads: {} counts in 8 K", cold.0 - warm.0);
    assert!((7.0..8.5).contains(&(cold.1 - warm.1)), "taxels: {} counts in 8 K", cold.1 - warm.1);
    world.pump(ramp(60.0, 10.0));
    advance(&mut world, 410.0);
    let pressed_frames = advance(&mut world, 412.0);
    let pressed = split(&world, &pressed_frames);
    assert!((pressed.0 - warm.0).abs() < 0.3 && pressed.1 < warm.1 - 60.0, "{warm:?} -> {pressed:?}");

    config.boards.drift_gain = 96;
    let mut world = World::new(Skin::forearm().unwrap(), config);
    let cold_frames = advance(&mut world, 2.0);
    let cold = split(&world, &cold_frames);
    advance(&mut world, 400.0);
    let warm_frames = advance(&mut world, 402.0);
    let compensated = cold.1 - split(&world, &warm_frames).1;
    assert!((1.2..3.5).contains(&compensated), "the firmware leaves a quarter: {compensated} counts");
}

#[test]
fn the_true_force_is_the_weight_and_the_skin_answers_under_it_alone() {
    let mut world = streaming(8);
    advance(&mut world, 1.0);
    let rest_frames = advance(&mut world, 3.0);
    let rest = taxel_means(&world, &rest_frames);
    for kilogram in [0.2, 0.4, 0.6, 0.8, 1.0] {
        world.clear();
        let weight = world.lay(Mass::on_disc(kilogram, TaxelIndex(43), 700.0)).unwrap();
        assert!((weight.0 - kilogram * STANDARD_GRAVITY).abs() < 1e-12);
        assert!((world.true_force().0 - weight.0).abs() < 1e-9);
    }
    let covered: Vec<bool> = world.true_taxel_pressures().map(|p| p.0 > 0.0).collect();
    advance(&mut world, 3.2);
    let loaded_frames = advance(&mut world, 5.0);
    let loaded = taxel_means(&world, &loaded_frames);
    for taxel in 0..230 {
        let fell = rest[taxel] - loaded[taxel];
        assert!(covered[taxel] || fell.abs() < 1.2, "taxel {taxel} is free and fell by {fell}");
    }
    let most = (0..230).map(|taxel| rest[taxel] - loaded[taxel]).fold(0.0, f64::max);
    assert!(most > 15.0, "the most loaded taxel fell by {most} counts");

    world.clear();
    world.pump(ramp(50.0, 20.0));
    advance(&mut world, 12.0);
    let whole = world.true_pressure().0 * 230.0 * 0.0324;
    assert!((world.true_force().0 - whole).abs() < 1e-9);
    world.pump(PumpCommand::Vent);
    advance(&mut world, 30.0);
    assert!(world.true_force().0 < 1e-6);
}
