//! Section `stability`: the suite of stiff, extreme and broken cases that taxel-model keeps, with what other methods make of the
//! same samples.

mod peers;

use std::time::Instant;

use serde_json::Value;
use taxel_model::stability::case::{Case, Contest, Problem};

use self::peers::{PEERS, Peer, Polynomial};
use super::args::ReportArgs;
use crate::document::{Aim, Section, Table, row};
use crate::numbers::median;

/// Every case with what came out.
///
/// # Errors
/// None.
#[allow(clippy::unnecessary_wraps)] // as all sections
pub(super) fn section(_: &ReportArgs) -> anyhow::Result<Section> {
    let mut cases: Vec<Case> = taxel_model::stability::GROUPS.iter().flat_map(|(_, cases)| cases()).collect();
    // By the number of the group.
    cases.sort_by_key(|case| case.number.split('.').next().and_then(|group| group.parse::<u32>().ok()));
    Ok(section_of(cases))
}

fn section_of(cases: Vec<Case>) -> Section {
    let (mut rows, mut failed, mut contested) = (Vec::new(), Vec::new(), 0);
    let (mut missed, mut times_us) = ([0; PEERS.len()], [const { Vec::new() }; PEERS.len()]);
    for case in cases {
        let outcome = case.run();
        let failures = case.failures(&outcome);
        let came_out: Vec<&str> = std::iter::once(outcome.status).chain(outcome.flags.iter().copied()).collect();
        let mut criterion = case.criterion();
        if !failures.is_empty() {
            criterion = format!("{criterion} -- BROKEN: {}", failures.join("; "));
            failed.push(case.number.clone());
        }
        let name = format!("{} {}", case.number, case.name);
        let (figure, holds) = (outcome.figure, failures.is_empty());
        let mut row = row![name, case.expectation(), criterion, came_out.join(", "), figure, holds];
        contested += usize::from(outcome.contest.is_some());
        for (peer, (missed, times_us)) in PEERS.iter().zip(missed.iter_mut().zip(&mut times_us)) {
            row.push(match &outcome.contest {
                None => "".into(),
                Some(contest) => {
                    let figure = figure_of(contest, peer, times_us);
                    *missed += usize::from(figure.is_none_or(|figure| figure > case.limit));
                    figure.into()
                }
            });
        }
        rows.push(row);
    }
    let methods = PEERS.iter().zip(missed).zip(times_us);
    let methods = methods.map(|((peer, missed), us)| row![peer.name, missed, median(us)]).collect();
    let text = vec![
        "Stiff, extreme and broken taxels: whether what comes out is right, or says that it is not. Errors of fits are \
         against least squares in exact integers, relative to the largest pressure. The same cases are tests of \
         taxel-model."
            .to_owned(),
        match failed.len() {
            0 => format!("All {} cases hold.", rows.len()),
            some => format!("{some} of {} cases do not hold: {}.", rows.len(), failed.join(", ")),
        },
        format!("Others took part in {contested} cases."),
    ];
    let what = "hard cases, stiff, extreme or broken, that do not come out as they must";
    let aims = vec![Aim::at_most(what, failed.len() as f64, 0.0)];
    Section { text, aims, tables: vec![others(methods), table(rows)], ..Section::default() }
}

fn table(rows: Vec<Vec<Value>>) -> Table {
    let columns = ["case", "expected", "criterion", "status", "figure", "verdict"];
    let caption = "Each case with the status and flags it expects and the criterion for its figure. The others get all samples \
                   of the case, gated or not, and the same figure; where that is a difference between two recordings, each is \
                   compared with itself. `none` means that the method gave no finite solution, an empty cell that the case is \
                   not theirs.";
    Table::new("stability-cases", caption, columns.into_iter().chain(PEERS.map(|peer| peer.name)), rows)
}

/// What other methods miss, and how long they take.
fn others(rows: Vec<Vec<Value>>) -> Table {
    let caption = "Other methods: cases that they miss by the figure alone, without status and flags, of which they have none, and \
                   the median time of a fit.";
    Table::new("stability-others", caption, ["method", "cases missed", "fit, us"], rows)
}

/// The figure of a peer.
fn figure_of(contest: &Contest, peer: &Peer, times_us: &mut Vec<f64>) -> Option<f64> {
    let curve = |Problem { recording, order }: &Problem| {
        let begun = Instant::now();
        let curve = peer.fit(&recording.counts, &recording.kpa, *order);
        times_us.push(1e6 * begun.elapsed().as_secs_f64());
        curve
    };
    let curves: Vec<Polynomial> = contest.problems.iter().filter_map(curve).collect();
    let evaluations: Vec<_> = curves.iter().map(|curve| move |count: f64| curve.evaluate(count)).collect();
    let evaluations: Vec<&dyn Fn(f64) -> f64> = evaluations.iter().map(|e| e as &dyn Fn(f64) -> f64).collect();
    Some(contest.figure(&evaluations)).filter(|figure| figure.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_model::stability::case::Outcome;
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
        let cases = vec![good, wrong_status, too_large, not_a_number, broken];
        let section = section_of(cases);
        let [methods, table] = &section.tables[..] else { panic!() };
        let verdicts: Vec<&Value> = table.rows.iter().map(|row| &row[5]).collect();
        assert_eq!(verdicts, [true, false, false, false, false]);
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len()));
        let criterion = |row: usize| table.rows[row][2].to_string();
        assert!(criterion(1).contains("status is -, expected ok") && criterion(1).contains("flag gap is missing"));
        assert!(criterion(4).contains("the promise"));
        assert_eq!(section.text[1], "4 of 5 cases do not hold: 2, 3, 4, 5.");
        assert!(!section.aims[0].met);
        // All move by the 3 kPa that the recordings lie apart.
        assert_eq!(methods.rows[0][..2], row!["Chebyshev by QR", 1]);
        let moved = table.rows[0][6].as_f64().unwrap();
        assert!((moved - 3.0).abs() < 1e-9, "{moved}");
    }
}
