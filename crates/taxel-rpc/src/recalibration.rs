//! Recalibration by known loads: what is proposed is worked out anew when it is accepted, and nothing is used by that.

use std::sync::Arc;

use taxel_engine::command::{Command, Done};
use taxel_engine::loads::Validation;
use taxel_engine::model_set::ModelSet;
use taxel_engine::recalibration::{
    Assumptions, Chosen, JudgedPoint, PLACE_REL_MAX, PLACE_REL_MIN, POINTS_MAX, Proposal, propose,
};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::access::caller::Caller;
use crate::backend::Backend;
use crate::convert::wall_ns;
use crate::service::{Service, aside, strange_answer};
use crate::shares::Held;
use crate::status::invalid;

/// A proposal as it is told, and the set with its id, or why there is none.
type Proposed = (v1::Recalibration, Result<Arc<ModelSet>, String>);

impl Service {
    /// What the known loads of a patch propose for its active set.
    async fn proposal(&self, held: Held, request: &v1::RecalibrateRequest) -> Result<Proposed, Status> {
        let patch = self.patch(&request.patch)?;
        let name = self.plan(patch).patch.name();
        let (chosen, assumptions) = asked(request)?;
        let refuse = |reason, why: String| Refusal::failed_precondition(reason, why).about("patch", name);
        let no_set = || refuse(ErrorReason::NoModelSet, format!("no model set of patch `{name}` is active"));
        let source = self.model_set(&self.active(name).ok_or_else(no_set)?, name).await?;
        let catalogue = Arc::clone(&self.handle.catalogue.borrow());
        let view =
            catalogue.validations.get(patch).filter(|view| view.model_set.as_deref() == Some(source.id.as_str()));
        let no_loads = || refuse(ErrorReason::NotFitted, format!("no loads of patch `{name}` are known"));
        let view = Arc::clone(view.ok_or_else(no_loads)?);
        // Every model of the set is made anew and hashed, for which no stream should wait.
        let backend = Arc::clone(&self.backend);
        let work = move || proposed(&view, &source, &chosen, assumptions, &*backend);
        Ok(aside(held, work).await?.map_err(|why| refuse(ErrorReason::NotFitted, why))?)
    }

    /// What the known loads of a patch say of its active set, and the corrected set kept unless it is a dry run.
    pub(crate) async fn recalibration(
        &self,
        caller: &Caller,
        held: Held,
        request: &v1::RecalibrateRequest,
    ) -> Result<v1::Recalibration, Status> {
        let wanted = request.model_set.as_str();
        if !request.dry_run && wanted.is_empty() {
            return Err(invalid("model_set", "must name the one that a `dry_run` told"));
        }
        let (message, set) = self.proposal(held, request).await?;
        if request.dry_run {
            return Ok(message);
        }
        let model_set = set.map_err(|why| Refusal::failed_precondition(ErrorReason::NotFitted, why))?;
        if model_set.id != wanted {
            let (is, points) = (&model_set.id, message.points.len());
            let why = format!(
                "the {points} loads lead to `{is}` now, and not to the set that was proposed: look at a new proposal"
            );
            return Err(Refusal::failed_precondition(ErrorReason::ActiveSetChanged, why)
                .about("model_set", wanted)
                .into());
        }
        match self.command(caller, "Recalibrate", Command::KeepRecalibration { model_set }).await? {
            Done::RefitKept { .. } => Ok(v1::Recalibration { kept: true, ..message }),
            other => Err(strange_answer(&other)),
        }
    }
}

/// What the loads propose for a set; or why nothing.
fn proposed(
    view: &Validation,
    source: &ModelSet,
    chosen: &Chosen,
    assumptions: Assumptions,
    backend: &dyn Backend,
) -> Result<Proposed, String> {
    let proposal = propose(view, source, chosen, assumptions, wall_ns())?;
    let set = proposal.set.clone().map(|set| {
        let id = backend.content_id(&set);
        Arc::new(ModelSet { id, ..set })
    });
    let id = set.as_ref().map(|set| set.id.clone()).unwrap_or_default();
    Ok((message(&proposal, source, id), set))
}

/// What a request asks for.
fn asked(request: &v1::RecalibrateRequest) -> Result<(Chosen, Assumptions), Status> {
    for (field, numbers) in [("loads", &request.loads), ("leave_out", &request.leave_out)] {
        if numbers.len() > POINTS_MAX {
            return Err(invalid(field, format_args!("{} numbers, at most {POINTS_MAX} are taken", numbers.len())));
        }
    }
    let place_rel = request.place_uncertainty.unwrap_or(Assumptions::MASSES.place_rel);
    if !(PLACE_REL_MIN..=PLACE_REL_MAX).contains(&place_rel) {
        let problem = format_args!("{place_rel} is not {PLACE_REL_MIN} to {PLACE_REL_MAX}");
        return Err(invalid("place_uncertainty", problem));
    }
    let chosen = Chosen { loads: request.loads.clone(), leave_out: request.leave_out.clone() };
    Ok((chosen, Assumptions { place_rel, ..Assumptions::MASSES }))
}

fn message(proposal: &Proposal, source: &ModelSet, id: String) -> v1::Recalibration {
    let found = &proposal.found;
    let mut refused_because = found.refused_because.clone();
    if let Err(why) = &proposal.set
        && refused_because.is_empty()
    {
        refused_because.push(why.clone());
    }
    v1::Recalibration {
        patch: source.patch.clone(),
        source: source.id.clone(),
        model_set: id,
        gain: found.line.gain,
        gain_sigma: found.gain_sigma(),
        relative_sigma: found.relative_sigma(),
        points: found.points.iter().map(point).collect(),
        contradicts: found.contradicts.unwrap_or(0),
        needed: found.is_needed(),
        refused_because,
        place_uncertainty: found.assumptions.place_rel,
        kept: false,
    }
}

fn point(judged: &JudgedPoint) -> v1::RecalibrationPoint {
    let point = judged.point;
    v1::RecalibrationPoint {
        load: point.number,
        read_n: point.read,
        known_n: point.known,
        corrected_n: judged.corrected,
        deviation: judged.deviation,
    }
}
