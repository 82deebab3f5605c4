//! `SkinService`: layout, raw taxels, the zero and the health.

use taxel_engine::command::{Command, Done};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::{BoardHealth, BusHealth};
use taxel_proto::v1;
use taxel_proto::v1::skin_service_server::SkinService;
use taxel_skin::NormalsVerdict;
use tonic::{Request, Response};

use crate::convert::{self, vector};
use crate::freshness::not_run_for;
use crate::service::{Reply, Service, caller, confirmed_by, misfit};
use crate::stream::{MessageStream, subscribe};

#[tonic::async_trait]
impl SkinService for Service {
    async fn get_skin(&self, request: Request<v1::PatchRequest>) -> Reply<v1::Skin> {
        let plan = self.plan(self.patch(&request.get_ref().patch)?);
        let set = match self.active(plan.patch.name()) {
            Some(id) => Some(self.model_set(&id, "").await?),
            None => None,
        };
        let no_geometry = || vec!["no geometry is configured: no vector, moment or contact is served".to_owned()];
        let remarks = plan.geometry.as_ref().map(|geometry| geometry.remarks.clone());
        Ok(Response::new(v1::Skin {
            patch: plan.patch.name().to_owned(),
            patches: self.handle.plan.patches.iter().map(|p| p.patch.name().to_owned()).collect(),
            taxels: (0..plan.patch.taxels().len()).map(|taxel| layout(plan, taxel, set.as_deref())).collect(),
            model_set: set.as_deref().map(|set| set.id.clone()).unwrap_or_default(),
            count_max: u32::from(plan.patch.counts().top()),
            counts_per_unit: plan.patch.counts().per_unit(),
            geometry_remarks: remarks.unwrap_or_else(no_geometry),
        }))
    }

    type StreamTaxelsStream = MessageStream<v1::TaxelSample>;

    async fn stream_taxels(&self, request: Request<v1::StreamRequest>) -> Reply<Self::StreamTaxelsStream> {
        let request = request.into_inner();
        let patch = self.patch(&request.patch)?;
        subscribe(self, patch, request.rate_hz, convert::taxels).map(Response::new)
    }

    async fn tare(&self, request: Request<v1::TareRequest>) -> Reply<v1::TareStatus> {
        let caller = caller(&request)?;
        let request = request.into_inner();
        let name = self.plan(self.patch(&request.patch)?).patch.name();
        let confirmed_by = confirmed_by(&request.confirmed_by)?;
        let done = self.command(&caller, "Tare", Command::Tare { patch: name.to_owned(), confirmed_by }).await?;
        let Done::Tared(view) = done else { return Err(misfit()) };
        Ok(Response::new(convert::tare(name, Some(&view))))
    }

    async fn bring_up(&self, request: Request<v1::TareRequest>) -> Reply<()> {
        let caller = caller(&request)?;
        let request = request.into_inner();
        let patch = self.plan(self.patch(&request.patch)?).patch.name().to_owned();
        let confirmed_by = confirmed_by(&request.confirmed_by)?;
        let done = self.command(&caller, "BringUp", Command::BringUp { patch, confirmed_by }).await?;
        let Done::BringUpStarted = done else { return Err(misfit()) };
        Ok(Response::new(()))
    }

    type WatchEventsStream = MessageStream<v1::Event>;

    async fn watch_events(&self, request: Request<v1::WatchEventsRequest>) -> Reply<Self::WatchEventsStream> {
        self.watch_events_of(request.into_inner()).map(Response::new)
    }

