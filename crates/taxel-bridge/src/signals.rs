//! What asks a program to end.

use tokio::signal::unix::{SignalKind, signal};

/// Waits until somebody at a terminal, or the service manager, asks the program to end.
///
/// # Errors
/// If the system gives no signals.
pub async fn asked_to_end() -> anyhow::Result<()> {
    let mut terminated = signal(SignalKind::terminate())?;
    tokio::select! {
        interrupted = tokio::signal::ctrl_c() => Ok(interrupted?),
        _ = terminated.recv() => Ok(()),
    }
}
