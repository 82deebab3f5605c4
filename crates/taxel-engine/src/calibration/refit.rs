//! The fit of stored samples once more, as configured: of one session, or of several together.
//!
//! Order of calls: [`Refit::plan`] says from what is known of the sessions whether it can be, [`Refit::job`] takes what
//! they gathered. As long as the configuration is the same the fit of one session is the one that it had itself.

use std::sync::Arc;

use taxel_skin::CountRange;

use crate::board_settings::differ_in;
use crate::calibration::branch::Branch;
use crate::calibration::calibration_plan::CalibrationPlan;
use crate::calibration::fit::course::falling;
use crate::calibration::fit::recipe_options::FitRecipe;
use crate::calibration::job::FitJob;
use crate::calibration::samples::{RampBaseline, SessionSamples};
use crate::calibration::view::SessionView;
use crate::request::{ErrorReason, Rejection};

/// Most sessions that are fitted together: their numbers are kept with the model set.
pub const TOGETHER_MAX: usize = 32;

/// A session whose samples are fitted once more.
#[derive(Clone, Debug)]
pub struct StoredSession {
    /// What is known of it.
    pub view: Arc<SessionView>,
    /// The settings of the boards while it gathered, where its own model set still tells them.
    pub board_settings: Option<Vec<String>>,
}

/// A fit of stored samples that can be.
#[derive(Clone, Debug)]
pub struct Refit {
    plan: CalibrationPlan,
    counts: CountRange,
    recipe: FitRecipe,
    board_settings: Vec<String>,
    /// Ascending by number, at least one.
    sessions: Vec<StoredSession>,
}

impl StoredSession {
    /// How the boards were set, where that is known.
    fn settings(&self) -> Option<&[String]> {
        self.board_settings.as_deref().or_else(|| self.view.known_settings())
    }
}

impl Refit {
    /// What is to be fitted, and how. `counts` is the range of the patch's converters.
    ///
    /// # Errors
    /// [`Rejection`] if no session or one twice is named, one is under way or has no
    /// samples, or the sessions do not go together; it says which of them.
    pub fn plan(
        plan: CalibrationPlan,
        counts: CountRange,
        mut sessions: Vec<StoredSession>,
    ) -> Result<Self, Rejection> {
        sessions.sort_by_key(|session| session.view.number);
        check_names(&sessions)?;
        sessions.iter().try_for_each(|session| check_session(&plan, &session.view))?;
        let gathered = sessions.iter().map(|session| session.view.accepted).sum();
        check_size(&plan, gathered)?;
        let board_settings = board_settings(&plan, &sessions)?;
        let recipe = plan.recipe(branch(&sessions));
        Ok(Self { plan, counts, recipe, board_settings, sessions })
    }

    /// The numbers of the sessions, in the order in which [`Refit::job`] takes their samples.
    #[must_use]
    pub fn numbers(&self) -> Vec<u64> {
        self.sessions.iter().map(|session| session.view.number).collect()
    }

    /// The fit of what the sessions gathered, one entry each, in the order of [`Refit::numbers`]. `wall_ns`: the present.
    ///
    /// # Errors
    /// [`Rejection`] if samples are of another layout of the patch, or too many; it says of which session.
    pub fn job(self, samples: Vec<SessionSamples>, wall_ns: i64) -> Result<FitJob, Rejection> {
        check_size(&self.plan, samples.iter().map(|samples| samples.samples.len() as u64).sum())?;
        for (session, samples) in self.sessions.iter().zip(&samples) {
            self.check_layout(session.view.number, samples)?;
        }
        let both = self.sessions.iter().map(|session| session.view.branches == Branch::Both);
        let samples = samples.into_iter().zip(both);
        let samples = samples.map(|(samples, both)| if both { samples.of_branch(self.recipe.branch) } else { samples });
        let samples: Vec<SessionSamples> = samples.collect();
        let numbers = self.numbers();
        let mut left_out: Vec<u16> = self.sessions.iter().flat_map(|s| s.view.left_out.iter().copied()).collect();
        left_out.sort_unstable();
        left_out.dedup();
        Ok(FitJob {
            session: numbers.last().copied().unwrap_or_default(),
            together: if numbers.len() > 1 { numbers } else { Vec::new() },
            fit: 0,
            patch: self.plan.patch,
            wall_ns,
            board_settings: self.board_settings,
            samples: Arc::new(joined(samples)?),
            simulated: self.plan.simulated,
            modules: self.plan.modules,
            left_out,
            recipe: self.recipe,
        })
    }

    fn check_layout(&self, number: u64, samples: &SessionSamples) -> Result<(), Rejection> {
        let patch = &self.plan.patch;
        let wrong = samples
            .samples
            .iter()
            .map(|sample| sample.counts.counts())
            .find(|counts| counts.len() != self.plan.taxels || counts.range() != self.counts);
        let Some(wrong) = wrong else { return Ok(()) };
        let (has, wants) = (wrong.len(), self.plan.taxels);
        let why = if has == wants {
            format!("session {number} has counts of another width than patch `{patch}`")
        } else {
            format!(
                "session {number} has samples of {has} taxels, patch `{patch}` has {wants}: it is of another layout"
            )
        };
        Err(ErrorReason::LayoutChanged.because(why))
    }
}

