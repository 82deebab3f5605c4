//! `CalibrationService`: sessions, by command and by view.

use futures_util::stream;
use std::sync::Arc;
use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{Direction, SampleRefusal, SessionState, SessionView};
use taxel_engine::command::{Command, Done};
use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::Catalogue;
use taxel_proto::v1;
use taxel_proto::v1::calibration_service_server::CalibrationService;
use taxel_skin::Kilopascal;
use tokio::sync::watch;
use tonic::{Request, Response, Status};

use crate::access::caller::Caller;
use crate::convert::{known, timestamp};
use crate::page::part;
use crate::service::{Reply, Service, caller, check_session, confirmed_by, held, list, strange_answer};
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, unavailable};
use crate::stream::MessageStream;

impl Service {
    fn page_of_sessions(&self, request: &v1::ListRequest) -> Result<v1::ListSessionsResponse, Status> {
        if !request.patch.is_empty() {
            self.patch(&request.patch)?;
        }
        let (most, before) = part(request)?;
        let of_patch = |view: &SessionView| request.patch.is_empty() || view.patch == request.patch;
        let sessions = self.sessions();
        let wanted = sessions.iter().rev().filter(|view| view.number < before && of_patch(view)).take(most);
        Ok(v1::ListSessionsResponse { sessions: wanted.map(|view| self.message(view)).collect() })
    }
}

#[tonic::async_trait]
impl CalibrationService for Service {
    async fn start_session(&self, request: Request<v1::StartSessionRequest>) -> Reply<v1::Session> {
        let caller = caller(&request)?;
        let request = request.into_inner();
        let patch = self.plan(self.patch(&request.patch)?).patch.name().to_owned();
        let target = request.target_kpa.map(Kilopascal);
        let branches = match v1::Branches::try_from(request.branches) {
            Ok(v1::Branches::Unspecified) => None,
            Ok(v1::Branches::Rising) => Some(Branch::Rising),
            Ok(v1::Branches::Both) => Some(Branch::Both),
            Err(_) => return Err(invalid("branches", format_args!("{} is not in 0 to 2", request.branches))),
        };
        let confirmed_by = confirmed_by(&request.confirmed_by)?;
        let leave_out = request.leave_out.iter().map(module_name).collect::<Result<_, _>>()?;
        let command = Command::StartSession { patch, target, branches, confirmed_by, leave_out };
        self.session_command(&caller, "StartSession", command).await
    }

    async fn advance_session(&self, request: Request<v1::AdvanceSessionRequest>) -> Reply<v1::Session> {
        let caller = caller(&request)?;
        let (session, action) = (check_session(request.get_ref().session)?, request.get_ref().action);
        let typed_kpa = request.get_ref().typed_kpa;
        let is_plateau = action == i32::from(v1::SessionAction::Plateau);
        if typed_kpa.is_some() != is_plateau || !typed_kpa.is_none_or(f64::is_finite) {
            return Err(invalid("typed_kpa", "expected a number of kPa with PLATEAU, and none with another action"));
        }
        let command = match v1::SessionAction::try_from(action) {
            Ok(v1::SessionAction::Plateau) => {
                Command::Plateau { session, kpa: Kilopascal(typed_kpa.unwrap_or_default()) }
            }
            Ok(v1::SessionAction::StartRamp) => Command::StartRamp { session },
            Ok(v1::SessionAction::FinishRamp) => Command::FinishRamp { session },
            Ok(v1::SessionAction::Abort) => Command::AbortSession { session },
            Ok(v1::SessionAction::Discard) => Command::DiscardSession { session },
            Ok(v1::SessionAction::Unspecified) | Err(_) => {
                let problem = "expected START_RAMP, FINISH_RAMP, ABORT, DISCARD or PLATEAU";
                return Err(invalid("action", format_args!("{action}: {problem}")));
            }
        };
        self.session_command(&caller, "AdvanceSession", command).await
    }

