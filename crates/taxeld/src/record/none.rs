//! A build without recordings.

use taxel_engine::plan::Plan;
use taxel_rpc::Handle;
use tokio_util::sync::CancellationToken;

use crate::backend::Recording;
use crate::config::Config;
use crate::parts::Parts;
use crate::record::tap::Taps;

/// Begins nothing: a configuration that asks for a recording was refused before.
///
/// # Errors
/// None.
#[allow(clippy::unnecessary_wraps)] // in other builds it can fail
pub fn begin(
    _: (&Config, bool),
    _: &Plan,
    _: &Handle,
    _: (&mut Parts, &CancellationToken),
) -> anyhow::Result<(Option<Recording>, Taps)> {
    Ok((None, Taps::default()))
}
