//! `ModelService`: model sets as they are stored, and which is in use.

use std::collections::BTreeMap;
use std::sync::Arc;
use taxel_engine::command::{Command, Done};
use taxel_engine::known_set::{KnownSet, SetSummary};
use taxel_engine::model_set::{ModelSet, Recorded};
use taxel_engine::verdict::Verdict;
use taxel_model::TaxelModel;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::model_service_server::ModelService;
use tonic::{Request, Response, Status};

use crate::convert::{known, timestamp};
use crate::service::{Reply, Service, aside, caller, list, misfit, part};
use crate::status::invalid;

/// Models in full that one answer may have: each has the curve at every count.
const CURVES_MAX: usize = 32;

#[tonic::async_trait]
impl ModelService for Service {
    async fn list_model_sets(&self, request: Request<v1::ListRequest>) -> Reply<v1::ListModelSetsResponse> {
        let (request, service) = (request.into_inner(), self.clone());
        self.check_wanted(&request.patch)?;
        if request.before != 0 {
            return Err(invalid("before", "model sets have no numbers: leave it out"));
        }
        let (most, _) = part(&request)?;
        list(move || {
            let wanted = |set: &&KnownSet| request.patch.is_empty() || set.patch == request.patch;
            let catalogue = Arc::clone(&service.handle.catalogue.borrow());
            let sets = catalogue.model_sets.iter().rev().filter(wanted).take(most);
            v1::ListModelSetsResponse { model_sets: sets.map(|set| service.summary(set)).collect() }
        })
        .await
    }

    async fn get_model_set(&self, request: Request<v1::GetModelSetRequest>) -> Reply<v1::ModelSet> {
        let request = request.into_inner();
        let set = self.model_set(&request.model_set, &request.patch).await?;
        let curves = curves(&set, &request.curves)?;
        let verdict = if curves.is_empty() { Some(self.verdict(&set).await?) } else { None };
        Ok(Response::new(v1::ModelSet {
            curves,
            verdict,
            summary: Some(self.summary(&SetSummary::of(&set))),
            board_settings: set.board_settings.clone(),
            taxels: set.taxels.iter().enumerate().map(|(taxel, model)| taxel_summary(&set, taxel, model)).collect(),
            in_use: set.recorded.as_ref().map(in_use).unwrap_or_default(),
        }))
    }

    async fn activate_model_set(
        &self,
        request: Request<v1::ActivateModelSetRequest>,
    ) -> Reply<v1::ActivateModelSetResponse> {
        let caller = caller(&request)?;
        let v1::ActivateModelSetRequest { patch, model_set, expected } = request.into_inner();
        if model_set.is_empty() {
            return Err(invalid("model_set", "must name one; ListModelSets gives their ids"));
        }
        let patch = self.plan(self.patch(&patch)?).patch.name().to_owned();
        let done = self.command(&caller, "ActivateModelSet", Command::Activate { patch, model_set, expected }).await?;
        let Done::Activated { previous, .. } = done else { return Err(misfit()) };
        let previous = previous.unwrap_or_default();
        Ok(Response::new(v1::ActivateModelSetResponse { previous }))
    }

    async fn export_model_set(&self, request: Request<v1::ExportModelSetRequest>) -> Reply<v1::ExportModelSetResponse> {
        let request = request.into_inner();
        let set = self.model_set(&request.model_set, &request.patch).await?;
        let backend = Arc::clone(&self.backend);
        let json = aside(move || backend.to_json(&set)).await?.map_err(Refusal::fault)?;
        Ok(Response::new(v1::ExportModelSetResponse { json }))
    }

    async fn import_model_set(&self, request: Request<v1::ImportModelSetRequest>) -> Reply<v1::ImportModelSetResponse> {
        let caller = caller(&request)?;
        let v1::ImportModelSetRequest { json, insist } = request.into_inner();
        let backend = Arc::clone(&self.backend);
        let set = aside(move || backend.read_foreign_json(&json)).await?;
        let model_set = Arc::new(set.map_err(|problem| invalid("json", problem))?);
        let done = self.command(&caller, "ImportModelSet", Command::Import { model_set, insist }).await?;
        let Done::Kept { model_set, .. } = done else { return Err(misfit()) };
        Ok(Response::new(v1::ImportModelSetResponse { model_set: model_set.id.clone() }))
    }

    async fn delete_model_set(&self, request: Request<v1::DeleteModelSetRequest>) -> Reply<()> {
        let caller = caller(&request)?;
        let model_set = request.into_inner().model_set;
        if model_set.is_empty() {
            return Err(invalid("model_set", "must name one; ListModelSets gives their ids"));
        }
        let done = self.command(&caller, "DeleteModelSet", Command::DeleteModelSet { model_set }).await?;
        let Done::Deleted = done else { return Err(misfit()) };
        Ok(Response::new(()))
    }
}