    async fn delete_session(&self, request: Request<v1::SessionRequest>) -> Reply<()> {
        let caller = caller(&request)?;
        let session = check_session(request.get_ref().session)?;
        match self.command(&caller, "DeleteSession", Command::DeleteSession { session }).await? {
            Done::Deleted => Ok(Response::new(())),
            other => Err(strange_answer(&other)),
        }
    }

    async fn get_session(&self, request: Request<v1::SessionRequest>) -> Reply<v1::Session> {
        Ok(Response::new(self.message(&*self.session(request.get_ref().session)?)))
    }

    async fn list_sessions(&self, request: Request<v1::ListRequest>) -> Reply<v1::ListSessionsResponse> {
        let (request, service) = (request.into_inner(), self.clone());
        list(move || service.page_of_sessions(&request)).await
    }

    type ExportSamplesStream = MessageStream<v1::SampleTable>;

    async fn export_samples(&self, request: Request<v1::SessionRequest>) -> Reply<Self::ExportSamplesStream> {
        let session = self.session(request.get_ref().session)?.number;
        Ok(Response::new(self.export(held(&request)?, session).await?))
    }

    async fn refit_sessions(&self, request: Request<v1::RefitSessionsRequest>) -> Reply<v1::Refit> {
        let caller = caller(&request)?;
        let v1::RefitSessionsRequest { sessions, order } = request.into_inner();
        self.refit(&caller, &sessions, order).await.map(Response::new)
    }

    type WatchSessionStream = MessageStream<v1::Session>;

    async fn watch_session(&self, request: Request<v1::SessionRequest>) -> Reply<Self::WatchSessionStream> {
        let number = request.get_ref().session;
        let patch = self.patch(&self.session(number)?.patch)?;
        let live = self.handle.patches[patch].session.clone();
        let catalogue = self.handle.catalogue.clone();
        let watch = Watch { service: self.clone(), number, live, catalogue, last: None };
        Ok(Response::new(Box::pin(stream::unfold(watch, |mut watch| async {
            let view = watch.next().await.transpose()?;
            Some((view.map(|view| watch.service.message(&view)), watch))
        }))))
    }
}

impl Service {
    /// The message of a session, with its patch's names for modules.
    fn message(&self, view: &SessionView) -> v1::Session {
        let plan = self.handle.plan.patches.iter().find(|plan| plan.patch.name() == view.patch);
        session(plan, view)
    }

    async fn session_command(&self, caller: &Caller, name: &'static str, command: Command) -> Reply<v1::Session> {
        match self.command(caller, name, command).await? {
            Done::Session(view) => Ok(Response::new(self.message(&view))),
            other => Err(strange_answer(&other)),
        }
    }
}

/// Board address and module number of a module to be left out.
fn module_name(name: &v1::ModuleName) -> Result<(u8, u8), Status> {
    let byte = |number: u32| u8::try_from(number).ok();
    byte(name.board).zip(byte(name.module)).ok_or_else(|| {
        let (board, module) = (name.board, name.module);
        invalid(
            "leave_out",
            format_args!("board {board} module {module}: expected a board of 1 to 15, a module of 0 to 15"),
        )
    })
}

/// One watcher of one session.
struct Watch {
    service: Service,
    number: u64,
    /// The session that its patch is at, most often this one.
    live: watch::Receiver<Option<Arc<SessionView>>>,
    /// Where it changes once its patch is at another one.
    catalogue: watch::Receiver<Arc<Catalogue>>,
    last: Option<Arc<SessionView>>,
}

impl Watch {
    /// The session as it is at first, then whenever it is not what was sent last; nothing after its end.
    async fn next(&mut self) -> Result<Option<Arc<SessionView>>, Status> {
        if self.last.as_ref().is_some_and(|last| has_ended(last.state)) {
            return Ok(None);
        }
        loop {
            self.live.mark_unchanged();
            self.catalogue.mark_unchanged();
            let view = Some(self.service.session(self.number)?);
            if self.last != view {
                self.last.clone_from(&view);
                return Ok(view);
            }
            let changed = tokio::select! {
                biased;
                () = self.service.handle.shutdown.cancelled() => return Err(unavailable(SHUTTING_DOWN).into()),
                changed = self.live.changed() => changed,
                changed = self.catalogue.changed() => changed,
            };
            changed.map_err(|_| unavailable(STOPPED))?;
        }
    }
}

