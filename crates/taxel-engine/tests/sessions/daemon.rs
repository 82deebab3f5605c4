//! The engine, driven as the daemon drives it, on a disk that does what it is told.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::{FitJob, FitOutcome, SessionView};
use taxel_engine::command::{Command, Done, Reply, RequestId};
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;
use taxel_engine::snapshot::Catalogue;
use taxel_engine::{BusNotice, Engine, Input, Now, Output, Restored};

use crate::disk::EPOCH_NS;
use crate::model::{Disk, Passing, Set, Step};
use crate::store::Store;
use crate::world::{BUS, World, plan};

/// An answer, and how many records must be on disk before it goes out.
#[derive(Debug)]
pub struct Answered {
    pub reply: Reply,
    pub after_records: usize,
}

pub struct Daemon {
    engine: Engine,
    world: World,
    pub store: Store,
    disk: Disk,
    /// Tickets that wait for the disk.
    commits: Vec<u64>,
    pub fits: Vec<FitJob>,
    /// The number of the last request, and of the last one before this run.
    pub requests: (u64, u64),
    /// All answers to requests of this run of the daemon.
    pub answers: BTreeMap<u64, Vec<Answered>>,
    pub catalogue: Arc<Catalogue>,
    pub session: Option<Arc<SessionView>>,
    /// What came out since the step began: replies and all that readers or the disk see of a change.
    pub replies: usize,
    pub changes: Vec<String>,
}

impl Daemon {
    pub fn new() -> Self {
        let mut daemon = Self {
            engine: Engine::new(plan(), Restored::default()),
            world: World::default(),
            store: Store::default(),
            disk: Disk::Fast,
            commits: Vec::new(),
            fits: Vec::new(),
            requests: (0, 0),
            answers: BTreeMap::new(),
            catalogue: Arc::default(),
            session: None,
            replies: 0,
            changes: Vec::new(),
        };
        daemon.put(Input::Tick);
        daemon
    }

    /// Does a step, and all that follows from it at once.
    pub fn apply(&mut self, step: Step) {
        (self.replies, self.changes) = (0, Vec::new());
        match step {
            Step::Pass(how) => self.pass(how),
            Step::BusOff => {
                self.put(Input::Bus(BUS, BusNotice::BusOff));
                self.put(Input::Bus(BUS, BusNotice::Up));
            }
            Step::FitEnds { fit, well } => self.end_fit(fit, well),
            Step::DiskSlow => self.disk = Disk::Slow,
            Step::DiskWrites => self.write(),
            Step::DiskFast => self.disk = Disk::Fast,
            Step::DiskFails => self.fail_disk(),
            Step::Restart => self.restart(),
            command => {
                self.requests.0 += 1;
                self.put(Input::Command(RequestId(self.requests.0), command_of(command)));
            }
        }
        self.write_if_fast();
    }

    fn put(&mut self, input: Input<'_>) {
        let now = self.world.now;
        let mut out = Vec::new();
        self.engine.step(Now { time: now, wall_ns: EPOCH_NS + now.as_nanos() }, input, &mut out);
        let (mut replies, mut loads, mut set_loads) = (Vec::new(), Vec::new(), Vec::new());
        for output in out {
            match output {
                Output::Record(record) => self.record(record),
                Output::Commit { ticket, records } => {
                    records.into_iter().for_each(|record| self.record(record));
                    self.commits.push(ticket);
                }
                Output::Reply(request, reply) => replies.push((request, reply)),
                Output::Session(_, view) => {
                    self.changes.push(format!("session {} {:?}", view.number, view.state));
                    self.session = Some(view);
                }
                Output::Catalogue(catalogue) => {
                    self.changes.push("catalogue".to_owned());
                    self.catalogue = catalogue;
                }
                Output::Fit(job) => {
                    self.changes.push("fit".to_owned());
                    self.fits.push(job);
                }
                Output::Load { ticket, session } => loads.push((ticket, session)),
                Output::LoadSet { ticket, model_set } => set_loads.push((ticket, model_set)),
                Output::SessionGone(_) => unreachable!("nothing is deleted here"),
                Output::Patch(..) | Output::Health(_) | Output::Gauge(..) | Output::Send(..) => {}
            }
        }
        for (RequestId(request), reply) in replies {
            self.replies += 1;
            let after_records = self.store.len();
            self.answers.entry(request).or_default().push(Answered { reply, after_records });
        }
        for (ticket, session) in loads {
            let result = self.store.all().samples_of(session);
            self.put(Input::Loaded { ticket, result });
        }
        for (ticket, id) in set_loads {
            let result = self.store.all().set_of(&id);
            self.put(Input::SetLoaded { ticket, result });
        }
    }

    fn record(&mut self, record: Record) {
        self.changes.push(format!("record {record:.0?}").chars().take(60).collect());
        self.store.push(record);
    }

