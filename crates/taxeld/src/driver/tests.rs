//! The driver's turns, one by one, in virtual time.

#![allow(clippy::unwrap_used, clippy::panic)] // clippy exempts only functions that are tests themselves

use super::outputs::fit;
use super::*;
use std::path::Path;
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;
use taxel_model::{GaugeUncertainty, Status, TaxelModel};
use taxel_rpc::handle::channel;
use taxel_rpc::{Handle, STALLED_AFTER};
use taxel_sim::{BoardsConfig, Config, Skin, World};
use taxel_skin::{BusIndex, Time};
use taxel_store::{OnDurable, QUEUE_BATCHES, QUEUE_BATCHES_ASKED, StoreError, models_json};
use taxel_wire::{CanId, TimedFrame};
use tokio::time::{Instant, advance};

use crate::bus::BATCHES_WAITING_MAX;
use crate::config;

const MS: Duration = Duration::from_millis(1);
const BEGUN: Time = Time::from_nanos(1_700_000_000_000_000_000);

/// A clock that moves with the runtime's virtual time.
fn virtual_clock() -> RunClock {
    let begun = Instant::now();
    Arc::new(move || {
        let time = BEGUN + begun.elapsed();
        taxel_engine::Now { time, wall_ns: time.as_nanos() }
    })
}

/// A driver with nothing but the test around it.
pub(crate) struct Bench {
    driver: Driver,
    queues: Queues,
    batches: mpsc::Sender<BusBatch>,
    commands: mpsc::Sender<Request>,
    pub(crate) handle: Handle,
    of_handle: mpsc::Receiver<Request>,
    clock: RunClock,
    cancel: CancellationToken,
    _to_send: mpsc::Receiver<Frame>,
}

impl Bench {
    /// The forearm of the demo, whose boards send already.
    fn new() -> Self {
        Self::with_store(|notify| (Store::in_memory(notify).unwrap(), Restored::default()))
    }

    /// The same on the store in this file.
    pub(crate) fn on(database: &Path) -> Self {
        Self::with_store(|notify| {
            let (store, restored, _) = Store::open(database, notify).unwrap();
            (store, restored)
        })
    }

    fn with_store(open: impl FnOnce(taxel_store::Notify) -> (Store, Restored)) -> Self {
        let path = Path::new("demo_config.toml");
        let mut plan = config::examine_text(path, include_str!("../demo_config.toml")).unwrap().1.plan;
        plan.patches[0].bring_up.clear();
        let (plan, clock, cancel) = (Arc::new(plan), virtual_clock(), CancellationToken::new());
        let now = Arc::clone(&clock);
        let (handle, publisher, of_handle) = channel(Arc::clone(&plan), Arc::new(move || now().time), cancel.clone());
        let (tell_done, done) = TellDone::new();
        let (store, restored) = open(tell_done.of_store());
        let (bus, _to_send) = mpsc::channel(64);
        let (batches, frames) = mpsc::channel(BATCHES_WAITING_MAX);
        let (commands, requests) = mpsc::channel(16);
        let driver = Driver::new(plan, restored, clock.clone(), publisher, (store, tell_done), vec![bus]);
        let queues = Queues { batches: frames, pushed: mpsc::channel(1).1, commands: requests, done };
        Self { driver, queues, batches, commands, handle, of_handle, clock, cancel, _to_send }
    }

    async fn turn(&mut self) {
        while let Ok(request) = self.of_handle.try_recv() {
            self.commands.try_send(request).unwrap();
        }
        assert!(self.driver.turn(&mut self.queues, &self.cancel).await);
    }

    /// Takes turns until this is done.
    pub(crate) async fn during<T>(&mut self, work: impl Future<Output = T>) -> T {
        tokio::pin!(work);
        loop {
            tokio::select! {
                biased;
                done = &mut work => return done,
                () = self.turn() => {}
            }
        }
    }

    /// Closes the store.
    pub(crate) async fn end(self) {
        self.cancel.cancel();
        self.driver.run(self.queues, self.cancel).await.unwrap();
    }

    pub(crate) fn reader(&self) -> taxel_store::Reader {
        self.driver.store.reader()
    }

