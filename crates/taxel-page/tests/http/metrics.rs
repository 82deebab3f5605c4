//! The metrics, as Prometheus reads them.

use crate::fixture::*;

#[tokio::test]
async fn metrics_say_what_the_service_says() {
    let daemon = start().await;
    daemon.engine.patch(0, snapshot(7));
    let buses = vec![BusHealth { up: true, frames: 4_321, dropped: 5, ..BusHealth::default() }];
    daemon.engine.health(Arc::new(Health { buses, ..Health::default() }));
    let answer = daemon.get("/metrics").await;
    assert_eq!(answer.status, 200, "{answer:?}");
    assert!(answer.head.contains("application/openmetrics-text; version=1.0.0"), "{answer:?}");
    for line in [
        "taxeld_bus_up{bus=\"0\"} 1.0",
        "taxeld_bus_frames_total{bus=\"0\"} 4321",
        "taxeld_bus_dropped_frames_total{bus=\"0\"} 5",
        "taxeld_force_newtons{patch=\"left_forearm\"} 7.0",
        "taxeld_force_simulated{patch=\"left_forearm\"} 1.0",
        "taxeld_force_state{patch=\"left_forearm\",state=\"ok\"} 1.0",
        "taxeld_force_state{patch=\"left_forearm\",state=\"stale\"} 0.0",
        "# EOF",
    ] {
        assert!(answer.body.contains(line), "{line}: {}", answer.body);
    }
    assert_eq!(daemon.post("/metrics", "{}").await.status, 405);
    assert_eq!(daemon.get_with("/metrics", "Origin: http://evil.example\r\n").await.status, 403);
}

/// What the engine said last is nothing that is so; what it has counted stays counted.
#[tokio::test]
async fn of_an_engine_that_stands_still_nobody_is_told_that_buses_and_zeros_are_well() {
    let daemon = start().await;
    daemon.engine.patch(0, snapshot(7));
    let buses = vec![BusHealth { up: true, frames: 4_321, ..BusHealth::default() }];
    daemon.engine.health(Arc::new(Health { buses, ..Health::default() }));
    daemon.engine.beat();
    let well = ["taxeld_bus_up{bus=\"0\"}", "taxeld_zero_valid{", "taxeld_faulty_taxels{", "taxeld_force_newtons{"];
    let always = "taxeld_bus_frames_total{bus=\"0\"} 4321";
    for (ms, runs) in [(100, true), (101, false), (102, true)] {
        daemon.now_ms.store(ms, Ordering::Relaxed);
        if ms == 102 {
            daemon.engine.beat();
        }
        let body = daemon.get("/metrics").await.body;
        let running = format!("taxeld_engine_running{{}} {:.1}", f64::from(u8::from(runs)));
        assert!(body.contains(&running) && body.contains(always), "at {ms} ms: {body}");
        for name in well {
            assert_eq!(body.contains(name), runs, "{name} at {ms} ms: {body}");
        }
    }
}
