//! Being written.
/// Args.
#[derive(Debug, clap::Args)]
pub struct FitArgs {}
/// Runs.
/// # Errors
/// None.
pub fn fit(_: &FitArgs) -> anyhow::Result<()> {
    Ok(())
}
/// Prints.
pub fn print_summary(_: &taxel_engine::model_set::ModelSet) {}
