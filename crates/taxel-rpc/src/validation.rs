//! `ValidationService`: known loads, and how far the force read under them is off.

use taxel_engine::command::{Command, Done};
use taxel_engine::loads::{JudgedLoad, KnownLoad, Load, Validation, Weight};
use taxel_proto::v1;
use taxel_proto::v1::record_load_request::Load as Laid;
use taxel_proto::v1::validation_service_server::ValidationService;
use taxel_skin::Newton;
use tonic::{Request, Response};

use crate::convert::{known, timestamp};
use crate::service::{Reply, Service, caller, held, line, list, name, strange_answer};
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
        match self.command(&caller, "RecordLoad", Command::RecordLoad { patch, load }).await? {
            Done::LoadRecorded(recorded) => Ok(Response::new(self.judged(&recorded))),
            other => Err(strange_answer(&other)),
        }
    }

    async fn get_validation(&self, request: Request<v1::PatchRequest>) -> Reply<v1::Validation> {
        let patch = self.patch(&request.get_ref().patch)?;
        let Some(view) = self.handle.catalogue.borrow().validations.get(patch).cloned() else {
            let patch = self.plan(patch).patch.name().to_owned();
            return Ok(Response::new(v1::Validation { patch, ..v1::Validation::default() }));
        };
        list(move || Ok(validation(&view))).await
    }

    async fn recalibrate(&self, request: Request<v1::RecalibrateRequest>) -> Reply<v1::Recalibration> {
        let (caller, held) = (caller(&request)?, held(&request)?);
        self.recalibration(&caller, held, request.get_ref()).await.map(Response::new)
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
        reasons: load.read.reasons.clone(),
        model_set: load.model_set.clone(),
        replaces: load.replaces.unwrap_or(0),
        taxels: load.read.taxels.iter().map(|taxel| u32::from(*taxel)).collect(),
        ..v1::Load::default()
    }
}
