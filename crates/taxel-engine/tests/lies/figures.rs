//! What the published intervals are worth: how wide they are, how often they hold the truth, what they cost.
//!
//! The interval that is judged here is the one of 95 % ([`Stated`]). A force that never lies may still say nothing, so its
//! width, its share of OK, its lower bounds and its phantoms are counted beside the lies. The *interval score* is the one
//! number that is worse for lies and for hedging: `width + 40 x (how far the truth lies outside)` (Gneiting and Raftery 2007,
//! for 95 %). An interval that is open above is charged as if it reached [`OPEN_N`].

use std::fmt;
use std::time::Duration;

use taxel_engine::snapshot::{ForceSample, ForceState, Term};

use crate::judge::{LIE_SIGMAS, SIGMAS, Stated, judge};
use crate::truth::TRIFLE_N;

/// What an interval that is open above is wide, in newton: the heaviest mass of a story.
const OPEN_N: f64 = 30.0;
/// Price of a newton outside of an interval of 95 %: 2 / 0.05.
const MISS_PRICE: f64 = 40.0;
/// A force that has stood still for so long is steady.
pub const STEADY: Duration = Duration::from_secs(1);
/// Below this a relative error says nothing, in newton.
const WEIGHED_N: f64 = 1.0;
/// A force of nothing by more than this is a phantom, in newton.
const PHANTOM_N: f64 = 0.3;
/// Time between two samples, in seconds.
const PERIOD_S: f64 = 0.05;
/// Most touched taxels of each bin but the last.
const BINS: [u32; 3] = [3, 6, 12];

/// A sample with a force, and what is known of it.
#[derive(Clone, Copy, Debug)]
pub struct Judged<'a> {
    pub force: &'a ForceSample,
    /// Least and greatest that the truth was within what the sample may be of, in newton.
    pub truth: (f64, f64),
    /// The truth, if it has stood still for [`STEADY`].
    pub steady: Option<f64>,
    /// Whether nothing may have gone wrong.
    pub quiet: bool,
}

/// A sum of values and their number.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    n: u64,
}

impl Mean {
    fn push(&mut self, value: f64) {
        self.sum += value;
        self.n += 1;
    }

    fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.n += other.n;
    }

    fn get(self) -> f64 {
        self.sum / self.n.max(1) as f64
    }
}

/// Means over all samples, or over those in whose time nothing may have gone wrong.
#[derive(Clone, Copy, Debug, Default)]
struct Worth {
    ok: Mean,
    sigma: Mean,
    /// Of intervals that are closed.
    width: Mean,
    /// What the interval has above its total and two standard uncertainties.
    undetected: Mean,
    score: Mean,
    open: Mean,
    /// Of the open ones those that would be right if they were closed.
    needless: Mean,
}

/// What the intervals of stories are worth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Figures {
    all: Worth,
    quiet: Worth,
    /// Squares of relative errors and of relative uncertainties under steady loads, nothing having gone wrong.
    error: Mean,
    sigma: Mean,
    /// The same squares of each term of the budget.
    terms: [Mean; Term::ALL.len()],
    /// By touched taxels: whether the closed interval holds the truth, and whether it does without the undetected force.
    covered: [[Mean; 2]; BINS.len() + 1],
    phantom_s: f64,
    phantom_newton_s: f64,
    /// Time simulated, and of it with a force, in seconds.
    time_s: f64,
    force_s: f64,
}

impl Worth {
    fn push(&mut self, judged: &Judged<'_>, stated: &Stated) {
        let miss = judge(stated.interval(SIGMAS), judged.truth).map_or(0.0, |lie| lie.excess_n);
        let width = if stated.open { OPEN_N.max(stated.width_n()) } else { stated.width_n() };
        let indicator = |holds: bool| f64::from(u8::from(holds));
        self.ok.push(indicator(judged.force.state == ForceState::Ok));
        self.sigma.push(stated.sigma);
        self.undetected.push(stated.undetected_n());
        self.open.push(indicator(stated.open));
        self.score.push(width + MISS_PRICE * miss);
        if stated.open {
            self.needless.push(indicator(judge(stated.closed(LIE_SIGMAS), judged.truth).is_none()));
        } else {
            self.width.push(stated.width_n());
        }
    }

