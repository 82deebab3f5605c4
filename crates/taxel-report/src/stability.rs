//! Section `stability`: the suite of stiff, extreme and broken cases that taxel-model and taxel-engine keep, with what other
//! methods make of the same samples.

use taxel_model::stability::case::{Case, Contest, Outcome, Problem};
use taxel_model::{FitOptions, Samples, TaxelModel, fit};

use crate::document::{Aim, Cell, Section, Table, row};
use crate::options::Options;
use crate::peers::{self, Peers};

/// Every case with what came out.
///
/// # Errors
/// Python ended in the middle of it.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let groups = taxel_model::stability::GROUPS.iter().chain(&taxel_engine::stability::GROUPS);
    let mut cases: Vec<Case> = groups.flat_map(|(_, cases)| cases()).collect();
    // By the number of the group.
    cases.sort_by_key(|case| case.number.split('.').next().and_then(|group| group.parse::<u32>().ok()));
    section_of(cases, &mut Peers::start(&options.python))
}

fn section_of(cases: impl IntoIterator<Item = Case>, peers: &mut Peers) -> anyhow::Result<Section> {
    let names = peers.names();
    let (mut rows, mut failed, mut contested, mut missed) = (Vec::new(), Vec::new(), 0, vec![0; names.len()]);
    for case in cases {
        let outcome = case.run();
        let failures = case.failures(&outcome);
        let mut row = row(&case, &outcome, &failures);
        match &outcome.contest {
            None => row.extend(std::iter::repeat_n(Cell::from(""), 1 + names.len())),
            Some(contest) => {
                contested += 1;
                row.push(shown(shipped(contest)));
                for (name, missed) in names.iter().zip(&mut missed) {
                    let figure = figure_of(contest, name, peers)?;
                    *missed += usize::from(figure.is_none_or(|figure| figure > case.limit));
                    row.push(shown(figure));
                }
            }
        }
        if !failures.is_empty() {
            failed.push(case.number.clone());
        }
        rows.push(row);
    }
    let misses: Vec<String> = names.iter().zip(missed).map(|(name, missed)| format!("{name} {missed}")).collect();
    let text = vec![
        "Stiff, extreme and broken taxels: whether what comes out is right, or says that it is not. Errors of fits are \
         against least squares in exact integers, relative to the largest pressure. The same cases are tests of \
         taxel-model and taxel-engine."
            .to_owned(),
        match failed.len() {
            0 => format!("All {} cases hold.", rows.len()),
            some => format!("{some} of {} cases do not hold: {}.", rows.len(), failed.join(", ")),
        },
        format!(
            "Others took part in {contested} cases. By the figure alone, without status and flags, of which they have none, \
             they miss: {}. {}",
            misses.join(", "),
            peers.said
        ),
    ];
    let what = "hard cases, stiff, extreme or broken, that do not come out as they must";
    let aims = vec![Aim::at_most(what, failed.len() as f64, 0.0)];
    Ok(Section { text, aims, tables: vec![table(&names, rows)], ..Section::default() })
}

fn table(names: &[&str], rows: Vec<Vec<Cell>>) -> Table {
    let columns = ["case", "expected", "criterion", "ours: status", "ours: figure", "verdict", "shipped default"];
    let caption = "Each case with the status and flags it expects and the criterion for its figure. `Ours` is fitted as the \
                   case says, mostly to all samples as the others are. The shipped default bins them, repairs the curve \
                   and leaves out what is rare: its figure says how far that leads from plain least squares. The others \
                   get all samples of the case, gated or not, and the same figure; where that is a difference between two \
                   recordings, each is compared with itself. `none` means that the method gave no finite solution, an \
                   empty cell that the case is not theirs. Every fit must moreover give finite readings, the same bits in \
                   another order of its samples, and a table that is monotone wherever the status allows its use.";
    Table::new("stability-cases", caption, columns.iter().chain(names).copied(), rows)
}

fn row(case: &Case, outcome: &Outcome, failures: &[String]) -> Vec<Cell> {
    let came_out: Vec<&str> = std::iter::once(outcome.status).chain(outcome.flags.iter().copied()).collect();
    let mut criterion = case.criterion();
    if !failures.is_empty() {
        criterion = format!("{criterion} -- BROKEN: {}", failures.join("; "));
    }
    let name = format!("{} {}", case.number, case.name);
    row![name, case.expectation(), criterion, came_out.join(", "), outcome.figure, failures.is_empty()]
}

