//! The fit of stored samples once more, as configured: of one session, or of several together.
//!
//! Order of calls: [`Refit::plan`] says from what is known of the sessions whether it can be, [`Refit::job`] takes what
//! they gathered. As long as the configuration is the same the fit of one session is the one that it had itself.

use std::sync::Arc;

use crate::board_settings::differ_in;
use crate::calibration::branch::Branch;
use crate::calibration::fit::course::falling;
use crate::calibration::job::FitJob;
use crate::calibration::samples::{RampBaseline, SessionSamples};
use crate::calibration::view::SessionView;
use crate::plan::PatchPlan;
use crate::request::{ErrorReason, Rejection};

/// Most sessions that are fitted together: their numbers are kept with the model set.
pub const TOGETHER_MAX: usize = 32;

/// A fit of stored samples that can be.
#[derive(Clone, Debug)]
pub struct Refit {
    plan: PatchPlan,
    /// Ascending by number, at least one.
    sessions: Vec<Arc<SessionView>>,
}

impl Refit {
    /// What is to be fitted, and how.
    ///
    /// # Errors
    /// [`Rejection`] if no session or one twice is named, one is under way or has no
    /// samples, or the sessions do not go together; it says which of them.
    pub fn plan(plan: PatchPlan, mut sessions: Vec<Arc<SessionView>>) -> Result<Self, Rejection> {
        sessions.sort_by_key(|session| session.number);
        check_names(&sessions)?;
        sessions.iter().try_for_each(|session| check_session(&plan, session))?;
        check_size(&plan, sessions.iter().map(|session| session.accepted).sum())?;
        check_settings(&sessions)?;
        Ok(Self { plan, sessions })
    }

    /// The numbers of the sessions, in the order in which [`Refit::job`] takes their samples.
    #[must_use]
    pub fn numbers(&self) -> Vec<u64> {
        self.sessions.iter().map(|session| session.number).collect()
    }

    /// The fit of what the sessions gathered, one entry each, in the order of [`Refit::numbers`]. `wall_ns`: the present.
    ///
    /// # Errors
    /// [`Rejection`] if samples are of another layout of the patch, or too many; it says of which session.
    pub fn job(self, samples: Vec<SessionSamples>, wall_ns: i64) -> Result<FitJob, Rejection> {
        check_size(&self.plan, samples.iter().map(|samples| samples.samples.len() as u64).sum())?;
        let branches = branch(&self.sessions);
        let mut fitted = Vec::with_capacity(samples.len());
        for (session, samples) in self.sessions.iter().zip(samples) {
            self.check_layout(session.number, &samples)?;
            let both = session.branches == Branch::Both;
            fitted.push(if both { samples.of_branch(branches) } else { samples });
        }
        let mut left_out: Vec<u16> =
            self.sessions.iter().flat_map(|session| session.left_out.iter().copied()).collect();
        left_out.sort_unstable();
        left_out.dedup();
        Ok(FitJob {
            sessions: self.numbers(),
            wall_ns,
            board_settings: self.sessions.first().map_or_else(Vec::new, |session| session.board_settings.to_vec()),
            left_out,
            ..FitJob::new(&self.plan, branches, Arc::new(joined(fitted)?))
        })
    }

    fn check_layout(&self, number: u64, samples: &SessionSamples) -> Result<(), Rejection> {
        let patch = &self.plan.patch;
        ErrorReason::LayoutChanged.unless(samples.is_of(patch), || {
            format!("session {number} is of another layout of patch `{}`, or has counts of another width", patch.name())
        })
    }
}

/// Each session once, and not too many. They are in the order of their numbers.
fn check_names(sessions: &[Arc<SessionView>]) -> Result<(), Rejection> {
    let invalid = |problem: String| Err(Rejection::invalid("sessions", problem));
    if !(1..=TOGETHER_MAX).contains(&sessions.len()) {
        return invalid(format!("{} are named, expected 1 to {TOGETHER_MAX}", sessions.len()));
    }
    match sessions.windows(2).find(|pair| pair[0].number == pair[1].number) {
        Some(pair) => invalid(format!("session {} is named twice", pair[0].number)),
        None => Ok(()),
    }
}

fn check_session(plan: &PatchPlan, view: &SessionView) -> Result<(), Rejection> {
    let (number, patch) = (view.number, plan.patch.name());
    ErrorReason::SessionsDiffer.unless(view.patch == patch, || {
        format!("session {number} is of patch `{}`, the others are of `{patch}`", view.patch)
    })?;
    view.check_closed("finish or abort it first")?;
    view.check_trusted()?;
    let modules = plan.patch.modules().len();
    let gone = view.left_out.iter().map(|module| usize::from(*module) + 1).find(|module| *module > modules);
    ErrorReason::LayoutChanged.unless(gone.is_none(), || {
        let module = gone.unwrap_or_default();
        format!("session {number} was without module {module} of patch `{patch}`, which has {modules} now")
    })
}

/// As many as a session may have: so much memory and time is there for one fit.
fn check_size(plan: &PatchPlan, samples: u64) -> Result<(), Rejection> {
    let most = plan.session.scans_max as u64;
    ErrorReason::SessionsTooLarge.unless(samples <= most, || {
        format!("the sessions have {samples} scans together, and {most} is the most that are fitted at once")
    })
}

/// Counts depend on the settings of the boards, so these must be the same.
fn check_settings(sessions: &[Arc<SessionView>]) -> Result<(), Rejection> {
    let pairs =
        sessions.iter().enumerate().flat_map(|(n, one)| sessions[n + 1..].iter().map(move |other| (one, other)));
    let differs = |(one, other): (&Arc<SessionView>, &Arc<SessionView>)| {
        let (a, b) = differ_in(&one.board_settings, &other.board_settings)?;
        let (first, second) = (one.number, other.number);
        Some(format!("the boards had other settings in session {first} ({a}) than in session {second} ({b})"))
    };
    pairs.into_iter().find_map(differs).map_or(Ok(()), |why| Err(ErrorReason::SessionsDiffer.because(why)))
}

/// The branches that are fitted: both where every session gathered both.
fn branch(sessions: &[Arc<SessionView>]) -> Branch {
    let both = sessions.iter().all(|session| session.branches == Branch::Both);
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
