//! Frames to scans: what was heard, what of it may be believed, and what it says of the boards.

pub mod assembler;
pub mod boards;
pub mod bring_up;
pub mod cells;
pub mod faults;
pub mod gauge;
pub mod health;
pub mod pace;
pub mod receive;

pub use receive::{Intake, IntakeEvent, IntakePlan};
