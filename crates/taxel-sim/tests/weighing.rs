//! The whole procedure with the plainest calibration there is, a table of counts against pressure: it shows that the
//! simulated skin can be calibrated at all, and how well without any model.
#![allow(missing_docs, clippy::unwrap_used)]

mod common;
use common::*;
use taxel_sim::{Mass, PumpCommand};
use taxel_skin::{Kilopascal, TaxelIndex};

/// The pressure at which a taxel's table shows `swing`, by linear interpolation from (0, 0) on.
fn pressure_at(table: &[(f64, f64)], swing: f64) -> f64 {
    let after = table.iter().position(|(_, shown)| *shown >= swing).unwrap_or(table.len() - 1).max(1);
    let ((p0, s0), (p1, s1)) = (table[after - 1], table[after]);
    (p0 + (p1 - p0) * (swing - s0) / (s1 - s0).max(0.1)).clamp(0.0, 75.0)
}

#[test]
fn a_table_weighs_known_masses() {
    let mut relative = Vec::new();
    for seed in 0..4 {
        let mut world = streaming(seed);
        advance(&mut world, 1.0);
        let rest_frames = advance(&mut world, 6.0);
        let rest = taxel_means(&world, &rest_frames);
        let mut tables = vec![vec![(0.0, 0.0)]; rest.len()];
        world.pump(ramp(72.0, 1.0));
        for step in 0..34 {
            let middle = 7.0 + 2.0 * f64::from(step);
            let first_half = advance(&mut world, middle);
            let pressure = world.true_pressure().0;
            let second_half = advance(&mut world, middle + 1.0);
            let means = taxel_means(&world, &[first_half, second_half].concat());
            for (table, (rest, mean)) in tables.iter_mut().zip(rest.iter().zip(means)) {
                table.push((pressure, rest - mean));
            }
        }
        world.pump(PumpCommand::Vent);
        advance(&mut world, 90.0);
        let mut now = 95.0;
        let zero_frames = advance(&mut world, now);
        let zero = taxel_means(&world, &zero_frames);
        for (n, kilogram) in [0.2, 0.4, 0.6, 0.8, 1.0].into_iter().enumerate() {
            let centre = TaxelIndex((33 + 31 * n as u16 + 7 * seed as u16) % 160);
            let weight = world.lay(Mass::on_disc(kilogram, centre, 500.0)).unwrap();
            advance(&mut world, now + 0.5);
            now += 2.5;
            let frames = advance(&mut world, now);
            let loaded = taxel_means(&world, &frames);
            let taxels = tables.iter().zip(zero.iter().zip(&loaded));
            let force: f64 = taxels
                .filter(|(table, (zero, loaded))| table[table.len() - 1].1 > 20.0 && *zero - *loaded > 1.0)
                .map(|(table, (zero, loaded))| {
                    Kilopascal(pressure_at(table, zero - loaded)).on(world.skin().taxel_area()).0
                })
                .sum();
            relative.push(force / weight.0 - 1.0);
            world.clear();
            advance(&mut world, now + 1.0);
            now += 1.0;
        }
    }
    let mean_error = relative.iter().map(|e| e.abs()).sum::<f64>() / relative.len() as f64;
    eprintln!("mean absolute error {:.1} %: {relative:.3?}", 100.0 * mean_error);
    assert!(mean_error < 0.15, "{relative:.3?}");
}