    /// By how much the tick that the engine wants is late; zero if it is not due.
    fn overdue(&self) -> Duration {
        self.driver.next_tick().map_or(Duration::ZERO, |due| (self.clock)().time.since(due.max(BEGUN)))
    }

    /// Hands frames over; false if the queue is full.
    fn hand_over(&self, frames: Vec<TimedFrame>) -> bool {
        self.batches.try_send(BusBatch { bus: BusIndex(0), frames, notices: Vec::new() }).is_ok()
    }

    /// Gives a command, of which it may be known who asks for it.
    fn give(&self, command: Command, who: Option<&str>) -> oneshot::Receiver<Reply> {
        let (reply, answer) = oneshot::channel();
        let asked = |who: &str| Asked { who: who.to_owned(), patch: "left_forearm".to_owned(), ..Asked::default() };
        let asked = who.map(|who| Box::new(asked(who)));
        self.commands.try_send(Request { command, reply, asked }).unwrap();
        answer
    }

    /// Gives a command and takes turns until it is answered.
    async fn reply(&mut self, who: Option<&str>, command: Command) -> Reply {
        let answer = self.give(command, who);
        self.during(answer).await.unwrap()
    }

    /// Imports a set that must be refused as not to be stored; why it is.
    async fn refused_import(&mut self, wall_ns: i64) -> String {
        match self.reply(None, import(wall_ns)).await {
            Err(Rejection::Unavailable(_, why)) => why,
            other => panic!("{other:?}"),
        }
    }

    /// The store's thread writes nothing until it is told to go on.
    fn hold_writer(&self) -> std::sync::mpsc::Sender<()> {
        let (release, hold) = std::sync::mpsc::channel::<()>();
        let (tell, told) = std::sync::mpsc::channel();
        let blocker: OnDurable = Box::new(move |_| {
            tell.send(()).unwrap();
            hold.recv().unwrap();
        });
        self.driver.store.submit(Batch { records: Vec::new(), on_durable: Some(blocker) }).unwrap();
        told.recv().unwrap(); // the writer is in the callback now
        release
    }

    /// Gives a command that is refused at once; the refusal comes here.
    fn ask(&self) -> Option<oneshot::Receiver<Reply>> {
        let (reply, answer) = oneshot::channel();
        let command = Command::BringUp { patch: "nose".to_owned(), confirmed_by: None };
        self.commands.try_send(Request { command, reply, asked: None }).ok().map(|()| answer)
    }
}

/// A model set of the demo's forearm that differs from others by its time and method: an id follows from the content.
pub(crate) fn model_set(created_wall_ns: i64) -> Arc<ModelSet> {
    let mut set = ModelSet {
        patch: "left_forearm".to_owned(),
        created_wall_ns,
        method: format!("none {created_wall_ns}"),
        baseline: vec![TaxelBaseline { mean: 200.0, noise: 0.5 }; 230],
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.01,
        gauge_offset_kpa: 0.1,
        taxels: vec![TaxelModel::without_curve(Status::NoData, GaugeUncertainty::default()); 230],
        ..ModelSet::default()
    };
    set.id = models_json::content_id(&set);
    Arc::new(set)
}

fn import(created_wall_ns: i64) -> Command {
    Command::Import { model_set: model_set(created_wall_ns), insist: false }
}

#[tokio::test(start_paused = true)]
async fn under_a_flood_of_frames_and_commands_every_tick_comes_in_time_and_every_command_is_answered() {
    let mut bench = Bench::new();
    let mut waiting = Vec::new();
    for turn in 0..1_000 {
        let frame = Frame::data(CanId::Standard(0x7FE), &[0; 8]).unwrap();
        while bench.hand_over(vec![TimedFrame { time: (bench.clock)().time, frame }; 64]) {}
        if turn >= 500 {
            while let Some(answer) = bench.ask() {
                waiting.push((turn, answer));
            }
        } else if turn % 100 == 50 {
            waiting.push((turn, bench.ask().unwrap()));
        }
        advance(MS).await; // what a batch may take
        bench.turn().await;
        assert!(bench.overdue() <= MS, "turn {turn}: the tick is {:?} late", bench.overdue());
        waiting.retain_mut(|(_, answer)| answer.try_recv().is_err());
        // By chance: of one that waits alone 2, of the last of a full queue 2 for each.
        let late = |asked: i32| if asked < 500 { 50 } else { 8 * 17 };
        let overdue = waiting.iter().find(|(asked, _)| turn - asked >= late(*asked));
        assert!(overdue.is_none(), "turn {turn}: asked at {:?} and not answered", overdue.map(|(asked, _)| asked));
    }
}

