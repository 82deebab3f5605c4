//! The stability suite: stiff, extreme and broken cases, each with what must come out. One list of cases serves the
//! tests, which fail on any case that does not hold, and the report, which shows all of them.
//!
//! A case names the status and the flags that it expects, one figure with its limit, and what else must hold. Where
//! the case is a fit, the peers of [`crate::peers`] get the same samples and are judged by the same figure.

mod case;
mod fits;
mod gates;
mod plays;
mod rails;
mod ranges;
mod shape;
mod sums;
mod support;
mod taxels;
mod time_steps;
mod trial;

pub use case::{Case, Outcome, PEERS};

use crate::document::{Cell, Section, Table};
use crate::options::Options;

/// A name and the cases of one part of the suite.
pub type Group = (&'static str, fn() -> Vec<Case>);

/// The suite in its order.
pub const GROUPS: [Group; 9] = [
    ("fits", fits::cases),
    ("support", support::cases),
    ("shape", shape::cases),
    ("rails", rails::cases),
    ("ranges", ranges::cases),
    ("gates", gates::cases),
    ("plays", plays::cases),
    ("time_steps", time_steps::cases),
    ("sums", sums::cases),
];

/// Section E: every case with what came out.
///
/// # Errors
/// None at present; the signature is that of every section.
pub fn section(_options: &Options) -> anyhow::Result<Section> {
    Ok(section_of(GROUPS.iter().flat_map(|(_, cases)| cases())))
}

fn section_of(cases: impl IntoIterator<Item = Case>) -> Section {
    let mut summary = Summary::default();
    let mut rows = Vec::new();
    for case in cases {
        let outcome = case.run();
        let failures = case.failures(&outcome);
        summary.add(&case, &outcome, &failures);
        rows.push(row(&case, &outcome, &failures));
    }
    let names = PEERS.iter().map(|(name, _)| (*name).to_owned());
    let columns = ["case", "expected", "criterion", "ours: status", "ours: figure", "verdict"];
    let table = Table {
        id: "e-stability".to_owned(),
        caption: "Each case with the status and flags it expects and the criterion for its figure. The peers get all \
                  samples of the case, gated or not, and the same figure; where that is a difference between two \
                  recordings, each peer is compared with itself. `none` means that the method gave no finite \
                  solution, an empty cell that the case is not theirs. Every fit must moreover give finite readings, \
                  the same bits in another order of its samples, and a table that is monotone wherever the status \
                  allows its use."
            .to_owned(),
        columns: columns.map(str::to_owned).into_iter().chain(names).collect(),
        rows,
    };
    Section {
        id: "e-stability".to_owned(),
        title: "E. Stability".to_owned(),
        text: summary.sentences(),
        figures: Vec::new(),
        tables: vec![table],
    }
}

fn row(case: &Case, outcome: &Outcome, failures: &[String]) -> Vec<Cell> {
    let came_out: Vec<&str> = std::iter::once(outcome.status).chain(outcome.flags.iter().copied()).collect();
    let peer = |peer: &Option<f64>| peer.map_or_else(|| Cell::Text("none".to_owned()), Cell::Number);
    let peers = outcome.peers.as_ref().map(|peers| peers.iter().map(peer).collect());
    let empty = || vec![Cell::Text(String::new()); PEERS.len()];
    let mut criterion = case.criterion();
    if !failures.is_empty() {
        criterion = format!("{criterion} -- BROKEN: {}", failures.join("; "));
    }
    let mut row = vec![
        Cell::Text(format!("{} {}", case.number, case.name)),
        Cell::Text(case.expectation()),
        Cell::Text(criterion),
        Cell::Text(came_out.join(", ")),
        Cell::Number(outcome.figure),
        Cell::Verdict(failures.is_empty()),
    ];
    row.extend(peers.unwrap_or_else(empty));
    row
}

/// What the text says, gathered from the cases.
#[derive(Default)]
struct Summary {
    cases: usize,
    failed: Vec<String>,
    /// Cases that the peers took part in, and how many of them each did not meet.
    contested: usize,
    missed: [usize; PEERS.len()],
}

impl Summary {
    fn add(&mut self, case: &Case, outcome: &Outcome, failures: &[String]) {
        self.cases += 1;
        if !failures.is_empty() {
            self.failed.push(case.number.clone());
        }
        if let Some(peers) = &outcome.peers {
            self.contested += 1;
            for (missed, figure) in self.missed.iter_mut().zip(peers) {
                *missed += usize::from(figure.is_none_or(|figure| figure.is_nan() || figure > case.limit));
            }
        }
    }

    fn sentences(&self) -> Vec<String> {
        let verdict = if self.failed.is_empty() {
            format!("All {} cases hold.", self.cases)
        } else {
            format!("{} of {} cases do not hold: {}.", self.failed.len(), self.cases, self.failed.join(", "))
        };
        let peers = PEERS.iter().zip(self.missed).map(|((name, _), missed)| format!("{name} {missed}"));
        let asked = "Stiff, extreme and broken taxels: whether what comes out is right, or says that it is not. Errors \
                     of fits are against least squares in exact integers, relative to the largest pressure. The same \
                     cases are tests of the repository.";
        let contest = format!(
            "The naive methods took part in {} cases. By the figure alone, without status and flags, of which they \
             have none, they miss: {}.",
            self.contested,
            peers.collect::<Vec<_>>().join(", ")
        );
        vec![asked.to_owned(), verdict, contest]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_section_shows_what_holds_and_what_does_not() {
        let peers = Some([Some(0.1), Some(2.0), None, Some(0.5)]);
        let good = Case::exact("1", "good", move || Outcome { status: "ok", peers, ..Outcome::default() });
        let good = Case { limit: 1.0, ..good };
        let wrong_status = Case { flags: &["gap"], ..Case::exact("2", "wrong", || Outcome::of_figure(0.0)) };
        let too_large = Case::of("3", "too large", "error", 1e-3, || Outcome::of_figure(0.5));
        let not_a_number = Case::of("4", "not a number", "error", 1e-3, || Outcome::of_figure(f64::NAN));
        let broken = Case::of("5", "broken", "error", 1.0, || {
            let mut outcome = Outcome::of_figure(0.0);
            outcome.require(false, || "the promise".to_owned());
            outcome
        });
        let section = section_of([good, wrong_status, too_large, not_a_number, broken]);
        let table = &section.tables[0];
        let verdicts: Vec<bool> = table.rows.iter().map(|row| matches!(row[5], Cell::Verdict(true))).collect();
        assert_eq!(verdicts, [true, false, false, false, false]);
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len()));
        let criterion = |row: usize| match &table.rows[row][2] {
            Cell::Text(text) => text.clone(),
            other => panic!("{other:?}"),
        };
        assert!(criterion(1).contains("status is -, expected ok") && criterion(1).contains("flag gap is missing"));
        assert!(criterion(4).contains("the promise"));
        assert_eq!(section.text[1], "4 of 5 cases do not hold: 2, 3, 4, 5.");
        let missed = "raw QR 0, raw SVD 1, raw normal equations 1, scaled Chebyshev QR 0";
        assert!(section.text[2].contains(missed), "{}", section.text[2]);
    }
}
