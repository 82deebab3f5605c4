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