#[tokio::test(start_paused = true)]
async fn with_nothing_to_do_the_driver_ticks_and_beats_in_time() {
    let mut bench = Bench::new();
    bench.turn().await;
    for turn in 0..200 {
        let begun = Instant::now();
        bench.turn().await;
        assert!(begun.elapsed() <= BEAT_EVERY + MS, "turn {turn} took {:?}", begun.elapsed());
        assert!(bench.overdue() <= MS, "turn {turn}: the tick is {:?} late", bench.overdue());
    }
}

/// The forearm of the demo runs for a second; in the next one the driver may have no turn. Gives how many states were
/// published for that second, and whether any taxel is silent at its end.
async fn a_second_after_a_second(frozen: bool) -> (u64, bool) {
    let mut bench = Bench::new();
    let boards = BoardsConfig { start_streaming: true, ..BoardsConfig::default() };
    let config = Config { start: BEGUN, boards, ..Config::seeded(1) };
    let mut world = World::new(Skin::forearm().unwrap(), config);
    // As a bus task does: what does not fit into the queue waits outside.
    let (to_bus, mut bus) = mpsc::unbounded_channel();
    let batches = bench.batches.clone();
    tokio::spawn(async move {
        while let Some(frames) = bus.recv().await {
            let batch = BusBatch { bus: BusIndex(0), frames, notices: Vec::new() };
            assert!(batches.send(batch).await.is_ok());
        }
    });
    let mut before = None;
    for ms in 1..=2_000 {
        advance(MS).await;
        let mut frames = Vec::new();
        world.advance(BEGUN + ms * MS, &mut frames);
        // A batch without frames takes the place of a timer: a turn that had to wait would move the clock.
        let has_turn = ms <= 1_000 || !frozen || ms == 2_000;
        let handed_over = !frames.is_empty() || (has_turn && bench.overdue() > Duration::ZERO);
        if handed_over {
            to_bus.send(frames).unwrap();
            tokio::task::yield_now().await;
        }
        if ms == 1_000 {
            before = bench.handle.newest(0).map(|newest| newest.sequence);
        }
        if handed_over && has_turn {
            bench.turn().await;
        }
    }
    let newest = bench.handle.newest(0).unwrap();
    (newest.sequence - before.unwrap(), newest.taxels.iter().any(|taxel| taxel.stale))
}

#[tokio::test(start_paused = true)]
async fn after_a_stall_what_came_meanwhile_is_taken_before_any_tick() {
    assert!(STALLED_AFTER < Duration::from_secs(1));
    let (running, frozen) = (a_second_after_a_second(false).await, a_second_after_a_second(true).await);
    // A tick before the frames would publish that all boards are silent: one state more.
    assert_eq!(frozen, running);
    assert!(!frozen.1);
}

#[tokio::test]
async fn what_the_store_has_is_known_before_the_first_turn() {
    let Bench { driver, handle, .. } = Bench::new();
    assert!(handle.stored().active.is_empty());
    let _driver = driver.begun();
    assert_eq!(handle.stored().active, [("left_forearm".to_owned(), None)]);
}

#[tokio::test]
async fn a_commit_that_the_disk_refuses_is_refused_with_the_reason_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let [path, elsewhere] = ["store.db", "elsewhere.db"].map(|name| folder.path().join(name));
    let mut bench = Bench::on(&path);
    let Ok(taxel_engine::command::Done::Kept { model_set, .. }) = bench.reply(None, import(1)).await else { panic!() };
    std::fs::rename(&path, &elsewhere).unwrap();
    let why = bench.refused_import(2).await;
    assert!(why.contains("nothing has changed: the store failed") && why.contains("was removed"), "{why}");
    let later = bench.refused_import(3).await;
    // The store says so, or the engine where it has heard of the failure by then.
    let [store, engine] = ["the store takes no more writes", "the store failed and takes nothing until a restart: "];
    assert!((later.contains(store) || later.starts_with(engine)) && later.contains("was removed"), "{later}");
    std::fs::rename(&elsewhere, &path).unwrap();
    let Bench { driver, .. } = bench;
    driver.store.close().unwrap_err();
    let (store, restored, quarantined) = Store::open(&path, Box::new(|_| ())).unwrap();
    assert_eq!(restored.model_sets.iter().map(|set| set.id.as_str()).collect::<Vec<_>>(), [model_set.id.as_str()]);
    assert_eq!(quarantined, []);
    store.close().unwrap();
}

