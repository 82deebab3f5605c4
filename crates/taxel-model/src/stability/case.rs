//! One case of the suite, what came out of it, and what other methods are to make of the same samples.

use crate::figure;
use crate::stability::taxels::Recording;

/// What the figure of most fits is.
const RELATIVE_ERROR: &str = "max |dP| / max |P| against exact least squares";

/// Shown where a case has no status: it is about a part that gives none.
const NO_STATUS: &str = "-";

/// The greatest of the values; NaN if one is.
pub fn greatest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |most: f64, value| if value.is_nan() || value > most { value } else { most })
}

/// One case of the suite.
pub struct Case {
    /// Unique in the suite: the number of the group, then that of the case.
    pub number: String,
    /// What is special about it.
    pub name: String,
    /// Word of the status that must come out, as [`Status::code`](crate::Status::code); `-` if the case has none.
    pub expected: &'static str,
    /// Words of the flags that must be among those that come out, see [`Outcome::flags`].
    pub flags: &'static [&'static str],
    /// What the figure is, with its unit.
    pub figure: &'static str,
    /// The largest figure that passes.
    pub limit: f64,
    /// What else must hold; empty for nothing beyond the common criteria.
    pub also: &'static str,
    /// What [`Case::run`] does.
    pub run: Box<dyn Fn() -> Outcome>,
}

/// What came out of a case.
#[derive(Default)]
pub struct Outcome {
    /// Word of the status; `-` if there is none.
    pub status: &'static str,
    /// Words of the flags.
    pub flags: Vec<&'static str>,
    /// The case's figure.
    pub figure: f64,
    /// What did not hold, in words.
    pub broken: Vec<String>,
    /// What any other method is judged by; `None` if the case is not theirs.
    pub contest: Option<Contest>,
}

/// Samples that are to be fitted by a polynomial.
pub struct Problem {
    /// All samples, gated or not.
    pub recording: Recording,
    /// Of the polynomial.
    pub order: usize,
}

/// A case's figure for any method: of its curve, or of the difference between its curves of two recordings.
pub struct Contest {
    /// To be fitted by the method, each by itself.
    pub problems: Vec<Problem>,
    figure: Box<Figure>,
}

/// From the curves of a contest's problems to the figure.
type Figure = dyn Fn(&[&dyn Fn(f64) -> f64]) -> f64;

impl Contest {
    /// The figure of a method that gives `curves`, one a problem.
    #[must_use]
    pub fn figure(&self, curves: &[&dyn Fn(f64) -> f64]) -> f64 {
        if curves.len() == self.problems.len() { (self.figure)(curves) } else { f64::NAN }
    }

    /// The greatest difference over `counts` between a method's curves of order 5 of two recordings.
    #[must_use]
    pub fn between(one: &Recording, other: &Recording, counts: Vec<f64>) -> Self {
        let problem = |recording: &Recording| Problem { recording: recording.clone(), order: 5 };
        let figure = move |curves: &[&dyn Fn(f64) -> f64]| {
            greatest(counts.iter().map(|count| (curves[0](*count) - curves[1](*count)).abs()))
        };
        Self { problems: vec![problem(one), problem(other)], figure: Box::new(figure) }
    }
}

impl Outcome {
    /// The outcome of a case without a status.
    #[must_use]
    pub fn of_figure(figure: f64) -> Self {
        Self { status: NO_STATUS, figure, ..Self::default() }
    }

    /// Sets the figure of our evaluation, and has others judged by the same.
    pub(super) fn contest(
        &mut self,
        ours: &dyn Fn(f64) -> f64,
        problem: Problem,
        figure: impl Fn(&dyn Fn(f64) -> f64) -> f64 + 'static,
    ) {
        self.figure = figure(ours);
        let figure: Box<Figure> = Box::new(move |curves| figure(curves[0]));
        self.contest = Some(Contest { problems: vec![problem], figure });
    }

    /// Notes what must hold but does not.
    pub fn require(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.broken.push(what());
        }
    }
}

impl Case {
    /// A fit that must be ok and exact to 1e-13.
    #[must_use]
    pub fn exact(number: impl Into<String>, name: impl Into<String>, run: impl Fn() -> Outcome + 'static) -> Self {
        Self {
            number: number.into(),
            name: name.into(),
            expected: "ok",
            flags: &[],
            figure: RELATIVE_ERROR,
            limit: 1e-13,
            also: "",
            run: Box::new(run),
        }
    }

    /// A case without a status, whose `figure` may be up to `limit`.
    #[must_use]
    pub fn of(number: &str, name: &str, figure: &'static str, limit: f64, run: impl Fn() -> Outcome + 'static) -> Self {
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

    /// The status and flags that must come out, in words.
    #[must_use]
    pub fn expectation(&self) -> String {
        std::iter::once(self.expected).chain(self.flags.iter().copied()).collect::<Vec<_>>().join(", ")
    }

    /// The figure with its limit and what else must hold, in words.
    #[must_use]
    pub fn criterion(&self) -> String {
        let bound = if self.limit == 0.0 { "= 0".to_owned() } else { format!("<= {}", figure(self.limit)) };
        let also = if self.also.is_empty() { String::new() } else { format!("; {}", self.also) };
        format!("{} {bound}{also}", self.figure)
    }
}
