//! What the store promises, tried on real files.

mod codec;
mod crash;
mod damage;
mod deletions;
mod failure;
mod fixture;
mod loads;
mod older;
mod store;
