//! The newest force of each patch in shared memory: written by the engine's own task as it publishes, before
//! the service hears of it.

mod keeper;

use std::path::Path;
use std::sync::Arc;

pub use keeper::Keeper;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{ForceState, PatchSnapshot};
use taxel_shm::{PageWriter, Sample, State, Text};
use tokio::sync::mpsc;

use crate::config::SharedMemorySection;

/// The pages of a daemon. Dropped, each says that nobody is behind it any more.
#[derive(Debug, Default)]
pub struct Pages {
    /// By the patch's position in the plan; none where a page could not be made yet.
    pages: Vec<Option<PageWriter>>,
    /// Pages that were made since, with the patch's position.
    made: Option<mpsc::Receiver<(usize, PageWriter)>>,
}

impl Pages {
    /// Makes the pages that the section wants, one for each patch of the plan, with the one who keeps them; none without a
    /// section. What the machine is short of ends nothing: a page is made once it can be had.
    ///
    /// # Errors
    /// What is wrong with the folder or the group.
    pub fn make(section: Option<&SharedMemorySection>, plan: &Plan) -> anyhow::Result<(Self, Option<Keeper>)> {
        let Some(section) = section else { return Ok((Self::default(), None)) };
        let (keeper, made) = Keeper::begin(section, plan)?;
        let mut pages = Self { pages: plan.patches.iter().map(|_| None).collect(), made: Some(made) };
        pages.take_made();
        Ok((pages, Some(keeper)))
    }

    /// Where they are.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.pages.iter().flatten().map(PageWriter::path)
    }

    /// The engine's task has its turn now: readers judge by this whether the engine runs.
    pub fn beat(&mut self) {
        self.take_made();
        self.pages.iter().flatten().for_each(PageWriter::beat);
    }

    /// A page that takes the place of another has a force with the next scan. The other one says that it is over.
    fn take_made(&mut self) {
        while let Some((position, page)) = self.made.as_mut().and_then(|made| made.try_recv().ok()) {
            self.pages[position] = Some(page);
        }
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
        lower_bound: force.lower_bound,
        simulated: snapshot.simulated,
        total_n: force.total.map(|total| total.0),
        sigma_n: force.total_sigma.map(|sigma| sigma.0),
        detection_floor_n: force.detection_floor.map(|floor| floor.0),
        resultant_n: force.resultant,
        moment_nm: force.moment,
        centre_of_pressure_m: force.centre_of_pressure,
        active: force.active,
        excluded: force.excluded,
        stale: force.stale,
        out_of_range: force.out_of_range,
        filled: force.filled,
        filled_share: force.filled_share,
        uncovered_share: force.uncovered_share,
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
