//! One case of the suite, and what came out of it.

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

/// What the figure of most fits is.
const RELATIVE_ERROR: &str = "max |dP| / max |P| against exact least squares";

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
    pub(super) run: Box<dyn Fn() -> Outcome>,
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
    pub(super) fn of_figure(figure: f64) -> Self {
        Self { status: NO_STATUS, figure, ..Self::default() }
    }

    /// Sets the figure of our evaluation and that of each peer.
    pub(super) fn contest(
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
    pub(super) fn require(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.broken.push(what());
        }
    }
}

impl Case {
    /// A fit that must be ok and exact to 1e-13.
    pub(super) fn exact(
        number: impl Into<String>,
        name: impl Into<String>,
        run: impl Fn() -> Outcome + 'static,
    ) -> Self {
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
    pub(super) fn of(
        number: &str,
        name: &str,
        figure: &'static str,
        limit: f64,
        run: impl Fn() -> Outcome + 'static,
    ) -> Self {
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
    pub(super) fn expectation(&self) -> String {
        std::iter::once(self.expected).chain(self.flags.iter().copied()).collect::<Vec<_>>().join(", ")
    }

    /// The figure with its limit and what else must hold, in words.
    pub(super) fn criterion(&self) -> String {
        let bound = if self.limit == 0.0 { "= 0".to_owned() } else { format!("<= {}", short(self.limit)) };
        let also = if self.also.is_empty() { String::new() } else { format!("; {}", self.also) };
        format!("{} {bound}{also}", self.figure)
    }
}

/// A limit as people write it.
fn short(value: f64) -> String {
    if (1e-3..1e4).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
}
