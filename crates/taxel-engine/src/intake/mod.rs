//! Frames to scans: what was heard, what of it is valid, and what it says of the boards.

pub(crate) mod assembler;
pub(crate) mod boards;
pub(crate) mod bring_up;
pub(crate) mod cells;
pub(crate) mod faults;
pub(crate) mod gauge;
pub(crate) mod health;
pub(crate) mod pace;
pub(crate) mod receive;