impl Service {
    /// The set against the limits of a calibration, and against the set in use.
    async fn verdict(&self, set: &Arc<ModelSet>) -> Result<v1::Verdict, Status> {
        let target_kpa = set.session.and_then(|number| self.session(number).ok()).map(|view| view.target_kpa);
        let other = self.active(&set.patch).filter(|id| *id != set.id);
        let in_use = match other {
            Some(id) => self.model_set(&id, "").await.ok(), // one that cannot be read is no reason to hide this set
            None => None,
        };
        let set = Arc::clone(set);
        let verdict = aside(move || Verdict::of(&set, target_kpa, in_use.as_deref())).await?;
        let Verdict { is_good, lines, against_in_use_percent } = verdict;
        Ok(v1::Verdict { is_good, lines, against_in_use_percent })
    }

    /// What a set is.
    pub(crate) fn summary(&self, set: &SetSummary) -> v1::ModelSetSummary {
        v1::ModelSetSummary {
            model_set: set.id.clone(),
            patch: set.patch.clone(),
            created: timestamp(set.created_wall_ns),
            session: set.session,
            method: set.method.clone(),
            taxels: set.taxels as u32,
            calibrated: set.calibrated as u32,
            pressure_max_kpa: set.pressure_max_kpa,
            active: self.active(&set.patch).as_deref() == Some(set.id.as_str()),
            derived_from: set.origins.first().cloned().unwrap_or_default(),
        }
    }
}

/// Those figures that are known, by their names.
fn figures<const N: usize>(all: [(&str, Option<f64>); N]) -> BTreeMap<String, f64> {
    all.into_iter().filter_map(|(name, figure)| Some((name.to_owned(), known(figure?)?))).collect()
}

fn in_use(recorded: &Recorded) -> BTreeMap<String, f64> {
    let with_plays = recorded.taxels.iter().flatten().filter(|taxel| taxel.plays.is_some()).count();
    figures([
        ("smooth_s", Some(recorded.smooth_s)),
        ("zero_return_counts", recorded.zero_return_counts),
        ("unloading_share", recorded.unloading_share),
        ("plays_error_ratio", recorded.plays_error_ratio),
        ("taxels_with_plays", Some(with_plays as f64)),
    ])
}

fn taxel_summary(set: &ModelSet, taxel: usize, model: &TaxelModel) -> v1::TaxelModelSummary {
    let (rest, in_use) = (set.baseline.get(taxel), set.in_use(taxel));
    v1::TaxelModelSummary {
        taxel: taxel as u32,
        status: model.status.code().to_owned(),
        status_text: model.status.to_string(),
        order: u32::from(model.order),
        figures: figures([
            ("rmse_kpa", model.served().map(|_| model.quality.rmse_kpa)),
            ("swing_counts", Some(model.quality.swing_counts)),
            ("baseline_counts", rest.map(|rest| rest.mean)),
            ("noise_counts", rest.map(|rest| rest.noise)),
            ("sensitivity_counts_per_kpa", in_use.map(|taxel| taxel.sensitivity)),
        ]),
    }
}

/// The models in full of these taxels.
fn curves(set: &ModelSet, taxels: &[u32]) -> Result<Vec<v1::TaxelModel>, Status> {
    if taxels.len() > CURVES_MAX {
        return Err(invalid("curves", format_args!("{} taxels, at most {CURVES_MAX}", taxels.len())));
    }
    let in_full = |taxel: &u32| {
        let (taxel, taxels) = (*taxel as usize, set.taxels.len());
        let model = set.taxels.get(taxel).ok_or_else(|| {
            let last = taxels.saturating_sub(1);
            invalid("curves", format_args!("{taxel} is not in 0 to {last}: `{}` has {taxels} taxels", set.id))
        })?;
        Ok(taxel_model(set, taxel, model))
    };
    taxels.iter().map(in_full).collect()
}

fn taxel_model(set: &ModelSet, taxel: usize, model: &TaxelModel) -> v1::TaxelModel {
    let range = model.range.filter(|_| model.served().is_some());
    v1::TaxelModel {
        summary: Some(taxel_summary(set, taxel, model)),
        coefficients: model.raw_coefficients.clone(),
        count_min: range.map(|[low, _]| low),
        count_max: range.map(|[_, high]| high),
        points: points(model),
    }
}

/// The curve at each whole 8-bit count of the calibrated range, also of a curve that may not be used.
fn points(model: &TaxelModel) -> Vec<v1::CurvePoint> {
    let Some([low, high]) = model.range else { return Vec::new() };
    let counts = (0..=u8::MAX).filter(|&count| (low..=high).contains(&f64::from(count)));
    let point = |count: u8| {
        let reading = model.evaluate(f64::from(count))?;
        let (pressure_kpa, sigma_kpa) = (reading.kpa, known(reading.sigma_kpa));
        Some(v1::CurvePoint { count: u32::from(count), pressure_kpa, sigma_kpa })
    };
    counts.filter_map(point).collect()
}