    fn pass(&mut self, how: Passing) {
        for slot in self.world.pass(how) {
            let end = self.world.now;
            for frame in &slot.frames {
                self.world.now = frame.time;
                self.put(Input::Frames(BUS, std::slice::from_ref(frame)));
            }
            self.world.now = slot.end;
            self.put(Input::Tick);
            self.write_if_fast();
            self.world.now = end;
        }
    }

    fn write_if_fast(&mut self) {
        if self.disk != Disk::Fast {
            return;
        }
        while !self.commits.is_empty() {
            self.write();
        }
        self.write();
    }

    fn write(&mut self) {
        let samples = self.store.write();
        for ticket in std::mem::take(&mut self.commits) {
            self.put(Input::Committed { ticket, result: Ok(()) });
        }
        for (session, samples) in samples {
            self.put(Input::Durable { session, samples });
        }
    }

    fn fail_disk(&mut self) {
        self.disk = Disk::Failed;
        let why = || "the disk is full".to_owned();
        for ticket in std::mem::take(&mut self.commits) {
            self.put(Input::Committed { ticket, result: Err(why()) });
        }
        self.put(Input::StoreFailed(why()));
    }

    fn end_fit(&mut self, fit: usize, well: bool) {
        let made = |job: &FitJob| {
            let template = ModelSet::clone(template());
            let rest = job.samples.rest().map(<[_]>::to_vec);
            let baseline = rest.unwrap_or_else(|| elsewhere(&template));
            Arc::new(ModelSet { id: id_of(Set::Fit(fit)), session: Some(job.session()), baseline, ..template })
        };
        let job = &self.fits[fit];
        let result = if well { Ok(made(job)) } else { Err("none of the taxels gives a usable model".to_owned()) };
        self.put(Input::Fitted(FitOutcome { session: job.session(), asked_wall_ns: job.wall_ns, result }));
    }

    fn restart(&mut self) {
        self.engine = Engine::new(plan(), self.store.restore());
        self.disk = Disk::Fast;
        self.commits.clear();
        self.answers.clear();
        self.requests.1 = self.requests.0;
        self.session = None;
        self.put(Input::Tick);
    }

    /// The answers that have gone out: what they rest on is on disk.
    pub fn acknowledged(&self) -> impl Iterator<Item = &Done> {
        let on_disk = self.store.on_disk().len();
        let gone = self.answers.values().flatten().filter(move |answer| answer.after_records <= on_disk);
        gone.filter_map(|answer| answer.reply.as_ref().ok())
    }
}

pub fn id_of(set: Set) -> String {
    match set {
        Set::Fit(fit) => format!("m-fit-{fit}"),
        Set::Foreign(session) => format!("m-foreign-{session}"),
    }
}

fn command_of(step: Step) -> Command {
    let patch = String::new();
    match step {
        Step::StartSession => {
            Command::StartSession { patch, target: None, branches: None, confirmed_by: None, leave_out: Vec::new() }
        }
        Step::StartRamp(session) => Command::StartRamp { session },
        Step::FinishRamp(session) => Command::FinishRamp { session },
        Step::Abort(session) => Command::AbortSession { session, reason: None },
        Step::Discard(session) => Command::DiscardSession { session },
        Step::Activate(set) => Command::Activate { patch, model_set: id_of(set), expected: None },
        Step::Import(set) => {
            let session = if let Set::Foreign(session @ 1..) = set { Some(session) } else { None };
            let baseline = elsewhere(template());
            let set = ModelSet { id: id_of(set), session, baseline, ..ModelSet::clone(template()) };
            Command::Import { model_set: Arc::new(set), insist: true }
        }
        Step::Tare { confirmed } => Command::Tare { patch, confirmed_by: confirmed.then(|| "Ada".to_owned()) },
        // Confirmed, since whether there is a zero, and else the boards are looked at, is not in the table.
        Step::BringUp => Command::BringUp { patch, confirmed_by: Some("Ada".to_owned()) },
        _ => unreachable!("{step:?} is no command"),
    }
}

/// Where another robot's skin rests: every skin of these tests does at the very same counts.
fn elsewhere(set: &ModelSet) -> Vec<TaxelBaseline> {
    set.baseline.iter().map(|taxel| TaxelBaseline { mean: taxel.mean + 0.01, ..*taxel }).collect()
}

/// Models of the skin, from one ramp.
fn template() -> &'static ModelSet {
    static TEMPLATE: OnceLock<Arc<ModelSet>> = OnceLock::new();
    TEMPLATE.get_or_init(|| {
        let mut daemon = Daemon::new();
        daemon.apply(Step::Pass(Passing::Hold));
        daemon.apply(Step::StartSession);
        for how in [Passing::Hold, Passing::Rise, Passing::Rise, Passing::Rise] {
            daemon.apply(Step::Pass(how));
        }
        let set = daemon.fits[0].run(|_| "m-template".to_owned()).result.expect("the ramp gives models");
        assert!(set.taxels.iter().all(|model| model.is_usable()), "{:?}", set.taxels);
        set
    })
}
