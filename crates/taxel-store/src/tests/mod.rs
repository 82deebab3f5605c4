//! What the store promises, tried on real files.

mod codec;
mod crash;
mod damage;
mod failure;
mod fixture;
mod loads;
mod store;