#[tokio::test]
async fn a_commit_that_the_stores_queue_has_no_room_for_is_refused_with_the_reason() {
    let mut bench = Bench::new();
    bench.turn().await;
    let release = bench.hold_writer();
    while bench.driver.store.submit(Batch::default()).is_ok() {}
    let why = bench.refused_import(1).await;
    let behind = StoreError::Behind { waiting: QUEUE_BATCHES }.to_string();
    assert_eq!(why, format!("it could not be written to disk, and nothing has changed: {behind}"));
    release.send(()).unwrap();
    // Nothing was lost, so that the store goes on when the disk does.
    while let Err(Rejection::Unavailable(_, why)) = bench.reply(None, import(2)).await {
        assert!(why.contains(&behind), "{why}");
    }
}

/// Else a client that asks for what is refused could fill the queue of a slow disk, and end all writing with that.
#[tokio::test]
async fn a_refusal_is_told_when_it_is_in_the_audit_log() {
    let mut bench = Bench::new();
    bench.turn().await;
    let release = bench.hold_writer();
    let mut answer = bench.give(Command::DiscardSession { session: 7 }, Some("eve"));
    // Of the next one it is not known who asked, so that nothing is written down of it.
    let refused = bench.reply(None, Command::DiscardSession { session: 8 }).await.unwrap_err();
    assert!(matches!(refused, Rejection::NotFound(..)), "{refused:?}");
    assert!(matches!(answer.try_recv(), Err(oneshot::error::TryRecvError::Empty)));
    release.send(()).unwrap();
    let refused = answer.await.unwrap().unwrap_err();
    assert!(matches!(refused, Rejection::NotFound(..)), "{refused:?}");
}

/// A client that asks faster than a slow disk writes is refused in time: what happens by itself still has room, and all is well
/// when the disk is back.
#[tokio::test]
async fn a_client_that_asks_much_of_a_slow_disk_is_refused_before_that_ends_all_writing() {
    let mut bench = Bench::new();
    bench.turn().await;
    let release = bench.hold_writer();
    let (mut waiting, mut refused) = (Vec::new(), None);
    while refused.is_none() {
        assert!(waiting.len() < QUEUE_BATCHES, "all was taken");
        let mut answer = bench.give(import(waiting.len() as i64), Some("ann"));
        bench.turn().await;
        refused = answer.try_recv().ok();
        waiting.push(answer);
    }
    let behind = StoreError::Behind { waiting: QUEUE_BATCHES_ASKED };
    let why = format!("the audit log cannot be written: {behind}");
    assert_eq!(refused.unwrap().unwrap_err(), Rejection::Unavailable(ErrorReason::StoreUnavailable, why));
    for _ in 0..QUEUE_BATCHES / 2 {
        bench.driver.store.submit(Batch::default()).unwrap();
    }
    release.send(()).unwrap();
    waiting.pop();
    for answer in waiting {
        bench.during(answer).await.unwrap().unwrap();
    }
    assert!(bench.reply(None, import(-1)).await.is_ok());
}

#[tokio::test]
async fn what_is_done_is_told_so_also_where_what_follows_from_it_cannot_be_written_down() {
    let mut bench = Bench::new();
    let fault: OnDurable = Box::new(|_| panic!("a fault that this test makes"));
    bench.driver.store.submit(Batch { records: Vec::new(), on_durable: Some(fault) }).unwrap();
    // As of an activation: it is on disk and in use, and its session is to be marked as active.
    let session = || vec![Record::Session(Arc::default())];
    for is_done in [true, false] {
        let (reply, answer) = oneshot::channel();
        bench.driver.commit(session(), vec![(reply, Ok(taxel_engine::command::Done::Deleted))], is_done);
        assert_eq!(answer.await.unwrap().is_ok(), is_done);
    }
}