    fn add(&mut self, other: &Self) {
        let Self { ok, sigma, width, undetected, score, open, needless } = other;
        self.ok.add(*ok);
        self.sigma.add(*sigma);
        self.width.add(*width);
        self.undetected.add(*undetected);
        self.score.add(*score);
        self.open.add(*open);
        self.needless.add(*needless);
    }
}

impl Figures {
    /// A sample with a force.
    pub fn sample(&mut self, judged: &Judged<'_>, stated: &Stated) {
        self.all.push(judged, stated);
        if judged.force.state == ForceState::Ok
            && judged.steady.is_some_and(|newton| newton < TRIFLE_N)
            && stated.total > PHANTOM_N
        {
            self.phantom_s += PERIOD_S;
            self.phantom_newton_s += PERIOD_S * stated.total;
        }
        if !judged.quiet {
            return;
        }
        self.quiet.push(judged, stated);
        let steady = judged.steady.filter(|newton| *newton >= WEIGHED_N);
        if let Some(newton) = steady {
            self.error.push(((stated.total - newton) / newton).powi(2));
            self.sigma.push((stated.sigma / newton).powi(2));
            for (sum, term) in self.terms.iter_mut().zip(Term::ALL) {
                sum.push((judged.force.budget.of(term).0 / newton).powi(2));
            }
        }
        if judged.truth.0 > TRIFLE_N && judged.force.active > 0 && !stated.open {
            let bin = BINS.iter().position(|most| judged.force.active <= *most).unwrap_or(BINS.len());
            let bare = (stated.total - SIGMAS * stated.sigma, stated.total + SIGMAS * stated.sigma);
            for (covered, interval) in self.covered[bin].iter_mut().zip([stated.closed(SIGMAS), bare]) {
                covered.push(f64::from(u8::from(judge(interval, judged.truth).is_none())));
            }
        }
    }

    pub fn time(&mut self, span: Duration, with_force: bool) {
        self.time_s += span.as_secs_f64();
        self.force_s += if with_force { span.as_secs_f64() } else { 0.0 };
    }

    pub fn add(&mut self, other: &Self) {
        self.all.add(&other.all);
        self.quiet.add(&other.quiet);
        self.error.add(other.error);
        self.sigma.add(other.sigma);
        self.terms.iter_mut().zip(&other.terms).for_each(|(ours, theirs)| ours.add(*theirs));
        for (ours, theirs) in self.covered.as_flattened_mut().iter_mut().zip(other.covered.as_flattened()) {
            ours.add(*theirs);
        }
        self.phantom_s += other.phantom_s;
        self.phantom_newton_s += other.phantom_newton_s;
        self.time_s += other.time_s;
        self.force_s += other.force_s;
    }

    /// The numbers that are compared between two builds, as [`Figures::NAMES`] names them.
    pub fn numbers(&self) -> [f64; Self::NAMES.len()] {
        let Worth { ok, sigma, width, undetected, score, open, .. } = self.all;
        let force = self.force_s / self.time_s.max(1e-9);
        [force, ok.get(), open.get(), sigma.get(), undetected.get(), width.get(), score.get(), self.phantom_s]
    }

