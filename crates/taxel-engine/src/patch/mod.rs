//! One patch: the organs, and the match over what they return.

mod ask;
mod events;
pub mod owner;
mod publish;