#[tokio::test]
async fn a_fit_that_is_lost_comes_back_with_the_reason() {
    let (tell_done, mut done) = TellDone::new();
    fit((7, 1), tell_done, || panic!("a fault that this test makes")).await;
    let Some(Done::Input(Input::Fitted(outcome))) = done.recv().await else { panic!("nothing came back") };
    assert_eq!(outcome.session, 7);
    let why = outcome.result.unwrap_err();
    assert!(why.contains("the fit was lost") && why.contains("samples are kept"), "{why}");
}

impl Bench {
    /// The whole audit log, oldest first: who, model set before and after, result.
    fn audit_log(&self) -> Vec<[String; 4]> {
        let (tell, told) = std::sync::mpsc::channel();
        self.driver.store.reader().audit(u64::MAX, 100, Box::new(move |read| tell.send(read).unwrap()));
        let mut entries = told.recv().unwrap().unwrap();
        entries.reverse();
        let shown = |entry: taxel_engine::audit::AuditEntry| {
            let (asked, answered) = (entry.asked.unwrap(), entry.answered.unwrap_or_default());
            [asked.who, asked.before, answered.after, answered.result]
        };
        entries.into_iter().map(shown).collect()
    }
}

#[tokio::test]
async fn the_audit_log_has_who_asked_and_the_model_set_before_and_after() {
    let mut bench = Bench::new();
    let ids = [1, 2].map(|wall_ns| model_set(wall_ns).id.clone());
    for wall_ns in [1, 2] {
        bench.reply(Some("ann"), import(wall_ns)).await.unwrap();
    }
    let activate = |id: &str| Command::Activate { patch: String::new(), model_set: id.to_owned(), expected: None };
    bench.reply(Some("bob"), activate(&ids[0])).await.unwrap();
    bench.reply(Some("joe"), activate(&ids[1])).await.unwrap();
    let refusal = bench.reply(Some("eve"), activate("m-none")).await.unwrap_err();
    let [a, b, none] = [ids[0].as_str(), ids[1].as_str(), ""];
    let refused = format!("refused: {refusal}");
    let expected = [
        ["ann", none, none, "done"],
        ["ann", none, none, "done"],
        ["bob", none, a, "done"],
        ["joe", a, b, "done"],
        ["eve", b, b, refused.as_str()],
    ];
    assert_eq!(bench.audit_log(), expected.map(|entry| entry.map(str::to_owned)));
}

/// A bring-up sends to the boards at once, with nothing of it to be written first but who asked.
#[tokio::test]
async fn a_bring_up_waits_until_it_is_on_disk_who_asked_for_it() {
    let mut bench = Bench::new();
    let release = bench.hold_writer();
    let command = || Command::BringUp { patch: String::new(), confirmed_by: None };
    let mut answer = bench.give(command(), Some("ann"));
    bench.turn().await;
    let request = *bench.driver.waiting.keys().next().expect("it waits, and the engine has not heard of it");
    assert!(matches!(answer.try_recv(), Err(oneshot::error::TryRecvError::Empty)));
    // The disk turns out to be full: it is not done.
    bench.driver.take_done(Done::Asked(request, Box::new(command()), Err("the disk is full".to_owned())));
    let why = "the audit log cannot be written: the disk is full".to_owned();
    assert_eq!(answer.await.unwrap().unwrap_err(), Rejection::Unavailable(ErrorReason::StoreUnavailable, why));
    assert!(bench.driver.waiting.is_empty());
    // Somebody who does not wait any more is not obeyed when the disk comes back.
    drop(bench.give(command(), Some("eve")));
    bench.turn().await;
    release.send(()).unwrap();
    while !bench.driver.waiting.is_empty() {
        bench.turn().await;
    }
    let said = bench.audit_log().into_iter().find(|[who, ..]| who == "eve").unwrap();
    assert!(said[3].contains("nothing is done"), "{said:?}");
    let Err(Rejection::FailedPrecondition(reason, _)) = bench.reply(Some("bob"), command()).await else {
        panic!("this one only listens")
    };
    assert_eq!(reason, ErrorReason::ListenOnly);
}
