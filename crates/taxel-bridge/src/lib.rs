//! A bridge from the service `taxel.v1` to ROS 2 and to Zenoh: the force of robot skin as topics, without ROS, and robots as
//! members of a fleet.
//!
//! The bridge is a process of its own and an ordinary client of the daemon, which knows nothing of it. `taxel-client`
//! follows the force and judges at the moment of sending whether it still is one; `ros/` and `fleet/` publish. `types`,
//! `messages`, `diagnostics` and `book` are pure.

pub mod config;
pub mod daemon;
pub mod fleet;
pub mod link;
pub mod ros;
pub mod run;
pub mod yarp;

use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};
use tokio::time::{Interval, MissedTickBehavior};

/// Ticks from now on. What was missed is not made up for: what a tick that is long past would have told is old.
fn ticks(every: Duration) -> Interval {
    let mut ticks = tokio::time::interval(every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    ticks
}

/// Waits until somebody at a terminal, or the service manager, asks the program to end.
async fn asked_to_end() -> anyhow::Result<()> {
    let mut terminated = signal(SignalKind::terminate())?;
    tokio::select! {
        interrupted = tokio::signal::ctrl_c() => Ok(interrupted?),
        _ = terminated.recv() => Ok(()),
    }
}
