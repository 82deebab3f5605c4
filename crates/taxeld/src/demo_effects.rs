//! `taxeld demo --effects`: what the force error is made of, and what the paper's recipe makes of the same skins.

use std::ops::Range;
use std::sync::Arc;

use taxel_engine::plan::Plan;
use taxel_model::Estimator;
use taxel_sim::{Effect, STANDARD_GRAVITY};
use taxel_skin::SquareMillimetre;

use crate::demo::{Contact, MASSES_KG, Weighing, mean, procedure};

/// Calibrates and weighs the skins of these seeds under each effect, and prints a row for each.
///
/// # Errors
/// If a calibration does not come to its end.
pub fn print(plan: &Arc<Plan>, seeds: Range<u64>) -> anyhow::Result<()> {
    let paper = Arc::new(papers(plan));
    let skins = seeds.end - seeds.start;
    say!(
        "What the force error is made of: mean absolute error over {skins} simulated skin(s), the bias at 0.2 kg, and how"
    );
    say!(
        "often the truth lies within 2 standard uncertainties. The paper's recipe: least squares of its equation, equal"
    );
    say!("areas (the true mean), active taxels only, excluded ones left out.");
    say!();
    say!("                            |              masses              |       fingers     |  paper's recipe");
    say!("effect                      | |error|   at 0.2 kg  within 2 s   | |error| within 2 s | |masses| |fingers|");
    let rows = std::iter::once(("none of these", Vec::new()))
        .chain(Effect::ALL.map(|effect| (effect.name(), vec![effect])))
        .chain(std::iter::once(("all of these", Effect::ALL.to_vec())));
    for (name, effects) in rows {
        let areas = |plan: &Arc<Plan>| -> anyhow::Result<Arc<Plan>> { Ok(Arc::new(with_areas_of(plan, &effects)?)) };
        let ours = weighings(&areas(plan)?, &effects, seeds.clone())?;
        let theirs = weighings(&areas(&paper)?, &effects, seeds.clone())?;
        let least_n = MASSES_KG[0] * STANDARD_GRAVITY;
        let bias = mean(of(&ours, Contact::Mass).filter(|w| (w.true_n - least_n).abs() < 1e-6).map(Weighing::error));
        let percent = |weighings: &[Weighing], contact| 100.0 * mean(of(weighings, contact).map(|w| w.error().abs()));
        say!(
            "{name:27} | {:5.1} %   {:+6.1} %   {:6.1} %    | {:5.1} %  {:5.1} %   | {:5.1} %  {:5.1} %",
            percent(&ours, Contact::Mass),
            100.0 * bias,
            100.0 * covered(&ours, Contact::Mass),
            percent(&ours, Contact::Finger),
            100.0 * covered(&ours, Contact::Finger),
            percent(&theirs, Contact::Mass),
            percent(&theirs, Contact::Finger),
        );
    }
    Ok(())
}

fn of(weighings: &[Weighing], contact: Contact) -> impl Iterator<Item = &Weighing> {
    weighings.iter().filter(move |w| w.contact == contact)
}

/// Share of the weighings whose truth lies within 2 standard uncertainties.
fn covered(weighings: &[Weighing], contact: Contact) -> f64 {
    mean(of(weighings, contact).map(|w| f64::from((w.measured_n - w.true_n).abs() <= 2.0 * w.sigma_n)))
}

fn weighings(plan: &Arc<Plan>, effects: &[Effect], seeds: Range<u64>) -> anyhow::Result<Vec<Weighing>> {
    let mut all = Vec::new();
    for seed in seeds {
        all.extend(procedure(plan, seed, effects, &|_| ())?.weighings);
    }
    Ok(all)
}

/// The plan with the areas that taxels really have under these effects: without gaps they are smaller.
fn with_areas_of(plan: &Plan, effects: &[Effect]) -> anyhow::Result<Plan> {
    let (skin, _) = Effect::forearm(effects, 1)?;
    let mut plan = plan.clone();
    for patch in &mut plan.patches {
        let mean = patch.areas.iter().map(|area| area.0).sum::<f64>() / patch.areas.len() as f64;
        let to_true = skin.taxel_area().0 / mean;
        patch.areas.iter_mut().for_each(|area| *area = SquareMillimetre(area.0 * to_true));
        patch.geometry = match patch.geometry {
            Some(_) => Some(taxel_skin::Geometry::parse(&skin.positions_file(), &patch.patch)?),
            None => None,
        };
    }
    Ok(plan)
}

/// What the paper does: its equation, equal areas, the sum over active taxels. Without positions nothing is taken from
/// neighbours.
fn papers(plan: &Plan) -> Plan {
    let mut plan = plan.clone();
    for patch in &mut plan.patches {
        patch.fit.estimator = Estimator::Paper;
        patch.geometry = None;
        patch.outputs.fill = false;
        let mean = patch.areas.iter().map(|area| area.0).sum::<f64>() / patch.areas.len() as f64;
        patch.areas.fill(SquareMillimetre(mean));
    }
    plan
}