fn shown(figure: Option<f64>) -> Cell {
    figure.map_or_else(|| "none".into(), Cell::from)
}

/// The figure of the fit as the daemon does it unless told otherwise.
fn shipped(contest: &Contest) -> Option<f64> {
    let model = |problem: &Problem| {
        let samples = Samples::new(&problem.recording.counts, &problem.recording.kpa);
        problem.weights.is_none().then(|| fit(&samples, &FitOptions::default()))
    };
    let models = contest.problems.iter().map(model).collect::<Option<Vec<TaxelModel>>>()?;
    let reading = |model: &TaxelModel, count| model.evaluate(count).map_or(f64::NAN, |reading| reading.kpa);
    judged(contest, &models, reading)
}

/// The figure of a peer.
fn figure_of(contest: &Contest, name: &str, peers: &mut Peers) -> anyhow::Result<Option<f64>> {
    let mut curves = Vec::new();
    for Problem { recording, weights, order } in &contest.problems {
        let samples = peers::Samples { x: &recording.counts, y: &recording.kpa, w: weights.as_deref() };
        curves.extend(peers.fit(name, &samples, *order)?.curve);
    }
    Ok(judged(contest, &curves, peers::Polynomial::evaluate))
}

fn judged<C>(contest: &Contest, curves: &[C], evaluate: impl Fn(&C, f64) -> f64 + Copy) -> Option<f64> {
    let evaluations: Vec<_> = curves.iter().map(|curve| move |count: f64| evaluate(curve, count)).collect();
    let evaluations: Vec<&dyn Fn(f64) -> f64> = evaluations.iter().map(|e| e as &dyn Fn(f64) -> f64).collect();
    Some(contest.figure(&evaluations)).filter(|figure| figure.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use taxel_model::stability::taxels::Recording;

    #[test]
    fn the_section_shows_what_holds_and_what_does_not() {
        let line = Recording::new((0..20).map(|k| (f64::from(k), 2.0 * f64::from(k))));
        let contest = move || Contest::between(&line, &line.with_kpa(|kpa| kpa + 3.0), vec![1.0, 7.5]);
        let outcome = move || Outcome { status: "ok", contest: Some(contest()), ..Outcome::default() };
        let good = Case { limit: 1.0, ..Case::exact("1", "good", outcome) };
        let wrong_status = Case { flags: &["gap"], ..Case::exact("2", "wrong", || Outcome::of_figure(0.0)) };
        let too_large = Case::of("3", "too large", "error", 1e-3, || Outcome::of_figure(0.5));
        let not_a_number = Case::of("4", "not a number", "error", 1e-3, || Outcome::of_figure(f64::NAN));
        let broken = Case::of("5", "broken", "error", 1.0, || {
            let mut outcome = Outcome::of_figure(0.0);
            outcome.require(false, || "the promise".to_owned());
            outcome
        });
        let cases = [good, wrong_status, too_large, not_a_number, broken];
        let section = section_of(cases, &mut Peers::start(Path::new("nowhere"))).unwrap();
        let table = &section.tables[0];
        let verdicts: Vec<&Cell> = table.rows.iter().map(|row| &row[5]).collect();
        assert_eq!(verdicts, [true, false, false, false, false].map(Cell::Verdict).iter().collect::<Vec<_>>());
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len()));
        let criterion = |row: usize| table.rows[row][2].words();
        assert!(criterion(1).contains("status is -, expected ok") && criterion(1).contains("flag gap is missing"));
        assert!(criterion(4).contains("the promise"));
        assert_eq!(section.text[1], "4 of 5 cases do not hold: 2, 3, 4, 5.");
        assert_eq!(section.aims[0].met, Some(false));
        // All move by the 3 kPa that the recordings lie apart.
        assert!(section.text[2].contains("Chebyshev by QR (nalgebra) 1"), "{}", section.text[2]);
        let Cell::Number(moved) = table.rows[0][7] else { panic!("{:?}", table.rows[0]) };
        assert!((moved - 3.0).abs() < 1e-9, "{moved}");
    }
}
