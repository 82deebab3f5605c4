//! `IngestService`: scans of a skin that is on no bus, or readings of a gauge that is on none.

use std::pin::pin;
use std::sync::Arc;

use futures_util::stream::{self, StreamExt};
use taxel_engine::PushedScan;
use taxel_engine::command::{Command, Done};
use taxel_engine::plan::PatchPlan;
use taxel_proto::refusal::{Refusal, completed};
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use taxel_proto::v1::ingest_service_server::IngestService;
use taxel_skin::{BusIndex, Kilopascal};
use taxel_wire::{TimedFrame, reading};
use tokio::sync::watch;
use tonic::{Code, Request, Response, Status, Streaming};

use crate::access::layer::may;
use crate::access::origin::Origin;
use crate::access::rules::Rules;
use crate::access::table::PUSH;
use crate::arrivals::{Arrivals, LOOK_EVERY};
use crate::push_line::{PushEvent, Pusher};
use crate::service::{Reply, Service, caller, misfit};
use crate::status::{SHUTTING_DOWN, STOPPED, invalid, unavailable};
use crate::stream::MessageStream;

/// What a bag, a chamber or a gauge that is a little off can read.
const PRESSURE_KPA: std::ops::RangeInclusive<f64> = -200.0..=2_000.0;

#[tonic::async_trait]
impl IngestService for Service {
    type PushScansStream = MessageStream<v1::PushScansResponse>;

    async fn push_scans(&self, request: Request<Streaming<v1::PushScansRequest>>) -> Reply<Self::PushScansStream> {
        let caller = caller(&request)?;
        let credential = request.metadata().get("authorization").map(|shown| shown.as_bytes().to_vec());
        let rules = self.access.watch();
        let mut messages = request.into_inner();
        let first = self.next_of(&mut messages).await?;
        let arrivals = Arrivals::begin((self.handle.clock)()); // what comes from here on waits for the engine's answer
        let first = first.ok_or_else(|| invalid("patch", "the first message names it; there is none"))?;
        let patch = self.patch(&first.patch)?;
        let plan = self.plan(patch);
        let name = plan.patch.name().to_owned();
        let (Some(line), Some(bus)) = (self.backend.push_line(), bus_of(plan)) else {
            let why = format!(
                "the scans of patch `{name}` come over its bus, and its gauge is not pushed either: nobody can push any"
            );
            return Err(Refusal::failed_precondition(ErrorReason::NotConfigured, why).about("patch", name).into());
        };
        let who = format!("{} ({})", caller.who(), caller.origin.place());
        let mut pusher = line.begin(patch, bus, &who).map_err(|other| {
            let why = format!("{other} pushes the scans of patch `{name}`");
            Refusal::new(Code::AlreadyExists, ErrorReason::DaemonBusy, why).about("patch", &name)
        })?;
        let begun = self.command(&caller, "PushScans", Command::BeginPush { patch: name }).await?;
        let Done::PushBegun = begun else { return Err(misfit()) };
        pusher.begun();
        let (service, origin, scans) = (self.clone(), caller.origin, 0);
        let pushing = PushStream { service, origin, credential, rules, patch, pusher, arrivals, scans };
        let begun = stream::once(std::future::ready(Ok(v1::PushScansResponse::default())));
        Ok(Response::new(Box::pin(begun.chain(stream::once(pushing.run(first, messages))))))
    }
}

impl Service {
    /// The next message; nothing at the end of the stream.
    async fn next_of(
        &self,
        messages: &mut Streaming<v1::PushScansRequest>,
    ) -> Result<Option<v1::PushScansRequest>, Status> {
        let pause = self.limits.push_pause;
        tokio::select! {
            () = self.handle.shutdown.cancelled() => Err(unavailable(SHUTTING_DOWN).into()),
            next = tokio::time::timeout(pause, messages.message()) => match next {
                Ok(next) => next.map_err(|status| completed(&status)),
                Err(_) => {
                    let why = format!("no scan was pushed for {} s", pause.as_secs_f64());
                    Err(Refusal::new(Code::DeadlineExceeded, ErrorReason::SkinSilent, why).into())
                }
            },
        }
    }
}

/// A stream of scans on its way.
struct PushStream {
    service: Service,
    origin: Arc<Origin>,
    /// What the caller showed beside that.
    credential: Option<Vec<u8>>,
    /// A stream has no end by itself, and nobody else can push meanwhile: whenever the rules change it is judged anew.
    rules: watch::Receiver<Arc<Rules>>,
    patch: usize,
    pusher: Pusher,
    arrivals: Arrivals,
    /// Messages that should have held a scan.
    scans: u64,
}

impl PushStream {
    /// Takes all scans; then what became of them. It is dropped where the caller goes away.
    async fn run(
        mut self,
        first: v1::PushScansRequest,
        mut messages: Streaming<v1::PushScansRequest>,
    ) -> Result<v1::PushScansResponse, Status> {
        let end = self.take_all(first, &mut messages).await;
        let (taken, refused) = self.pusher.end(match &end {
            Ok(()) => "the program that pushed its scans has ended the stream".to_owned(),
            Err(status) => format!("the stream of scans ended: {}", status.message()),
        });
        end.map(|()| v1::PushScansResponse { taken, refused })
    }

