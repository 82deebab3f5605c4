//! The newest force of each patch in shared memory: written by the engine's own task as it publishes, before
//! the service hears of it.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_engine::snapshot::{ForceState, PatchSnapshot};
use taxel_rpc::STALLED_AFTER;
use taxel_shm::{Folder, Limits, PageWriter, Sample, State, Text};

use crate::config::SharedMemorySection;

/// The pages of a daemon. Dropped, each says that nobody is behind it any more.
#[derive(Debug, Default)]
pub struct Pages {
    /// By the patch's position in the plan; none where a page could not be made.
    pages: Vec<Option<PageWriter>>,
}

impl Pages {
    /// Makes the pages that the section wants, one for each patch of the plan; none without a section. Gives also, in words,
    /// which could not be made: the daemon runs without those.
    ///
    /// # Errors
    /// If there is no such group.
    pub fn make(section: Option<&SharedMemorySection>, plan: &Plan) -> anyhow::Result<(Self, Vec<String>)> {
        let Some(section) = section else { return Ok((Self::default(), Vec::new())) };
        let id = |name: &String| {
            taxel_rpc::group_id(name).with_context(|| format!("shared_memory.group: there is no group `{name}`"))
        };
        let folder = Folder::open(&section.path, section.group.as_ref().map(id).transpose()?);
        let mut problems = Vec::new();
        let mut page = |patch: &PatchPlan| {
            let (name, limits) = (patch.patch.name(), Limits { age: patch.live.stale_after, beat: STALLED_AFTER });
            let why = match folder.as_ref().map(|folder| folder.page(name, limits)) {
                Ok(Ok(page)) => return Some(page),
                Ok(Err(error)) => error.to_string(),
                Err(error) => error.to_string(),
            };
            problems.push(format!("no force of {name} in shared memory: {why}; a restart tries it again"));
            None
        };
        let pages = plan.patches.iter().map(&mut page).collect();
        Ok((Self { pages }, problems))
    }

    /// Where they are.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.pages.iter().flatten().map(PageWriter::path)
    }

    /// The engine's task has its turn now: readers judge by this whether the engine runs.
    pub fn beat(&self) {
        self.pages.iter().flatten().for_each(PageWriter::beat);
    }

    /// New state of the patch at this position of the plan.
    pub fn patch(&mut self, position: usize, snapshot: &Arc<PatchSnapshot>) {
        if let Some(Some(page)) = self.pages.get_mut(position) {
            page.write(&sample(snapshot));
        }
    }
}

/// The snapshot as a page has it.
fn sample(snapshot: &PatchSnapshot) -> Sample {
    let force = &snapshot.force;
    let reasons = if snapshot.seen { Text::new("") } else { Text::new("no frame of this patch has come yet") };
    Sample {
        sequence: snapshot.sequence,
        monotonic_ns: snapshot.seen.then_some(snapshot.time.as_nanos()),
        wall_ns: snapshot.wall_ns,
        written_ns: 0, // the page's own to say
        state: state(force.state),
        simulated: snapshot.simulated,
        total_n: force.total.map(|total| total.0),
        sigma_n: force.total_sigma.map(|sigma| sigma.0),
        low_n: force.low().map(|low| low.0),
        high_n: force.high().map(|high| high.0),
        undetected_n: force.undetected.map(|undetected| undetected.at_most().0),
        step_n: force.step.map(|step| step.0),
        zero_epoch: force.zero_epoch,
        resultant_n: force.resultant,
        moment_nm: force.moment,
        centre_of_pressure_m: force.centre_of_pressure,
        active: force.active,
        excluded: force.excluded,
        stale: force.stale,
        out_of_range: force.out_of_range,
        model_set: Text::new(force.model_set.as_deref().unwrap_or_default()),
        reasons: if force.reasons.is_empty() { reasons } else { Text::new(&force.why()) },
    }
}

fn state(state: ForceState) -> State {
    match state {
        ForceState::Ok => State::Ok,
        ForceState::Degraded => State::Degraded,
        ForceState::Stale => State::Stale,
        ForceState::TareInvalid => State::TareInvalid,
        ForceState::Uncalibrated => State::Uncalibrated,
    }
}
