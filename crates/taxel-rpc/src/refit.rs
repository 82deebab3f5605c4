//! Stored samples fitted once more: read from the store, fitted on a thread of its own, kept by the engine.

use std::sync::Arc;

use taxel_engine::calibration::{Refit, SessionState, SessionView, TOGETHER_MAX};
use taxel_engine::command::{Command, Done};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::access::rules::Caller;
use crate::backend::ask;
use crate::convert::wall_ns;
use crate::service::{Service, aside, misfit};
use crate::status::{invalid, of_rejection};

impl Service {
    /// Fits what these sessions gathered, and has the set kept.
    pub(crate) async fn refit(&self, caller: &Caller, numbers: &[u64]) -> Result<v1::Refit, Status> {
        // Before anything is looked up: a request has room for tens of thousands of numbers.
        if numbers.len() > TOGETHER_MAX {
            return Err(invalid("sessions", format_args!("{} are named, expected 1 to {TOGETHER_MAX}", numbers.len())));
        }
        let views = numbers.iter().map(|number| self.session(*number)).collect::<Result<Vec<_>, _>>()?;
        if let Some(view) = views.iter().find(|view| view.state == SessionState::Discarded) {
            let discarded = "was discarded: no models are made of its samples; export them to look at them";
            let words = format!("session {} {discarded}", view.number);
            return Err(Refusal::failed_precondition(ErrorReason::SessionWrongState, words).into());
        }
        let refit = self.plan_refit(views)?;
        // One at a time, so that memory for one is enough. A refused caller has lost nothing.
        let turn = Arc::clone(&self.handle.fits).try_acquire_owned().map_err(|_| {
            let why = "another fit is under way, which ends within seconds: try again then";
            Refusal::exhausted(ErrorReason::DaemonBusy, why)
        })?;
        let sessions = refit.numbers();
        let mut samples = Vec::with_capacity(sessions.len());
        for number in &sessions {
            let read = ask(|told| self.backend.samples(*number, told)).await;
            samples.push(read.map_err(|refusal| refusal.about("session", number))?);
        }
        let scans = samples.iter().map(|samples| samples.samples.len() as u64).sum();
        let backend = Arc::clone(&self.backend);
        let fit = move || {
            let _turn = turn; // goes along, and ends with the fit
            refit.job(samples, wall_ns()).map(|job| job.run(|set| backend.content_id(set)).result)
        };
        let model_set = aside(fit).await?.map_err(|why| of_rejection(&why))?;
        let model_set = model_set.map_err(|why| Refusal::failed_precondition(ErrorReason::NotFitted, why))?;
        let done = self.command(caller, "RefitSessions", Command::KeepRefit { model_set, sessions }).await?;
        let Done::Kept { model_set, known } = done else { return Err(misfit()) };
        Ok(v1::Refit { model_set: Some(self.summary(&model_set)), known, scans })
    }

    /// What is to be fitted.
    fn plan_refit(&self, views: Vec<Arc<SessionView>>) -> Result<Refit, Status> {
        let first = views.first().ok_or_else(|| invalid("sessions", "none is named"))?;
        let plan = self.plan(self.patch(&first.patch)?);
        let planned = Refit::plan(plan.clone(), views);
        Ok(planned.map_err(|why| of_rejection(&why).about("patch", plan.patch.name()))?)
    }
}
