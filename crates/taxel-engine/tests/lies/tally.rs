//! What all stories came to.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use taxel_engine::snapshot::{Reason, in_words};

use crate::allowed::{ALLOWED, Budget, is_allowed, root_of};
use crate::figures::Figures;
use crate::judge::Lie;
use crate::kinds::{Kind, Kinds};

/// Names of lies that a table shows.
pub const NAMES_SHOWN: usize = 20;
/// Lies by less than this have names of their own, in newton.
pub const LITTLE_N: f64 = 0.5;

/// What a load may change by within the noise of a watch, in newton: of a small skin as much as is a little. The noise of a sum
/// grows with the root of how many it is of.
pub fn unseen_in_watch_n(taxels: usize) -> f64 {
    LITTLE_N * (taxels as f64 / SMALL_SKIN_TAXELS).sqrt()
}

/// Taxels of the small skins.
const SMALL_SKIN_TAXELS: f64 = 50.0;

/// Figures of one kind of thing that happens.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    stories: u64,
    samples: u64,
    lies: u64,
    without_force: Duration,
}

/// Lies of one name.
#[derive(Clone, Debug, Default)]
pub struct Liars {
    pub samples: u64,
    /// Of them in a state of OK.
    pub ok: u64,
    pub stories: u64,
    pub worst_n: f64,
    /// The story with the worst, and what it said.
    pub seed: u64,
    pub example: String,
    last_seed: Option<u64>,
}

impl Liars {
    /// One more; whether it is the worst so far.
    fn count(&mut self, seed: u64, ok: bool, lie: Lie) -> bool {
        self.samples += 1;
        self.ok += u64::from(ok);
        self.stories += u64::from(self.last_seed.replace(seed) != Some(seed));
        let worst = lie.excess_n > self.worst_n;
        if worst {
            (self.worst_n, self.seed) = (lie.excess_n, seed);
        }
        worst
    }

    fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.ok += other.ok;
        self.stories += other.stories;
        if other.worst_n > self.worst_n {
            (self.worst_n, self.seed) = (other.worst_n, other.seed);
            self.example.clone_from(&other.example);
        }
    }
}

/// The beginning of what a sample says of itself, `#` for each digit: numbers apart, the text is the reason's name.
fn name_of(reasons: &[Reason]) -> String {
    in_words(reasons).chars().map(|c| if c.is_ascii_digit() { '#' } else { c }).take(90).collect()
}

/// Counts over stories; those of several threads add up.
#[derive(Clone, Debug)]
pub struct Tally {
    rows: Vec<Row>,
    quiet: Row,
    quiet_time: Duration,
    pub stories: u64,
    pub lying_stories: u64,
    pub simulated: Duration,
    pub samples: u64,
    pub lies: u64,
    /// Of them those that are argued, by their place in the list.
    argued: Vec<Liars>,
    /// What the intervals are worth.
    pub figures: Figures,
    liars: BTreeMap<String, Liars>,
    /// Why there was no force in the fault-free time, how long, and in which story last.
    gone: BTreeMap<String, (Duration, u64)>,
}

impl Tally {
    pub fn new() -> Self {
        Self {
            rows: vec![Row::default(); Kind::ALL.len()],
            quiet: Row::default(),
            quiet_time: Duration::ZERO,
            stories: 0,
            lying_stories: 0,
            simulated: Duration::ZERO,
            samples: 0,
            lies: 0,
            argued: vec![Liars::default(); ALLOWED.len()],
            figures: Figures::default(),
            liars: BTreeMap::new(),
            gone: BTreeMap::new(),
        }
    }

    /// A sample with a force was judged; what may have touched it.
    pub fn sample(&mut self, kinds: Kinds, lied: bool) {
        self.samples += 1;
        self.lies += u64::from(lied);
        let count = |row: &mut Row| {
            row.samples += 1;
            row.lies += u64::from(lied);
        };
        if kinds.is_empty() {
            count(&mut self.quiet);
        }
        kinds.iter().for_each(|kind| count(&mut self.rows[kind as usize]));
    }

