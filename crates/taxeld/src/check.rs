//! `taxeld check`: what a configuration resolves to, and what it leaves out.

use taxel_engine::route::Routes;
use taxel_skin::{BusIndex, SquareMillimetre};

use crate::config::{Config, Scene};

/// Prints the resolved scene.
pub fn print(config: &Config, scene: &Scene) {
    println!("store: {}", config.store.path.display());
    println!("service: gRPC on {} (loopback, unencrypted)", config.service.listen);
    let routes = Routes::new(&scene.plan);
    for (position, section) in config.bus.iter().enumerate() {
        let wanted = routes.wanted(BusIndex(position as u8)).len();
        let interface = section.interface.as_deref().unwrap_or("none");
        println!("bus {}: {:?}, interface {interface}, {wanted} identifiers let through", section.name, section.source);
    }
    for plan in &scene.plan.patches {
        let patch = &plan.patch;
        println!("patch {}: {} taxels on {} modules", patch.name(), patch.taxels().len(), patch.modules().len());
        for board in patch.boards() {
            println!("  board {} of bus {}: {} modules", board.address, board.bus.0, board.modules.len());
        }
        let frames_per_s = 2.0 * patch.modules().len() as f64 / plan.period.as_secs_f64();
        println!(
            "  {frames_per_s:.0} frames/s at {} ms: {:.1} % of a 1 Mbit/s bus",
            plan.period.as_millis(),
            frames_per_s * 111e-4
        );
        println!("  {}", areas(&plan.areas));
        let parts = [
            ("total normal force", true),
            ("resultant", plan.outputs.resultant),
            ("moment and centre of pressure", plan.outputs.moment),
            ("contacts", plan.outputs.contacts),
            ("fill of excluded taxels", plan.outputs.fill),
            ("calibration", plan.gauge.is_some()),
            ("areas set right by known loads", plan.area_from_loads),
            ("following of thermal drift", plan.drift.follow),
            ("board bring-up", !plan.bring_up.is_empty()),
        ];
        let computed: Vec<&str> = parts.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
        println!("  does: {}", computed.join(", "));
    }
    if !scene.left_out.is_empty() {
        println!("left out:");
        scene.left_out.iter().for_each(|line| println!("  {line}"));
    }
    if !scene.remarks.is_empty() {
        println!("remarks:");
        scene.remarks.iter().for_each(|line| println!("  {line}"));
    }
}

/// Sum and range of the areas of the taxels.
fn areas(areas: &[SquareMillimetre]) -> String {
    let total: f64 = areas.iter().map(|area| area.0).sum();
    let (least, most) = areas.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), area| (a.min(area.0), b.max(area.0)));
    let each = if least < most { format!("{least:.1} to {most:.1}") } else { format!("{most:.1}") };
    format!("area: {each} mm2 a taxel, {:.1} cm2 in all", total * 1e-2)
}
