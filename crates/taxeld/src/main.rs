//! taxeld: the daemon that gives robots a sense of force.
#[allow(dead_code)]
mod config;
#[cfg(feature = "sim")]
mod demo;
mod offline;
mod recording;
use std::sync::Arc;
fn main() -> anyhow::Result<()> {
    let text = include_str!("demo_config.toml");
    let config = config::parse(std::path::Path::new("demo"), text)?;
    let mut scene = config::resolve(&config, std::path::Path::new("demo"))?;
    let skin = taxel_sim::Skin::forearm()?;
    let g = taxel_skin::Geometry::parse(&skin.positions_file(), skin.patch())?;
    scene.plan.patches[0].geometry = Some(g);
    scene.plan.patches[0].outputs = taxel_engine::plan::Outputs { resultant: true, moment: true, contacts: true, fill: std::env::var("NOFILL").is_err() };
    let plan = Arc::new(scene.plan);
    for seed in 1..=3 {
        let t = std::time::Instant::now();
        let o = demo::procedure(&plan, seed, &|s| eprintln!("{s}"))?;
        println!("seed {seed}: {:.2} % accepted {} refused {:?} in {:?}", 100.0 * o.mean_error(), o.session.accepted, o.session.refused, t.elapsed());
        for w in &o.weighings { println!("  {} kg {:.2} N -> {:.2} +- {:.2} ({:+.1} %)", w.kilogram, w.true_n, w.measured_n, w.sigma_n, 100.0*w.error()); }
        let bad: Vec<_> = o.models.taxels.iter().enumerate().filter(|(_, t)| !t.is_usable()).map(|(i, t)| format!("{i}: {}", t.status)).collect();
        println!("  {} excluded: {bad:?}", bad.len());
    }
    Ok(())
}
