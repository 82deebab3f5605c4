//! The owner's first question: how far off is the force, and what does it cost to compute? Recipes of calibration
//! against each other, by the time of a fit and of a scan, on data that no fit saw.

mod forearm;
mod insole;
mod recipe;

use crate::document::{Aim, Axis, Cell, Figure, Level, Line, Point, Section, Table, row};
use crate::numbers::{mean, three_digits};
use crate::options::Options;
use recipe::{Outcome, Recipe, Source};

/// From scan to scan of a skin at 20 Hz, us.
const BETWEEN_SCANS_US: f64 = 50_000.0;

/// Measures the section.
///
/// # Errors
/// A simulation that cannot be set up, or a recording that is there and cannot be read.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let insole =
        options.data.as_deref().map(|data| insole::measure(&data.join("insole"), options.quick)).transpose()?;
    let forearm = forearm::measure(options.seed, options.quick)?;
    let mut text = vec![
        "How far is the force off on data that no fit saw, and what does computing it cost? Each line is one way to \
         calibrate: its left end is the time from the counts of a scan to the force of the whole skin, its right end the time \
         of a fit of the whole skin from a recording, its height the error of the force. Lower and further left is better. All but \
         the paper's average the counts in bins of pressure first (binned). All \
         run in one thread of the engine's own code; the paper's equation is solved as in the paper, with equal areas and \
         nothing in the place of excluded taxels, and read by the same live path."
            .to_owned(),
    ];
    let mut sources: Vec<Source> = insole.flatten().into_iter().collect();
    if sources.is_empty() {
        text.push("SKIPPED: the recordings of a real skin are not there (TAXELD_DATA or --data), so only simulated skins follow.".to_owned());
    }
    if !sources.is_empty() {
        text.push(
            "What is missed on `validation` is the skin's gain: that day it reads 4 % more at every pressure, which no fit of \
             another day can know and a known load can tell (`taxeld recalibrate`)."
                .to_owned(),
        );
    }
    sources.push(forearm);
    text.extend(sources.iter().map(in_words));
    Ok(Section {
        text,
        aims: sources.iter().flat_map(aims).collect(),
        figures: sources.iter().map(figure).collect(),
        tables: vec![table(&sources)],
        ..Section::default()
    })
}

/// The height in the figure: the mean of the recordings, or the masses without their bias.
fn height(source: &Source, outcome: &Outcome) -> f64 {
    let errors = source.exams.iter().zip(&outcome.force_percent).filter(|(exam, _)| !exam.ends_with("bias"));
    mean(errors.map(|(_, percent)| *percent))
}

/// What was promised of the shipped default for recordings.
fn aims(source: &Source) -> Vec<Aim> {
    let shipped = Recipe::all().iter().position(Recipe::is_default).and_then(|at| source.outcomes.get(at));
    let errors = shipped.into_iter().flat_map(|outcome| &outcome.force_percent);
    let all = source.exams.iter().zip(errors).zip(&source.promised_percent);
    let aim = |((exam, percent), most): ((&&str, &f64), &f64)| {
        let what = format!("{}: error of the total force on a recording of another day ({exam}), %", source.skin);
        Aim::at_most(&what, *percent, *most)
    };
    all.map(aim).collect()
}