/// Whether nothing more comes of a session by itself or by another ramp.
const fn has_ended(state: SessionState) -> bool {
    matches!(state, SessionState::Active | SessionState::Discarded | SessionState::Aborted | SessionState::Failed)
}

fn session(plan: Option<&PatchPlan>, view: &SessionView) -> v1::Session {
    let refused = SampleRefusal::ALL.into_iter().map(|reason| (reason, view.refused.get(reason)));
    let refused = refused.filter(|(_, scans)| *scans > 0);
    let limits = plan.map(|plan| plan.session).unwrap_or_default();
    v1::Session {
        session: view.number,
        patch: view.patch.clone(),
        state: state(view.state).into(),
        reason: view.reason.clone(),
        started: timestamp(view.started_wall_ns),
        changed: timestamp(view.changed_wall_ns),
        confirmed_by: view.confirmed_by.clone().unwrap_or_default(),
        target_kpa: view.target_kpa,
        ramps: u32::from(view.ramps),
        accepted: view.accepted,
        refused: refused.map(|(reason, scans)| (reason.name().to_owned(), scans)).collect(),
        durable: view.durable,
        pressure_kpa: view.pressure_kpa.and_then(known),
        rate_kpa_per_s: view.rate_kpa_per_s.and_then(known),
        coverage: view.coverage,
        taxels_responding: view.responding.0,
        taxels: view.responding.1,
        remaining_s: view.remaining_s.and_then(known),
        model_set: view.model_set.as_deref().unwrap_or_default().to_owned(),
        branches: match view.branches {
            Branch::Rising => v1::Branches::Rising,
            Branch::Both => v1::Branches::Both,
        }
        .into(),
        falling: view.direction == Direction::Falling,
        left_out: plan.map(|plan| left_out(plan, view)).unwrap_or_default(),
        rise_max_kpa_per_s: limits.rise_max_kpa_per_s,
        fall_max_kpa_per_s: limits.fall_max_kpa_per_s,
        // The bag is judged by what the gauge itself reads.
        vented_below_kpa: limits.vented_below.0 - view.gauge_zero_kpa,
        look: view.look.to_vec(),
        typed: view.typed.map(|typed| v1::TypedPlateaus {
            settled: typed.settled,
            taken: typed.taken.into(),
            last_kpa: typed.last_kpa.and_then(known),
        }),
        not_responding: view.not_responding.iter().map(|taxel| u32::from(*taxel)).collect(),
    }
}

fn left_out(plan: &PatchPlan, view: &SessionView) -> Vec<v1::ModuleName> {
    let name = |position: &u16| {
        let site = plan.patch.modules().get(usize::from(*position))?;
        let board = plan.patch.boards().get(usize::from(site.board))?;
        Some(v1::ModuleName { board: board.address.get().into(), module: site.module.get().into() })
    };
    view.left_out.iter().filter_map(name).collect()
}

const fn state(state: SessionState) -> v1::SessionState {
    match state {
        SessionState::Taring => v1::SessionState::Taring,
        SessionState::Ramping => v1::SessionState::Ramping,
        SessionState::Fitting => v1::SessionState::Fitting,
        SessionState::Review => v1::SessionState::Review,
        SessionState::Active => v1::SessionState::Active,
        SessionState::Discarded => v1::SessionState::Discarded,
        SessionState::Aborted => v1::SessionState::Aborted,
        SessionState::Failed => v1::SessionState::Failed,
        SessionState::Interrupted => v1::SessionState::Interrupted,
    }
}