    async fn take_all(
        &mut self,
        first: v1::PushScansRequest,
        messages: &mut Streaming<v1::PushScansRequest>,
    ) -> Result<(), Status> {
        if !first.counts.is_empty() || first.pressure_kpa.is_some() {
            self.take(first)?;
        }
        while let Some(message) = self.next(messages).await? {
            self.take(message)?;
        }
        Ok(())
    }

    /// The next message; nothing at the end of the stream. Meanwhile there is a turn every few milliseconds, by which it is
    /// known that nothing waits.
    async fn next(
        &mut self,
        messages: &mut Streaming<v1::PushScansRequest>,
    ) -> Result<Option<v1::PushScansRequest>, Status> {
        let mut next = pin!(self.service.next_of(messages));
        loop {
            tokio::select! {
                biased; // what comes after other rules is judged by them
                Ok(()) = self.rules.changed() => {
                    let rules = Arc::clone(&self.rules.borrow_and_update());
                    may(&rules.caller(&self.origin, self.credential.as_deref())?, PUSH)?;
                }
                next = &mut next => return next,
                () = tokio::time::sleep(LOOK_EVERY) => self.arrivals.look((self.service.handle.clock)()),
            }
        }
    }

    /// One scan, which came now if there were turns in time, and otherwise may have waited.
    fn take(&mut self, message: v1::PushScansRequest) -> Result<(), Status> {
        let taken = (self.service.handle.clock)();
        let time = self.arrivals.take(taken);
        self.scans += 1;
        if !self.pusher.is_connected() {
            return Err(unavailable(STOPPED).into());
        }
        let plan = self.service.plan(self.patch);
        let name = plan.patch.name();
        if !message.patch.is_empty() && message.patch != name {
            let problem = format_args!("this stream pushes the scans of `{name}` and cannot change to another");
            return Err(invalid("patch", problem));
        }
        let pressure = pressure(plan, self.scans, message.pressure_kpa)?;
        if plan.pushed.is_some() {
            let counts = counts(plan, self.scans, &message.counts)?;
            self.pusher.push(PushEvent::Scan(PushedScan { patch: self.patch, time, taken, counts, pressure }));
            return Ok(());
        }
        let scan = self.scans;
        if !message.counts.is_empty() {
            let words = format_args!(
                "come with reading {scan}, but the scans of patch `{name}` come over its bus: leave them out"
            );
            return Err(invalid("counts", words));
        }
        let words = format_args!("is missing in reading {scan}: only the gauge of patch `{name}` is pushed");
        let Kilopascal(kpa) = pressure.ok_or_else(|| invalid("pressure_kpa", words))?;
        self.pusher.push(PushEvent::Reading(TimedFrame { time, frame: reading::frame(0, kpa) }));
        Ok(())
    }
}

/// What a patch has pushed comes over this bus, which is no real one.
fn bus_of(plan: &PatchPlan) -> Option<BusIndex> {
    let of_gauge = plan.gauge.as_ref().filter(|gauge| gauge.pushed).map(|gauge| gauge.bus);
    let of_skin = plan.pushed.and_then(|_| plan.patch.boards().first()).map(|board| board.bus);
    of_gauge.or(of_skin)
}

/// The raw counts of all taxels, if they are that.
fn counts(plan: &PatchPlan, scan: u64, counts: &[u32]) -> Result<Vec<u16>, Status> {
    let (taxels, top) = (plan.patch.taxels().len(), plan.patch.counts().top());
    if counts.len() != taxels {
        let found = counts.len();
        let problem = format_args!("scan {scan} has {found} counts, expected {taxels}, one per taxel");
        return Err(invalid("counts", problem));
    }
    let count = |(taxel, count): (usize, &u32)| {
        let found = u16::try_from(*count).ok().filter(|count| *count <= top);
        found.ok_or_else(|| {
            invalid("counts", format_args!("taxel {taxel} of scan {scan} is {count}, expected 0 to {top}"))
        })
    };
    counts.iter().enumerate().map(count).collect()
}

/// The pressure in the bag, if it is one and comes this way.
fn pressure(plan: &PatchPlan, scan: u64, kpa: Option<f64>) -> Result<Option<Kilopascal>, Status> {
    let Some(kpa) = kpa else { return Ok(None) };
    let is_gauge = plan.gauge.as_ref().is_some_and(|gauge| gauge.pushed);
    if !is_gauge && !plan.pushed.is_some_and(|pushed| pushed.pressure) {
        let name = plan.patch.name();
        let what_to_do = "add gauge = {} to it, or leave it out";
        let problem = format_args!("comes with scan {scan}, but patch `{name}` takes none: {what_to_do}");
        return Err(invalid("pressure_kpa", problem));
    }
    if !PRESSURE_KPA.contains(&kpa) {
        let (least, most) = (PRESSURE_KPA.start(), PRESSURE_KPA.end());
        return Err(invalid("pressure_kpa", format_args!("{kpa} in scan {scan}, expected {least} to {most}")));
    }
    Ok(Some(Kilopascal(kpa)))
}