    async fn get_health(&self, _: Request<()>) -> Reply<v1::Health> {
        let health = self.handle.health.borrow().clone();
        // Found here and not by the engine, which cannot tell that it does not run.
        let stalled = self.handle.stalled_for();
        let recording = self.backend.recording();
        let unrecorded = recording.iter().map(|state| &state.problem).filter(|problem| !problem.is_empty());
        let unrecorded = unrecorded.map(|problem| format!("nothing is recorded: {problem}"));
        let problems = stalled.map(not_run_for).into_iter().chain(health.problems.iter().cloned());
        let problems = problems.chain(unrecorded).chain(self.backend.lacks());
        let bus = |(bus, health): (usize, &BusHealth)| v1::BusHealth {
            bus: bus as u32,
            up: health.up,
            problem: health.problem.clone(),
            frames: health.frames,
            foreign: health.foreign,
            malformed: health.malformed,
            last_malformed: health.last_malformed.clone(),
            dropped: health.dropped,
        };
        let board = |health: &BoardHealth| v1::BoardHealth {
            patch: health.patch.clone(),
            bus: u32::from(health.bus),
            address: u32::from(health.address),
            bring_up: health.bring_up.clone(),
            modules_enabled: health.modules.0,
            modules_fresh: health.modules.1,
            scans: health.scans,
            orphans: health.orphans,
            status_errors: health.status_errors,
            celsius: health.celsius,
            firmware: health.firmware.clone().unwrap_or_default(),
            warnings: health.warnings.clone(),
        };
        Ok(Response::new(v1::Health {
            buses: health.buses.iter().enumerate().map(bus).collect(),
            boards: health.boards.iter().map(board).collect(),
            patches: (0..self.handle.plan.patches.len()).map(|patch| self.patch_health(patch)).collect(),
            problems: problems.collect(),
            streams: self.shares.streams_open() as u32,
            streams_max: self.limits.streams as u32,
            store: Some(v1::StoreHealth {
                problem: health.store.problem.clone().unwrap_or_default(),
                damage: health.store.damage.clone(),
            }),
            recording,
            engine_stalled_s: stalled.map(|silence| silence.as_secs_f64()),
        }))
    }
}

impl Service {
    fn patch_health(&self, patch: usize) -> v1::PatchHealth {
        let (plan, snapshot) = (self.plan(patch), self.snapshot(patch));
        let name = plan.patch.name();
        let active = self.active(name).is_some();
        let force = convert::force(plan, &snapshot, self.handle.sending(patch, &snapshot, 0), true);
        let no_force = active && force.total_n.is_none();
        let now = (self.handle.clock)();
        let gauge = self.handle.patches.get(patch).and_then(|feed| *feed.gauge.borrow());
        let faulty = snapshot.taxels.iter().enumerate().filter(|(_, taxel)| !taxel.faults.is_empty());
        v1::PatchHealth {
            patch: name.to_owned(),
            tare: Some(convert::tare(name, snapshot.tare.as_ref())),
            faulty: faulty
                .map(|(taxel, state)| v1::FaultyTaxel { taxel: taxel as u32, faults: convert::faults(state.faults) })
                .collect(),
            no_force: if no_force { force.reasons.join("; ") } else { String::new() },
            gauge_kpa: gauge.map(|gauge| gauge.kpa),
            gauge_age_s: gauge.map(|gauge| now.seconds_since(gauge.time).max(0.0)),
            has_gauge: plan.has_gauge(),
        }
    }
}

fn layout(plan: &PatchPlan, taxel: usize, set: Option<&ModelSet>) -> v1::TaxelLayout {
    let site = plan.patch.taxels()[taxel];
    let module = plan.patch.modules()[usize::from(site.module)];
    let board = &plan.patch.boards()[usize::from(module.board)];
    let pose = plan.geometry.as_ref().and_then(|geometry| geometry.poses.get(taxel).copied().flatten());
    let facing = plan.geometry.as_ref().is_some_and(|geometry| geometry.normals == NormalsVerdict::Usable);
    let status = set.and_then(|set| set.taxels.get(taxel)).map(|model| model.status);
    let exclusion = match status {
        Some(status) if status.is_ok() => String::new(),
        Some(status) => status.to_string(),
        None => "no model set is in use".to_owned(),
    };
    v1::TaxelLayout {
        taxel: taxel as u32,
        bus: u32::from(board.bus.0),
        board: u32::from(board.address.get()),
        module: u32::from(module.module.get()),
        slot: u32::from(site.slot),
        position_m: pose.map(|pose| vector(pose.position)),
        normal: pose.filter(|_| facing).map(|pose| vector(pose.normal)),
        area_mm2: plan.areas.get(taxel).map_or(0.0, |area| area.0),
        calibrated: exclusion.is_empty(),
        exclusion,
    }
}
