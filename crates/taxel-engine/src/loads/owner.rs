//! The known loads of one patch: those that were read, and the one that is being read.

use std::sync::Arc;
use taxel_skin::Time;

use crate::force::owner::Measured;
use crate::loads::load::{KnownLoad, Load, LoadsPlan, Reading, Validation, Weight, judge};
use crate::loads::watch::LoadWatch;
use crate::request::{ErrorReason, Rejection, RequestId};

/// A load that was read, or why it could not be.
#[derive(Clone, Debug)]
pub struct LoadRead {
    /// Whom to answer.
    pub request: RequestId,
    /// What was laid on and read, without a number and a model set; or why nothing was.
    pub outcome: Result<Load, Rejection>,
}

/// The known loads of one patch.
#[derive(Debug)]
pub struct Loads {
    plan: LoadsPlan,
    /// Oldest first.
    all: Vec<Arc<Load>>,
    watch: Option<LoadWatch>,
}

impl Loads {
    /// The loads of earlier runs, oldest first.
    pub const fn new(plan: LoadsPlan, all: Vec<Arc<Load>>) -> Self {
        Self { plan, all, watch: None }
    }

    /// What they are judged by.
    pub const fn plan(&self) -> &LoadsPlan {
        &self.plan
    }

    /// Begins to read a known load.
    ///
    /// # Errors
    /// [`Rejection`] for a load that cannot be, a load to be replaced that is not there, or while another is being read.
    pub fn begin(&mut self, now: Time, request: RequestId, known: KnownLoad) -> Result<(), Rejection> {
        let force_n = known.force()?.0;
        if let Some(number) = known.replaces
            && !self.all.iter().any(|l| l.number == number)
        {
            let what = format!("load {number} of patch `{}`", self.plan.patch);
            return Err(Rejection::NotFound(ErrorReason::LoadUnknown, what));
        }
        let why = || "another load of this patch is being read: wait a second".to_owned();
        ErrorReason::LoadBeingRead.unless(self.watch.is_none(), why)?;
        let load = Load {
            patch: self.plan.patch.clone(),
            by: known.by,
            note: known.note,
            mass_kg: if let Weight::Kilogram(kilogram) = known.weight { Some(kilogram) } else { None },
            force_n,
            force_sigma_n: force_n * known.relative_sigma,
            replaces: known.replaces,
            mean_area_mm2: self.plan.mean_area_mm2,
            filled: self.plan.fills,
            ..Load::default()
        };
        self.watch = Some(LoadWatch::new(now, request, load));
        Ok(())
    }

    /// Takes the force that was published of the scan at `time`, read at the zero with this epoch.
    pub fn on_sample(&mut self, time: Time, epoch: u64, measured: &Measured) -> Option<LoadRead> {
        let verdict = self.watch.as_mut()?.take(time, epoch, measured)?;
        self.end(verdict)
    }

    /// Time passed: a load under which nothing comes is given up.
    pub fn tick(&mut self, now: Time) -> Option<LoadRead> {
        let verdict = self.watch.as_ref()?.overdue(now)?;
        self.end(verdict)
    }

    /// When [`Loads::tick`] has something to do.
    pub fn deadline(&self) -> Option<Time> {
        self.watch.as_ref().map(LoadWatch::give_up_at)
    }

    fn end(&mut self, verdict: Result<Reading, Rejection>) -> Option<LoadRead> {
        let watch = self.watch.take()?;
        Some(LoadRead { request: watch.request, outcome: verdict.map(|read| Load { read, ..watch.load }) })
    }

    /// A load that is on disk.
    pub fn keep(&mut self, load: Arc<Load>) {
        self.all.push(load);
    }

    /// All loads, judged for the model set in use.
    pub fn validation(&self, model_set: Option<String>) -> Validation {
        judge(&self.plan, &self.all, model_set)
    }
}
