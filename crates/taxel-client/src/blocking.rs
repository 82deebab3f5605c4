//! The same for programmes without a tokio runtime.

use std::io;

use crate::connect::Options;
use crate::follow::{Forces, start};

/// Follows the force on a thread of its own, from now on and for as long as the result lives. Nobody need answer yet.
///
/// # Errors
/// If the system has no thread or no descriptors left.
pub fn follow(options: Options) -> io::Result<Forces> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let (forces, work) = start(options);
    std::thread::Builder::new().name("taxel-client".to_owned()).spawn(move || runtime.block_on(work))?;
    Ok(forces)
}
