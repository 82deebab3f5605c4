//! A bridge from the service `taxel.v1` to ROS 2 and to Zenoh: the force of robot skin as topics, without ROS, and robots as
//! members of a fleet.
//!
//! The bridge is a process of its own and an ordinary client of the daemon, which knows nothing of it. `taxel-client`
//! follows the force and judges at the moment of sending whether it still is one; `ros/` and `fleet/` publish. `types`,
//! `messages`, `diagnostics`, `book` and `table` are pure.

pub mod config;
pub mod daemon;
pub mod fleet;
pub mod link;
pub mod ros;
pub mod run;
mod signals;
pub mod yarp;

use std::time::Duration;

use tokio::time::{Interval, MissedTickBehavior};

/// Ticks from now on. What was missed is not made up for: what a tick that is long past would have told is old.
fn ticks(every: Duration) -> Interval {
    let mut ticks = tokio::time::interval(every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    ticks
}