    /// A lie by its name, which begins with what it may come from.
    pub fn lie(&mut self, name: &str, seed: u64, ok: bool, lie: Lie, told: impl FnOnce() -> String) {
        if let Some(root) = root_of(name, lie.excess_n) {
            self.argued[root].count(seed, ok, lie);
        }
        let liars = self.liars.entry(name.to_owned()).or_default();
        if liars.count(seed, ok, lie) {
            liars.example = told();
        }
    }

    /// Time passed: with a force (`None`) or without one, and what for.
    pub fn time(&mut self, span: Duration, present: Kinds, without: Option<Kinds>) {
        self.simulated += span;
        match without {
            Some(blame) if blame.is_empty() => {
                self.quiet.without_force += span;
                self.quiet_time += span;
            }
            Some(blame) => blame.iter().for_each(|kind| self.rows[kind as usize].without_force += span),
            None if present.is_empty() => self.quiet_time += span,
            None => {}
        }
    }

    /// There is no force though nothing happened; the reasons that the sample gives.
    pub fn gone(&mut self, span: Duration, seed: u64, reasons: &[Reason]) {
        let gone = self.gone.entry(name_of(reasons)).or_default();
        *gone = (gone.0 + span, seed);
    }

    pub fn story(&mut self, ever: Kinds, lied: bool) {
        self.stories += 1;
        self.lying_stories += u64::from(lied);
        if ever.is_empty() {
            self.quiet.stories += 1;
        }
        ever.iter().for_each(|kind| self.rows[kind as usize].stories += 1);
    }

    pub fn add(&mut self, other: &Self) {
        let sum = |row: &mut Row, other: &Row| {
            row.stories += other.stories;
            row.samples += other.samples;
            row.lies += other.lies;
            row.without_force += other.without_force;
        };
        self.rows.iter_mut().zip(&other.rows).for_each(|(row, other)| sum(row, other));
        sum(&mut self.quiet, &other.quiet);
        self.quiet_time += other.quiet_time;
        self.stories += other.stories;
        self.lying_stories += other.lying_stories;
        self.simulated += other.simulated;
        self.samples += other.samples;
        self.lies += other.lies;
        self.argued.iter_mut().zip(&other.argued).for_each(|(ours, theirs)| ours.add(theirs));
        self.figures.add(&other.figures);
        for (name, (span, seed)) in &other.gone {
            let gone = self.gone.entry(name.clone()).or_default();
            *gone = (gone.0 + *span, *seed);
        }
        for (name, theirs) in &other.liars {
            self.liars.entry(name.clone()).or_default().add(theirs);
        }
    }

    /// Share of the time without any fault or command in which there was no force.
    pub fn quiet_share_without_force(&self) -> f64 {
        self.quiet.without_force.as_secs_f64() / self.quiet_time.as_secs_f64().max(1.0)
    }

    /// The lies that nobody has argued, by name.
    pub fn not_argued(&self) -> Vec<(&String, &Liars)> {
        self.most_frequent().into_iter().filter(|(name, liars)| !is_allowed(name, liars.worst_n)).collect()
    }

    /// How often there were such lies: in a million samples, in a thousand stories.
    fn rates(&self, liars: &Liars) -> (f64, f64) {
        let per = |count: u64, all: u64, scale: f64| scale * count as f64 / all.max(1) as f64;
        (per(liars.samples, self.samples, 1e6), per(liars.stories, self.stories, 1e3))
    }

