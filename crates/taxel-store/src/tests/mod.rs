//! What the store promises, tried on real files.

mod audit;
mod board_zeros;
mod checking;
mod codec;
mod crash;
mod curves;
mod damage;
mod deletions;
mod disk;
mod failure;
pub(crate) mod fixture;
mod flips;
mod in_the_way;
mod in_use;
mod loads;
mod lost;
mod nothing_lost;
mod older;
mod owner;
mod power;
mod read_only;
mod replaced;
mod start;
mod store;
mod store_file;
mod unreadable;
mod upkeep;