    pub const NAMES: [&'static str; 8] =
        ["with_force", "ok", "open", "sigma_n", "undetected_n", "width_n", "score_n", "phantom_s"];

    /// What is worse than these bounds, in words.
    pub fn beyond(&self, bounds: &Bounds) -> Vec<String> {
        let needless = self.quiet.needless.get();
        let checks = [
            ("share of fault-free samples OK", self.quiet.ok.get(), bounds.ok_min, true),
            ("time with a force", self.force_s / self.time_s.max(1e-9), bounds.force_min, true),
            ("fault-free lower bounds", self.quiet.open.get(), bounds.open_max, false),
            ("mean undetected force, N", self.quiet.undetected.get(), bounds.undetected_max_n, false),
            ("mean sigma, N", self.quiet.sigma.get(), bounds.sigma_max_n, false),
            ("mean width, N", self.quiet.width.get(), bounds.width_max_n, false),
            ("relative error under steady load", self.error.get().sqrt(), bounds.error_max, false),
            ("stated sigma over error", self.sigma_over_error(), bounds.sigma_over_error_max, false),
            ("least coverage of the bins of touched taxels", self.least_covered(), bounds.covered_min, true),
            ("interval score, N", self.all.score.get(), bounds.score_max_n, false),
            ("phantoms, share of the time", self.phantom_s / self.time_s.max(1e-9), bounds.phantom_max, false),
        ];
        let worse = |(_, is, bound, at_least): &(&str, f64, f64, bool)| if *at_least { is < bound } else { is > bound };
        let told = |(name, is, bound, _)| format!("{name}: {is:.4}, bound {bound} (needless bounds: {needless:.3})");
        checks.into_iter().filter(worse).map(told).collect()
    }

    fn least_covered(&self) -> f64 {
        self.covered.iter().map(|[whole, _]| whole.get()).fold(1.0, f64::min)
    }

    fn sigma_over_error(&self) -> f64 {
        (self.sigma.get() / self.error.get().max(1e-12)).sqrt()
    }
}

/// From where on figures are worse than they were.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub ok_min: f64,
    pub force_min: f64,
    pub open_max: f64,
    pub undetected_max_n: f64,
    pub sigma_max_n: f64,
    pub width_max_n: f64,
    pub error_max: f64,
    pub sigma_over_error_max: f64,
    pub covered_min: f64,
    pub score_max_n: f64,
    pub phantom_max: f64,
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |mean: Mean| 100.0 * mean.get();
        writeln!(
            f,
            "\n| samples | OK, % | sigma, N | undetected, N | width of 95 %, N | lower bounds, % | of them needless, % | interval score, N |"
        )?;
        writeln!(f, "|---|---:|---:|---:|---:|---:|---:|---:|")?;
        for (name, worth) in [("fault-free", &self.quiet), ("all", &self.all)] {
            let Worth { ok, sigma, width, undetected, score, open, needless } = *worth;
            let means = [sigma, undetected, width].map(|mean| format!("{:.3}", mean.get())).join(" | ");
            let (ok, open, needless) = (percent(ok), percent(open), percent(needless));
            writeln!(f, "| {name} | {ok:.1} | {means} | {open:.2} | {needless:.2} | {:.3} |", score.get())?;
        }
        let (error, sigma) = (100.0 * self.error.get().sqrt(), 100.0 * self.sigma.get().sqrt());
        let (over, n) = (self.sigma_over_error(), self.error.n);
        writeln!(
            f,
            "\nSteady load of {WEIGHED_N} N and more, fault-free: error {error:.1} %, stated sigma {sigma:.1} %, ratio {over:.2} ({n} samples)."
        )?;
        let mut terms: Vec<(Term, f64)> = Term::ALL.into_iter().zip(self.terms.map(Mean::get)).collect();
        terms.sort_by(|a, b| b.1.total_cmp(&a.1));
        let of_terms =
            terms.iter().take(6).map(|(term, square)| format!("{} {:.1} %", term.name(), 100.0 * square.sqrt()));
        writeln!(f, "The greatest terms of its budget: {}.", of_terms.collect::<Vec<_>>().join(", "))?;
        write!(
            f,
            "Fault-free intervals of 95 % that hold the truth, by touched taxels (in brackets without the undetected force):"
        )?;
        for ([whole, bare], name) in self.covered.iter().zip(["1-3", "4-6", "7-12", "more"]) {
            write!(f, " {name}: {:.1} % ({:.1} %, {} samples);", percent(*whole), percent(*bare), whole.n)?;
        }
        let hours = self.time_s / 3.6e6;
        let (seconds, newton) = (self.phantom_s / hours.max(1e-12), self.phantom_newton_s / self.phantom_s.max(1e-12));
        writeln!(
            f,
            "\nPhantoms in 1,000 h: {seconds:.0} s of {newton:.2} N in the mean. With a force: {:.2} % of the time.",
            100.0 * self.force_s / self.time_s.max(1e-9)
        )
    }
}
