//! Being written.
/// Args.
#[derive(Debug, clap::Args)]
pub struct ApplyArgs {}
/// Runs.
/// # Errors
/// None.
pub fn apply(_: &ApplyArgs) -> anyhow::Result<()> {
    Ok(())
}
