//! The stability suite: stiff, extreme and broken cases, each with what must come out. One list of cases serves the
//! tests, which fail on any case that does not hold, and the report, which shows all of them.
//!
//! A case names the status and the flags that it expects, one figure with its limit, and what else must hold. Where
//! the case is a fit, the peers of [`crate::peers`] get the same samples and are judged by the same figure.

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

use crate::document::{Cell, Section, Table};
use crate::options::Options;
use crate::peers::{Polynomial, fit_chebyshev_qr, fit_raw_normal, fit_raw_qr, fit_raw_svd};

/// A naive method: abscissae, ordinates, weights, order.
type Peer = fn(&[f64], &[f64], Option<&[f64]>, usize) -> Option<Polynomial>;

/// The naive methods, with their names in the table.
pub const PEERS: [(&str, Peer); 4] = [
    ("raw QR", fit_raw_qr),
    ("raw SVD", fit_raw_svd),
    ("raw normal equations", fit_raw_normal),
    ("scaled Chebyshev QR", fit_chebyshev_qr),
];

/// Shown where a case has no status: it is about a part that gives none.
const NO_STATUS: &str = "-";

/// One case of the suite.
pub struct Case {
    /// Unique in the suite: the number of the group, then that of the case.
    pub number: String,
    /// What is special about it.
    pub name: String,
    /// Word of the status that must come out, as [`taxel_model::Status::code`]; `-` if the case has none.
    pub expected: &'static str,
    /// Words of the flags that must be among those that come out, see [`Outcome::flags`].
    pub flags: &'static [&'static str],
    /// What the figure is, with its unit.
    pub figure: &'static str,
    /// The largest figure that passes.
    pub limit: f64,
    /// What else must hold; empty for nothing beyond the common criteria.
    pub also: &'static str,
    run: Box<dyn Fn() -> Outcome>,
}

/// What came out of a case.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Word of the status; `-` if there is none.
    pub status: &'static str,
    /// Words of the flags.
    pub flags: Vec<&'static str>,
    /// The case's figure.
    pub figure: f64,
    /// What did not hold, in words.
    pub broken: Vec<String>,
    /// The figure of each of [`PEERS`], where it gave a solution; `None` if the case is not theirs.
    pub peers: Option<[Option<f64>; PEERS.len()]>,
}

impl Outcome {
    /// The outcome of a case without a status.
    fn of_figure(figure: f64) -> Self {
        Self { status: NO_STATUS, figure, ..Self::default() }
    }

    /// Sets the figure of our evaluation and that of each peer.
    fn contest(
        &mut self,
        ours: &dyn Fn(f64) -> f64,
        peers: [Option<Polynomial>; PEERS.len()],
        figure: impl Fn(&dyn Fn(f64) -> f64) -> f64,
    ) {
        self.figure = figure(ours);
        let of = |peer: Polynomial| Some(figure(&|count| peer.evaluate(count))).filter(|figure| figure.is_finite());
        self.peers = Some(peers.map(|peer| peer.and_then(of)));
    }

    /// Notes what must hold but does not.
    fn require(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.broken.push(what());
        }
    }
}

impl Case {
    /// A fit that must be ok and exact to 1e-13.
    fn exact(number: impl Into<String>, name: impl Into<String>, run: impl Fn() -> Outcome + 'static) -> Self {
        Self {
            number: number.into(),
            name: name.into(),
            expected: "ok",
            flags: &[],
            figure: trial::RELATIVE_ERROR,
            limit: 1e-13,
            also: "",
            run: Box::new(run),
        }
    }

    /// A case without a status, whose `figure` may be up to `limit`.
    fn of(number: &str, name: &str, figure: &'static str, limit: f64, run: impl Fn() -> Outcome + 'static) -> Self {
        Self { expected: NO_STATUS, figure, limit, ..Self::exact(number, name, run) }
    }

    /// Runs the case.
    #[must_use]
    pub fn run(&self) -> Outcome {
        (self.run)()
    }

    /// Why `outcome` does not meet the case; empty if it does.
    #[must_use]
    pub fn failures(&self, outcome: &Outcome) -> Vec<String> {
        let mut failures = outcome.broken.clone();
        if outcome.status != self.expected {
            failures.push(format!("status is {}, expected {}", outcome.status, self.expected));
        }
        for flag in self.flags.iter().filter(|flag| !outcome.flags.contains(flag)) {
            failures.push(format!("flag {flag} is missing, there are {:?}", outcome.flags));
        }
        // A figure that is not a number fails too.
        if outcome.figure.is_nan() || outcome.figure > self.limit {
            failures.push(format!("{} is {:.2e}, at most {:.0e} is allowed", self.figure, outcome.figure, self.limit));
        }
        failures
    }

    fn expectation(&self) -> String {
        std::iter::once(self.expected).chain(self.flags.iter().copied()).collect::<Vec<_>>().join(", ")
    }

    fn criterion(&self) -> String {
        let bound = if self.limit == 0.0 { "= 0".to_owned() } else { format!("<= {}", short(self.limit)) };
        let also = if self.also.is_empty() { String::new() } else { format!("; {}", self.also) };
        format!("{} {bound}{also}", self.figure)
    }
}

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

/// A limit as people write it.
fn short(value: f64) -> String {
    if (1e-3..1e4).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
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
