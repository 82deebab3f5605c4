//! ROS 2 as `rmw_zenoh` speaks it, without ROS.

pub mod attachment;
pub mod cdr;
pub mod diagnostics;
pub mod keys;
pub mod messages;
pub mod node;
pub mod publish;
pub mod tare;
pub mod types;
