//! `ValidationService`: known loads, how far the force read under them is off, and the recalibration that they propose: it is
//! worked out anew when it is accepted, and nothing is used by that.

use std::sync::Arc;

use taxel_engine::command::{Command, Done};
use taxel_engine::loads::{JudgedLoad, KnownLoad, Load, Validation, Weight};
use taxel_engine::model_set::ModelSet;
use taxel_engine::recalibration::{
    Assumptions, Chosen, JudgedPoint, PLACE_REL_MAX, PLACE_REL_MIN, POINTS_MAX, Proposal, propose,
};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use taxel_proto::v1::record_load_request::Load as Laid;
use taxel_proto::v1::validation_service_server::ValidationService;
use taxel_skin::Newton;
use tonic::{Request, Response, Status};

use crate::access::rules::Caller;
use crate::backend::Backend;
use crate::convert::{known, timestamp, wall_ns};
use crate::service::{Reply, Service, aside, caller, line, list, misfit, name};
use crate::status::invalid;

/// A load whose uncertainty is not given: a kitchen scale, or a mass that stands 8 degrees off the vertical.
const RELATIVE_UNCERTAINTY: f64 = 0.01;
/// Longest note that is kept with a load, in bytes.
const NOTE_BYTES_MAX: usize = 1024;
/// Most loads in one answer.
const LOADS_MAX: usize = 1000;

#[tonic::async_trait]
impl ValidationService for Service {
    async fn record_load(&self, request: Request<v1::RecordLoadRequest>) -> Reply<v1::Load> {
        let caller = caller(&request)?;
        let request = request.into_inner();
        let patch = self.plan(self.patch(&request.patch)?).patch.name().to_owned();
        let load = KnownLoad {
            weight: match request.load {
                Some(Laid::MassKg(kilogram)) => Weight::Kilogram(kilogram),
                Some(Laid::ForceN(newton)) => Weight::Force(Newton(newton)),
                None => return Err(invalid("load", "neither mass_kg nor force_n is given")),
            },
            relative_sigma: request.relative_uncertainty.unwrap_or(RELATIVE_UNCERTAINTY),
            note: line("note", request.note.trim(), NOTE_BYTES_MAX, "one line of text")?.to_owned(),
            by: name("by", &request.by)?,
            replaces: (request.replaces != 0).then_some(request.replaces),
        };
        let done = self.command(&caller, "RecordLoad", Command::RecordLoad { patch, load }).await?;
        let Done::LoadRecorded(recorded) = done else { return Err(misfit()) };
        Ok(Response::new(self.judged(&recorded)))
    }

    async fn get_validation(&self, request: Request<v1::PatchRequest>) -> Reply<v1::Validation> {
        let patch = self.patch(&request.get_ref().patch)?;
        let Some(view) = self.handle.catalogue.borrow().validations.get(patch).cloned() else {
            let patch = self.plan(patch).patch.name().to_owned();
            return Ok(Response::new(v1::Validation { patch, ..v1::Validation::default() }));
        };
        list(move || validation(&view)).await
    }

    async fn recalibrate(&self, request: Request<v1::RecalibrateRequest>) -> Reply<v1::Recalibration> {
        let caller = caller(&request)?;
        self.recalibration(&caller, request.get_ref()).await.map(Response::new)
    }
}

impl Service {
    /// A load with the engine's present judgement, which is published before the answer goes out.
    fn judged(&self, recorded: &Load) -> v1::Load {
        let catalogue = self.handle.catalogue.borrow();
        let mut judged = catalogue.validations.iter().flat_map(|view| &view.loads);
        judged.find(|judged| judged.load.number == recorded.number).map_or_else(|| load(recorded), of_judged)
    }
}

fn validation(view: &Validation) -> v1::Validation {
    v1::Validation {
        patch: view.patch.clone(),
        model_set: view.model_set.clone().unwrap_or_default(),
        loads: view.loads.iter().take(LOADS_MAX).map(of_judged).collect(),
        mean_absolute_error_percent: view.mean_absolute_error.and_then(|error| known(100.0 * error)),
    }
}

fn of_judged(judged: &JudgedLoad) -> v1::Load {
    v1::Load {
        outdated_because: judged.outdated_because.clone(),
        left_out_because: judged.left_out_because.clone(),
        ..load(&judged.load)
    }
}

fn load(load: &Load) -> v1::Load {
    v1::Load {
        load: load.number,
        patch: load.patch.clone(),
        time: timestamp(load.wall_ns),
        by: load.by.clone(),
        note: load.note.clone(),
        mass_kg: load.mass_kg,
        force_n: load.force_n,
        force_sigma_n: load.force_sigma_n,
        read_n: load.read.mean_n,
        read_sigma_n: load.read.sigma_n,
        read_scatter_n: load.read.scatter_n,
        scans: load.read.scans,
        error_percent: 100.0 * load.error(),
        within_two_sigma: load.is_within_two_sigma(),
        reasons: load.read.reasons.iter().cloned().chain(load.far_off()).collect(),
        model_set: load.model_set.clone(),
        replaces: load.replaces.unwrap_or(0),
        taxels: load.read.taxels.iter().map(|taxel| u32::from(*taxel)).collect(),
        ..v1::Load::default()
    }
}

/// A proposal as it is told, and the set with its id, or why there is none.
type Proposed = (v1::Recalibration, Result<Arc<ModelSet>, String>);

impl Service {
    /// What the known loads of a patch propose for its active set.
    async fn proposal(&self, request: &v1::RecalibrateRequest) -> Result<Proposed, Status> {
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
        Ok(aside(work).await?.map_err(|why| refuse(ErrorReason::NotFitted, why))?)
    }

    /// What the known loads of a patch say of its active set, and the corrected set kept unless it is a dry run.
    pub(crate) async fn recalibration(
        &self,
        caller: &Caller,
        request: &v1::RecalibrateRequest,
    ) -> Result<v1::Recalibration, Status> {
        let wanted = request.model_set.as_str();
        if !request.dry_run && wanted.is_empty() {
            return Err(invalid("model_set", "must name the one that a `dry_run` told"));
        }
        let (message, set) = self.proposal(request).await?;
        if request.dry_run {
            return Ok(message);
        }
        let model_set = set.map_err(|why| Refusal::failed_precondition(ErrorReason::NotFitted, why))?;
        if model_set.id != wanted {
            let (is, points) = (&model_set.id, message.points.len());
            let now = "now, and not to the set that was proposed: look at a new proposal";
            let why = format!("the {points} loads lead to `{is}` {now}");
            let refusal = Refusal::failed_precondition(ErrorReason::ActiveSetChanged, why);
            return Err(refusal.about("model_set", wanted).into());
        }
        let done = self.command(caller, "Recalibrate", Command::KeepRecalibration { model_set }).await?;
        let Done::Kept { .. } = done else { return Err(misfit()) };
        Ok(message)
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
