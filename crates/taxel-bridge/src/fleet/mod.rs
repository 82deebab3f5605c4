//! Many robots on one router: what each tells of itself, and all of them in one table.

pub mod book;
pub mod robot;
pub mod watch;
