//! A controller against the real service, which starts, stops, hangs and comes back.

#![allow(clippy::unwrap_used, clippy::panic)] // clippy exempts only functions that are tests themselves

use std::net::TcpListener;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use taxel_client::{Address, Force, Forces, NoForce, Options, blocking, follow};
use taxel_engine::plan::{LiveLimits, PatchPlan, Plan};
use taxel_engine::snapshot::{ForceSample, ForceState, PatchSnapshot};
use taxel_proto::judge;
use taxel_rpc::handle::channel;
use taxel_rpc::{Access, Backend, Limits, Listener, Publisher, Rules, Server};
use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Newton, Patch, Time};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// How long a busy machine may take for anything.
const PATIENCE: Duration = Duration::from_secs(120);
/// What the service itself calls too old: far beyond what any test publishes.
const NEVER_STALE: Duration = Duration::from_secs(1_000_000);

/// A daemon without a store.
struct NoStore;

impl Backend for NoStore {}

/// A service whose engine is the test.
struct Daemon {
    publisher: Publisher,
    origin: Instant,
    shutdown: CancellationToken,
    server: JoinHandle<std::io::Result<()>>,
}

impl Daemon {
    fn start(listener: Listener) -> Self {
        let board = Board {
            bus: BusIndex(0),
            address: BoardAddress::new(13).unwrap(),
            modules: vec![(Module::from_nibble(0), ModuleKind::Triangle)],
        };
        let live = LiveLimits { stale_after: NEVER_STALE, ..LiveLimits::default() };
        let patch = PatchPlan { live, ..PatchPlan::new(Patch::new("palm", vec![board]).unwrap()) };
        let plan = Arc::new(Plan { buses: 1, patches: vec![patch] });
        let (origin, shutdown) = (Instant::now(), CancellationToken::new());
        // A clock of its own, and an engine that is never taken for stalled.
        let run = move || daemon_time(origin);
        let (handle, publisher, _requests) = channel(plan, Arc::new(run), shutdown.clone());
        let server = Server::new(handle, Arc::new(NoStore), Access::new(Rules::open()), Limits::default()).unwrap();
        let server = tokio::spawn(server.serve(vec![listener]));
        Self { publisher, origin, shutdown, server }
    }

    fn on(path: &Path) -> Self {
        let _ = std::fs::remove_file(path); // of the daemon before
        Self::start(Listener::Unix(UnixListener::bind(path).unwrap()))
    }

    /// A force of `newton`, whose newest frame came so long ago.
    fn publish(&self, newton: f64, age: Duration) {
        let time = daemon_time(self.origin) - age;
        let total = Some(Newton(newton));
        let force = ForceSample { state: ForceState::Ok, total, ..ForceSample::default() };
        let sequence = newton as u64;
        let snapshot = PatchSnapshot { sequence, time, wall_ns: 1, seen: true, force, ..PatchSnapshot::default() };
        self.publisher.patch(0, Arc::new(snapshot));
    }

    async fn stop(self) {
        self.shutdown.cancel();
        self.server.await.unwrap().unwrap();
    }
}

/// The clock of a robot that was switched on two million seconds ago.
fn daemon_time(origin: Instant) -> Time {
    Time::from_seconds(2e6) + origin.elapsed()
}

fn at(path: &Path) -> Options {
    let age_max = Some(Duration::from_secs(2));
    Options { age_max, ..Options::new(Address::parse(&format!("unix:{}", path.display())).unwrap()) }
}

/// Asks until there is what is looked for; `every` is done before each question.
async fn until<T>(forces: &Forces, mut every: impl FnMut(), wanted: impl Fn(Result<Force, NoForce>) -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        every();
        let force = forces.force();
        let said = format!("{force:?}");
        if let Some(found) = wanted(force) {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "{said}");
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

#[tokio::test]
async fn the_newest_force_is_there_and_grows_old_while_nothing_comes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let daemon = Daemon::on(&path);
    let forces = follow(at(&path));
    for newton in [1.0, 2.0, 3.0] {
        let publish = || daemon.publish(newton, Duration::from_millis(20));
        let force = until(&forces, publish, |force| force.ok().filter(|force| force.total_n == newton)).await;
        assert!(force.age >= Duration::from_millis(20), "{force:?}");
        assert_eq!(force.sample.patch, "palm");
    }
    let why = until(&forces, || {}, Result::err).await;
    assert!(matches!(why, NoForce::Sample(judge::NoForce::TooOld(..))), "{why}");
}

#[tokio::test]
async fn after_a_lost_connection_an_old_force_is_never_a_new_one_and_a_new_one_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let forces = follow(at(&path));
    let why = until(&forces, || {}, |force| force.err().filter(|why| *why != NoForce::NothingYet(None))).await;
    assert!(why.to_string().contains("no daemon answers at unix:"), "{why}");

    let daemon = Daemon::on(&path);
    until(&forces, || daemon.publish(1.0, Duration::ZERO), Result::ok).await;
    daemon.stop().await;
    let why = until(&forces, || {}, Result::err).await;
    assert!(matches!(why, NoForce::Lost(_)), "{why}");

    // The next daemon begins with what it has, which is an hour old.
    let daemon = Daemon::on(&path);
    daemon.publish(2.0, Duration::from_secs(3_600));
    let why = until(
        &forces,
        || {},
        |force| match force {
            Ok(force) => panic!("an old force is taken for a new one: {force:?}"),
            Err(why) => matches!(why, NoForce::Sample(judge::NoForce::TooOld(..))).then_some(why),
        },
    );
    let NoForce::Sample(judge::NoForce::TooOld(age, _)) = why.await else { panic!() };
    assert!(age >= Duration::from_secs(3_600), "{age:?}");
    let force = until(&forces, || daemon.publish(3.0, Duration::ZERO), Result::ok).await;
    assert_eq!(force.total_n, 3.0);
}

#[tokio::test]
async fn what_the_daemon_refuses_is_told_and_asked_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let _daemon = Daemon::on(&path);
    let forces = follow(Options { patch: "tail".to_owned(), ..at(&path) });
    let why = until(&forces, || {}, |force| force.err().filter(|why| why.to_string().contains("NOT_FOUND: "))).await;
    assert!(why.to_string().contains("tail"), "{why}");
    let token = Some(folder.path().join("no-token"));
    let forces = follow(Options { token, ..at(&path) });
    until(&forces, || {}, |force| force.err().filter(|why| why.to_string().contains("no-token"))).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
async fn a_programme_without_a_runtime_reads_the_same_over_tcp() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = Address::parse(&listener.local_addr().unwrap().to_string()).unwrap();
    let daemon = Daemon::start(Listener::Tcp(listener));
    let options = Options { rate_hz: Some(200.0), ..Options::new(address) };
    let read = std::thread::spawn(move || {
        let (forces, begun) = (blocking::follow(options).unwrap(), Instant::now());
        loop {
            match forces.force() {
                Ok(force) => return force.total_n,
                Err(why) => assert!(begun.elapsed() < PATIENCE, "{why}"),
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    while !read.is_finished() {
        daemon.publish(4.0, Duration::ZERO);
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(read.join().unwrap(), 4.0);
}