    /// The argued roots that take more than their budgets, in words. A few stories say less of a rate than many do: they may
    /// have more by three standard deviations of their number.
    pub fn beyond_budget(&self) -> Vec<String> {
        let roots = ALLOWED.iter().zip(&self.argued).filter(|(_, argued)| argued.samples > 0);
        let beyond = |(root, argued): (&_, &Liars)| {
            let (cause, has, Budget { samples_per_million, stories_per_thousand, worst_n }, _) = *root;
            let (samples, stories) = self.rates(argued);
            let expected = (stories_per_thousand * self.stories as f64 / 1e3).max(1.0);
            let slack = 1.0 + 3.0 / expected.sqrt();
            let fits = samples <= slack * samples_per_million && stories <= slack * stories_per_thousand;
            (!fits || argued.worst_n > worst_n).then(|| {
                let is = format!("{samples:.0} samples per million, {stories:.1} stories per thousand, worst {:.2} N", argued.worst_n);
                format!("`{cause}{has}`: {is}; budget {samples_per_million}, {stories_per_thousand}, {worst_n} N, LIES_SEED={}", argued.seed)
            })
        };
        roots.filter_map(beyond).collect()
    }

    fn write_argued(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n| argued | samples per million | stories per thousand | worst, N | its budget |")?;
        writeln!(f, "|---|---:|---:|---:|---|")?;
        for ((cause, has, budget, _), argued) in
            ALLOWED.iter().zip(&self.argued).filter(|(_, argued)| argued.samples > 0)
        {
            let Budget { samples_per_million, stories_per_thousand, worst_n } = budget;
            let (samples, stories) = self.rates(argued);
            let budget = format!("{samples_per_million}, {stories_per_thousand}, {worst_n}");
            writeln!(f, "| {cause}{has} | {samples:.1} | {stories:.2} | {:.3} | {budget} |", argued.worst_n)?;
        }
        Ok(())
    }

    /// The names of lies, first those that are more than a little wrong, and among them those of most stories.
    pub fn most_frequent(&self) -> Vec<(&String, &Liars)> {
        let mut ranked: Vec<_> = self.liars.iter().collect();
        ranked.sort_by_key(|(_, liars)| Reverse((liars.worst_n >= LITTLE_N, liars.stories, liars.samples)));
        ranked
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let minutes = self.simulated.as_secs_f64() / 60.0;
        let share = 100.0 * self.quiet_share_without_force();
        writeln!(
            f,
            "{} stories, {minutes:.0} simulated minutes, {} samples judged, {} lies in {} stories, of them {} argued; {share:.2} % of the \
             fault-free time without a force\n",
            self.stories,
            self.samples,
            self.lies,
            self.lying_stories,
            self.argued.iter().map(|root| root.samples).sum::<u64>()
        )?;
        writeln!(f, "{}", self.figures)?;
        writeln!(f, "| what happened | stories | samples judged | lies | s without a force |")?;
        writeln!(f, "|---|---:|---:|---:|---:|")?;
        let named = self.rows.iter().zip(Kind::ALL).map(|(row, kind)| (kind.name(), row));
        for (name, row) in std::iter::once(("nothing", &self.quiet)).chain(named) {
            let gone = row.without_force.as_secs_f64();
            writeln!(f, "| {name} | {} | {} | {} | {gone:.1} |", row.stories, row.samples, row.lies)?;
        }
        writeln!(f, "\n| no force in fault-free time | s | seed |\n|---|---:|---:|")?;
        let mut gone: Vec<_> = self.gone.iter().collect();
        gone.sort_by_key(|(_, (span, _))| Reverse(*span));
        for (reason, (span, seed)) in gone.into_iter().take(5) {
            writeln!(f, "| {reason} | {:.1} | {seed} |", span.as_secs_f64())?;
        }
        self.write_argued(f)?;
        writeln!(f, "\n| lie | stories | samples | of them OK | worst, N beyond | seed |")?;
        writeln!(f, "|---|---:|---:|---:|---:|---:|")?;
        for (name, Liars { samples, ok, stories, worst_n, seed, .. }) in
            self.most_frequent().into_iter().take(NAMES_SHOWN)
        {
            writeln!(f, "| {name} | {stories} | {samples} | {ok} | {worst_n:.3} | {seed} |")?;
        }
        Ok(())
    }
}
