//! One patch: the organs, and the match over what they return.

mod ask;
mod bring_up;
mod events;
pub mod owner;
mod publish;
