//! `CalibrationService`: sessions, by command and by view.

use futures_util::stream::{self, StreamExt};
use std::sync::Arc;
use std::time::Duration;
use taxel_engine::calibration::export::{sample_row, table_head};
use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{Direction, Sample, SampleRefusal, SessionSamples, SessionState, SessionView};
use taxel_engine::command::{Command, Done};
use taxel_engine::plan::PatchPlan;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use taxel_proto::v1::calibration_service_server::CalibrationService;
use taxel_skin::Kilopascal;
use tonic::{Request, Response, Status};

use crate::access::rules::Caller;
use crate::backend::ask;
use crate::convert::{known, same_names, timestamp};
use crate::service::{Reply, Service, caller, check_session, confirmed_by, line, list, misfit, part};
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, unavailable};
use crate::stream::MessageStream;

/// A watched session is looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Longest reason that a session is aborted for, in bytes.
const REASON_BYTES_MAX: usize = 2000;

/// Scans of one piece: of 230 taxels 100 kB.
const PIECE_SCANS: usize = 100;

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
        let reason = line("reason", &request.get_ref().reason, REASON_BYTES_MAX, "why it is aborted")?;
        if !reason.is_empty() && action != i32::from(v1::SessionAction::Abort) {
            return Err(invalid("reason", "expected with ABORT alone"));
        }
        let reason = (!reason.is_empty()).then(|| reason.to_owned());
        let command = match v1::SessionAction::try_from(action) {
            Ok(v1::SessionAction::Plateau) => {
                Command::Plateau { session, kpa: Kilopascal(typed_kpa.unwrap_or_default()) }
            }
            Ok(v1::SessionAction::StartRamp) => Command::StartRamp { session },
            Ok(v1::SessionAction::FinishRamp) => Command::FinishRamp { session },
            Ok(v1::SessionAction::Abort) => Command::AbortSession { session, reason },
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
        let done = self.command(&caller, "DeleteSession", Command::DeleteSession { session }).await?;
        let Done::Deleted = done else { return Err(misfit()) };
        Ok(Response::new(()))
    }

    async fn get_session(&self, request: Request<v1::SessionRequest>) -> Reply<v1::Session> {
        Ok(Response::new(self.message(&*self.session(request.get_ref().session)?)))
    }

    async fn list_sessions(&self, request: Request<v1::ListRequest>) -> Reply<v1::ListSessionsResponse> {
        let (request, service) = (request.into_inner(), self.clone());
        self.check_wanted(&request.patch)?;
        let (most, before) = part(&request)?;
        list(move || {
            let of_patch = |view: &SessionView| request.patch.is_empty() || view.patch == request.patch;
            let sessions = service.sessions();
            let wanted = sessions.iter().rev().filter(|view| view.number < before && of_patch(view)).take(most);
            v1::ListSessionsResponse { sessions: wanted.map(|view| service.message(view)).collect() }
        })
        .await
    }

    type ExportSamplesStream = MessageStream<v1::SampleTable>;

    async fn export_samples(&self, request: Request<v1::SessionRequest>) -> Reply<Self::ExportSamplesStream> {
        let session = self.session(request.get_ref().session)?.number;
        let samples = ask(|told| self.backend.samples(session, told)).await;
        let samples = samples.map_err(|refusal| refusal.about("session", session))?;
        let Some(first_ns) = samples.samples.first().map(|sample| sample.time_ns) else {
            let why = format!("session {session} has no samples");
            return Err(Refusal::failed_precondition(ErrorReason::SessionWrongState, why).into());
        };
        let view = self.session(session)?; // as it is now that the samples are read
        let plan = self.handle.plan.patches.iter().find(|plan| plan.patch.name() == view.patch);
        let head = plan.map(|plan| table_head(plan, &view, &samples)).unwrap_or_default();
        let pieces = samples.samples.len().div_ceil(PIECE_SCANS);
        let rows = stream::iter(0..pieces).map(move |number| rows(&samples, number, first_ns));
        let pieces = stream::once(std::future::ready(head)).chain(rows);
        Ok(Response::new(pieces.map(|text| Ok(v1::SampleTable { text })).boxed()))
    }

    async fn refit_sessions(&self, request: Request<v1::RefitSessionsRequest>) -> Reply<v1::Refit> {
        let caller = caller(&request)?;
        let sessions = request.into_inner().sessions;
        self.refit(&caller, &sessions).await.map(Response::new)
    }

    type WatchSessionStream = MessageStream<v1::Session>;

    async fn watch_session(&self, request: Request<v1::SessionRequest>) -> Reply<Self::WatchSessionStream> {
        let number = self.session(request.get_ref().session)?.number;
        let sessions = stream::try_unfold((self.clone(), None), move |(service, last)| async move {
            let next = service.next_view(number, last.as_deref()).await?;
            Ok(next.map(|view| (service.message(&view), (service, Some(view)))))
        });
        Ok(Response::new(Box::pin(sessions)))
    }
}

impl Service {
    /// The message of a session, with its patch's names for modules.
    fn message(&self, view: &SessionView) -> v1::Session {
        let plan = self.handle.plan.patches.iter().find(|plan| plan.patch.name() == view.patch);
        session(plan, view)
    }

    async fn session_command(&self, caller: &Caller, name: &'static str, command: Command) -> Reply<v1::Session> {
        let Done::Session(view) = self.command(caller, name, command).await? else { return Err(misfit()) };
        Ok(Response::new(self.message(&view)))
    }
}

/// Board address and module number of a module to be left out.
fn module_name(name: &v1::ModuleName) -> Result<(u8, u8), Status> {
    let byte = |number: u32| u8::try_from(number).ok();
    byte(name.board).zip(byte(name.module)).ok_or_else(|| {
        let (board, module) = (name.board, name.module);
        let expected = "expected a board of 1 to 15, a module of 0 to 15";
        invalid("leave_out", format_args!("board {board} module {module}: {expected}"))
    })
}

impl Service {
    /// A watched session as it is at first, then as soon as it is not what was sent last; nothing after its end.
    async fn next_view(&self, number: u64, last: Option<&SessionView>) -> Result<Option<Arc<SessionView>>, Status> {
        if last.is_some_and(|last| has_ended(last.state)) {
            return Ok(None);
        }
        loop {
            let view = self.session(number)?;
            if last != Some(&*view) {
                return Ok(Some(view));
            }
            let _ = tokio::time::timeout(LOOK_EVERY, self.handle.shutdown.cancelled()).await; // whichever comes first
            if self.handle.is_over() {
                return Err(unavailable(SHUTTING_DOWN).into());
            }
            if !self.handle.is_connected() {
                return Err(unavailable(STOPPED).into());
            }
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
        rise_max_kpa_per_s: limits.steepest_kpa_per_s,
        fall_max_kpa_per_s: limits.steepest_kpa_per_s,
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

same_names!(state: SessionState => v1::SessionState,
    Taring Ramping Fitting Review Active Discarded Aborted Failed Interrupted);

fn rows(samples: &SessionSamples, piece: usize, first_ns: i64) -> String {
    let row = |sample: &Sample| {
        let counts = sample.counts.counts();
        let raw = counts.all().iter().map(|&raw| raw.into());
        let since_ns = sample.time_ns.saturating_sub(first_ns);
        sample_row(since_ns, sample.pressure_kpa, raw, u32::from(sample.ramp) + 1)
    };
    samples.samples.iter().skip(piece * PIECE_SCANS).take(PIECE_SCANS).map(row).collect()
}
