//! Being written.
/// Args.
#[derive(Debug, clap::Args)]
pub struct JudgeArgs {}
/// Runs.
/// # Errors
/// None.
pub fn judge(_: &JudgeArgs) -> anyhow::Result<()> {
    Ok(())
}
