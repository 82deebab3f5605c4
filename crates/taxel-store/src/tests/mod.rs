//! What the store promises, tried on real files.

mod codec;
mod disk;
mod failure;
pub(crate) mod fixture;
mod flips;
mod loss;
mod power;
mod read_only;
mod store;