/// The shipped defaults and the paper's recipe.
fn in_words(source: &Source) -> String {
    let all = Recipe::all().into_iter().zip(&source.outcomes);
    let said = all.filter(|(recipe, _)| recipe.is_default() || recipe.is_paper()).map(|(recipe, outcome)| {
        let (percent, fit, scan) = (height(source, outcome), outcome.fit_ms, outcome.scan_us);
        let [percent, fit, scan] = [percent, fit, scan].map(three_digits);
        format!("{}: {percent} %, {fit} ms a fit, {scan} us a scan", recipe.name)
    });
    format!("{}: {}.", capital(source.skin), said.collect::<Vec<_>>().join("; "))
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn figure(source: &Source) -> Figure {
    let line = |(recipe, outcome): (Recipe, &Outcome)| {
        let y = height(source, outcome);
        let ends = [outcome.scan_us, outcome.fit_ms * 1e3].map(|x| Point { x, y, ..Point::default() });
        Line { name: recipe.name.to_owned(), ours: recipe.is_default(), points: ends.to_vec(), ..Line::default() }
    };
    Figure {
        id: format!("force-{}", source.id),
        title: format!("Error of the force against run time: {}", source.skin),
        caption: source.caption.clone(),
        x: Axis::log("time for the whole skin, us: of a scan (left ends), of a fit (right ends)"),
        y: Axis::linear("error of the force on unseen data, %"),
        lines: Recipe::all().into_iter().zip(&source.outcomes).map(line).collect(),
        levels: vec![Level::new(BETWEEN_SCANS_US, "from scan to scan at 20 Hz")],
        ..Figure::default()
    }
}

fn table(sources: &[Source]) -> Table {
    let exams = sources.iter().flat_map(|source| source.exams.iter().map(|exam| format!("{}: {exam}, %", source.id)));
    let costs = sources.iter().flat_map(|source| {
        ["fit, ms", "scan, us", "scans fitted", "usable taxels"].map(|what| format!("{}: {what}", source.id))
    });
    let columns: Vec<String> = std::iter::once("recipe".to_owned()).chain(exams).chain(costs).collect();
    let line = |(at, recipe): (usize, Recipe)| {
        let outcomes = || sources.iter().map(|source| &source.outcomes[at]);
        let errors = outcomes().flat_map(|outcome| outcome.force_percent.iter().map(|percent| Cell::from(*percent)));
        let costs = outcomes().flat_map(|of| row![of.fit_ms, of.scan_us, of.scans as f64, of.usable as f64]);
        row![recipe.name].into_iter().chain(errors).chain(costs).collect()
    };
    let caption = "Errors of the force on data that no fit saw, and medians of the times for the whole skin. A bias above zero \
                   is a force read too high.";
    Table::new("force-recipes", caption, columns, Recipe::all().into_iter().enumerate().map(line).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_engine::calibration::SessionLimits;
    use taxel_engine::calibration::fit::FitRecipe;
    use taxel_model::FitOptions;

    #[test]
    fn the_marked_recipes_are_what_is_shipped() {
        let all = Recipe::all();
        assert_eq!(all.iter().filter(|recipe| recipe.is_paper()).count(), 1);
        let shipped: Vec<&FitRecipe> =
            all.iter().filter(|recipe| recipe.is_default()).map(|recipe| &recipe.fit).collect();
        assert_eq!(shipped.len(), 2);
        assert_eq!(format!("{:?}", shipped[0]), format!("{:?}", FitRecipe::default()));
        assert_eq!(
            (shipped[1].branch, &shipped[1].options),
            (SessionLimits::default().branches, &FitOptions::default())
        );
    }

    #[test]
    fn every_recipe_has_a_line_with_two_ends_and_a_row_as_wide_as_the_table() {
        let source = forearm::measure(3, true).unwrap();
        let (figure, table) = (figure(&source), table(std::slice::from_ref(&source)));
        assert_eq!((figure.lines.len(), table.rows.len()), (Recipe::all().len(), Recipe::all().len()));
        for (line, row) in figure.lines.iter().zip(&table.rows) {
            assert!(line.points[0].x < line.points[1].x, "a scan takes less than a fit: {line:?}");
            assert!(line.points[0].y.is_finite() && row.len() == table.columns.len(), "{row:?}");
        }
        let percent = |name: &str| {
            let at = Recipe::all().iter().position(|recipe| recipe.name == name).unwrap();
            source.outcomes[at].force_percent[0]
        };
        let [extended, held] = ["extended beyond it", "held at its end"].map(|end| {
            percent(Recipe::all().iter().map(|recipe| recipe.name).find(|name| name.ends_with(end)).unwrap())
        });
        assert!(held > extended + 5.0, "held at 6.5 kPa a kilogram is lost: {held} %, extended {extended} %");
    }
}
