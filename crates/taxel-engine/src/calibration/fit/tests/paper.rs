//! The paper's own recipe.

use super::*;

fn paper() -> FitRecipe {
    // What the paper has no word of is not done, whatever else is asked for.
    let options = FitOptions { paper: true, ..FitOptions::default() };
    FitRecipe { options, branch: Branch::Both, plays: true, ..FitRecipe::default() }
}

#[test]
fn the_papers_recipe_is_its_equation_over_every_rising_sample() {
    let mut skin = Skin::cycle(5.0);
    skin.spoil(2, 20.0..75.9, |_| 90.0); // frozen until the end
    skin.spoil(3, 20.0..30.0, |_| 240.0); // frozen
    skin.spoil(5, 20.0..20.5, |_| 255.0); // on a rail
    skin.spoil(7, 25.0..25.02, |_| 120.0); // one reading that stands alone
    skin.counts[9][700] = f64::NAN;
    skin.kpa[900] += 14.0; // a reading of the gauge that is off
    let set = fitted(&skin, &paper());
    assert_eq!(set.method, "order 5, paper, rising");
    let top = (0..skin.kpa.len()).fold(0, |top, i| if skin.kpa[i] > skin.kpa[top] { i } else { top });
    assert_eq!(top, 1900);
    for (taxel, model) in set.taxels.iter().enumerate() {
        let rows = (0..=top).filter(|&i| skin.counts[taxel][i].is_finite());
        let (counts, kpa): (Vec<f64>, Vec<f64>) = rows.map(|i| (skin.counts[taxel][i], skin.kpa[i])).unzip();
        let alone = taxel_model::fit(&Samples::new(&counts, &kpa), &paper().options);
        assert_eq!((model.status, model.points.is_none()), (Status::Ok, true), "taxel {taxel}");
        assert_eq!((&model.curve, model.range), (&alone.curve, alone.range), "taxel {taxel}");
        assert_eq!(model.quality.samples, counts.len() as u64, "taxel {taxel}");
        assert!(set.plays(taxel).is_none());
    }
    let least = |taxel: usize| set.taxels[taxel].range.unwrap()[0];
    assert!(least(7) == 120.0 && least(8) > 120.0, "the outlier has its say");
    let left_out = |flag: &Flag| matches!(flag, Flag::Dropouts { .. } | Flag::Rejected { .. });
    assert!(set.taxels.iter().all(|model| !model.flags.iter().any(left_out)));
}

#[test]
fn the_paper_excludes_by_swing_alone() {
    let mut recipe = paper();
    let skin = Skin::cycle(5.0);
    let swing = |set: &crate::model_set::ModelSet, taxel: usize| set.taxels[taxel].quality.swing_counts;
    let all = fitted(&skin, &recipe);
    recipe.options.min_swing_counts = 0.5 * (swing(&all, 0) + swing(&all, TAXELS - 1));
    let some = fitted(&skin, &recipe);
    for (taxel, model) in some.taxels.iter().enumerate() {
        let (swing, needed) = (swing(&all, taxel), recipe.options.min_swing_counts);
        let excluded = Status::InsufficientSwing { swing_counts: swing, needed_counts: needed };
        assert_eq!(model.status, if swing < needed { excluded } else { Status::Ok }, "taxel {taxel}");
    }
}