fn invalid<T>(field: &'static str, problem: String) -> Result<T, Rejection> {
    Err(Rejection::InvalidArgument { field, problem })
}

/// Each session once, and not too many. They are in the order of their numbers.
fn check_names(sessions: &[StoredSession]) -> Result<(), Rejection> {
    if !(1..=TOGETHER_MAX).contains(&sessions.len()) {
        return invalid("sessions", format!("{} are named, expected 1 to {TOGETHER_MAX}", sessions.len()));
    }
    match sessions.windows(2).find(|pair| pair[0].view.number == pair[1].view.number) {
        Some(pair) => invalid("sessions", format!("session {} is named twice", pair[0].view.number)),
        None => Ok(()),
    }
}

fn check_session(plan: &CalibrationPlan, view: &SessionView) -> Result<(), Rejection> {
    let (number, patch) = (view.number, &plan.patch);
    if view.patch != *patch {
        let why = format!("session {number} is of patch `{}`, the others are of `{patch}`", view.patch);
        return Err(ErrorReason::SessionsDiffer.because(why));
    }
    if view.state.is_open() {
        let why = format!("session {number} is {}; finish or abort it first", view.state.name());
        return Err(ErrorReason::SessionOpen.because(why));
    }
    view.check_trusted()?;
    let modules = plan.modules.len();
    match view.left_out.iter().find(|module| usize::from(**module) >= modules) {
        Some(module) => {
            let place = usize::from(*module) + 1;
            let why =
                format!("session {number} was without module {place} of patch `{patch}`, which has {modules} now");
            Err(ErrorReason::LayoutChanged.because(why))
        }
        None => Ok(()),
    }
}

/// As many as a session may have: so much memory and time is there for one fit.
fn check_size(plan: &CalibrationPlan, samples: u64) -> Result<(), Rejection> {
    let most = plan.session.scans_max as u64;
    if samples <= most {
        return Ok(());
    }
    let why = format!("the sessions have {samples} scans together, and {most} is the most that are fitted at once");
    Err(ErrorReason::SessionsTooLarge.because(why))
}

/// Counts depend on the settings of the boards, so these must be the same. The lines that tell most are those of the fit.
fn board_settings(plan: &CalibrationPlan, sessions: &[StoredSession]) -> Result<Vec<String>, Rejection> {
    let known = sessions.iter().filter_map(|session| Some((session.view.number, session.settings()?)));
    let known: Vec<(u64, &[String])> = known.collect();
    for (n, (first, settings)) in known.iter().enumerate() {
        let differs = known[n + 1..].iter().find_map(|(other, theirs)| Some((other, differ_in(settings, theirs)?)));
        if let Some((other, (a, b))) = differs {
            let why = format!("the boards had other settings in session {first} ({a}) than in session {other} ({b})");
            return Err(ErrorReason::SessionsDiffer.because(why));
        }
    }
    let tells_most = known.iter().max_by_key(|(_, settings)| settings.iter().map(String::len).sum::<usize>());
    Ok(tells_most.map_or_else(|| plan.board_settings.clone(), |(_, settings)| settings.to_vec()))
}

/// The branches that are fitted: both where every session gathered both.
fn branch(sessions: &[StoredSession]) -> Branch {
    let both = sessions.iter().all(|session| session.view.branches == Branch::Both);
    if both { Branch::Both } else { Branch::Rising }
}

impl SessionSamples {
    /// Over the rising branch those that were taken up to the top of each ramp, else all: what fell belongs to another curve, and
    /// fitted together they would give the one between them as that of rising pressure.
    #[must_use]
    pub fn of_branch(self, branch: Branch) -> Self {
        if branch == Branch::Both {
            return self;
        }
        let falling = falling(&self.samples, Branch::Both);
        let rose = self.samples.into_iter().zip(falling).filter(|(_, falls)| !falls);
        Self { samples: rose.map(|(sample, _)| sample).collect(), ..self }
    }
}

/// All samples, with the ramps numbered on.
fn joined(all: Vec<SessionSamples>) -> Result<SessionSamples, Rejection> {
    let mut joined = SessionSamples::default();
    for samples in all {
        let first = joined.ramps.len();
        let number = |ramp: u16| {
            let why = "the sessions have more than 65535 ramps";
            u16::try_from(first + usize::from(ramp)).map_err(|_| ErrorReason::SessionsTooLarge.because(why))
        };
        for ramp in samples.ramps {
            joined.ramps.push(RampBaseline { ramp: number(ramp.ramp)?, ..ramp });
        }
        joined.samples.reserve_exact(samples.samples.len());
        for mut sample in samples.samples {
            sample.ramp = number(sample.ramp)?;
            joined.samples.push(sample);
        }
    }
    Ok(joined)
}

#[cfg(test)]
#[path = "refit_tests.rs"]
mod tests;
