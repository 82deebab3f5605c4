//! What stands around the services: health, the drain.

use taxel_engine::snapshot::StoreHealth;
use tokio::io::AsyncReadExt;
use tonic_health::pb::health_check_response::ServingStatus;

use crate::fixture::*;
use crate::stalls::{until, watch};

#[tokio::test]
async fn health_follows_the_buses_and_the_force() {
    let daemon = start().await;
    let channel = daemon.connect().await;
    let mut force = watch(&channel, "taxel.v1.ForceService").await;
    let mut skin = watch(&channel, "taxel.v1.SkinService").await;
    let mut whole = watch(&channel, "").await;
    for stream in [&mut force, &mut skin] {
        until(stream, ServingStatus::NotServing).await;
    }
    daemon.engine().health(Arc::new(with_a_bus(true)));
    assert_eq!(
        skin.message().await.unwrap().unwrap().status(),
        ServingStatus::Serving,
        "the engine had told of no bus"
    );
    daemon.engine().patch(0, snapshot(1, Time::default()));
    assert_eq!(force.message().await.unwrap().unwrap().status(), ServingStatus::Serving);
    daemon.engine().health(Arc::new(with_a_bus(false)));
    assert_eq!(skin.message().await.unwrap().unwrap().status(), ServingStatus::NotServing);
    until(&mut whole, ServingStatus::Serving).await;
    daemon.shutdown.cancel();
    assert_eq!(whole.message().await.unwrap().unwrap().status(), ServingStatus::NotServing);
    assert!(whole.message().await.unwrap().is_none(), "a health stream does not hold the shutdown up");
}

#[tokio::test]
async fn health_tells_a_store_that_is_damaged_and_one_that_takes_nothing_more() {
    let daemon = start().await;
    daemon.engine().health(Arc::new(with_a_bus(true)));
    let channel = daemon.connect().await;
    let mut store = watch(&channel, "taxel.store").await;
    let mut calibration = watch(&channel, "taxel.v1.CalibrationService").await;
    for stream in [&mut store, &mut calibration] {
        until(stream, ServingStatus::Serving).await;
    }
    let damage = vec!["session 3 is damaged on disk".to_owned()];
    let damaged = StoreHealth { damage: damage.clone(), ..StoreHealth::default() };
    daemon.engine().health(Arc::new(Health { store: damaged, ..with_a_bus(true) }));
    assert_eq!(store.message().await.unwrap().unwrap().status(), ServingStatus::NotServing);
    let full = StoreHealth { problem: Some("the disk is full".to_owned()), damage };
    daemon.engine().health(Arc::new(Health { store: full, ..with_a_bus(true) }));
    assert_eq!(calibration.message().await.unwrap().unwrap().status(), ServingStatus::NotServing);
}

#[tokio::test]
async fn a_peer_that_holds_on_is_cut_at_the_deadline() {
    let limits = Limits { drain: Duration::from_millis(50), ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    let mut mute = TcpStream::connect(daemon.address).await.unwrap();
    // An answer on a later connection proves that the mute one was accepted.
    get_force(daemon.connect().await).await.unwrap();
    daemon.shutdown.cancel();
    daemon.server.await.unwrap().unwrap();
    read_to_end(&mut mute).await; // ends, so it was closed
}

/// Longer than any limit of these tests; who is not closed by then never is.
const CLOSES_WITHIN: Duration = Duration::from_secs(120);

/// Reads until the peer closes or resets; how much came.
pub async fn read_to_end(stream: &mut TcpStream) -> usize {
    let mut all = Vec::new();
    let read = tokio::time::timeout(CLOSES_WITHIN, stream.read_to_end(&mut all)).await;
    assert!(read.is_ok(), "the peer neither closes nor resets"); // a reset is a close as well
    all.len()
}
