//! `taxeld report`: error against run time, the stability table, and what a scene costs, as one page.

use std::path::PathBuf;

use anyhow::Context;
use clap::builder::PossibleValuesParser;
use taxel_report::options::Options;

/// What can be asked of the report.
#[derive(Debug, clap::Args)]
pub struct ReportArgs {
    /// Folder for the page and its data; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Fewer repetitions and smaller sizes: less than a minute.
    #[arg(long)]
    quick: bool,
    /// Folder with recordings and regression sets (`insole/`, `strd/`); without it the one that TAXELD_DATA names, if any.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Of all simulated data.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only these sections.
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = PossibleValuesParser::new(taxel_report::names()))]
    only: Vec<String>,
    /// A Python to compare with; it takes part if it has numpy.
    #[arg(long, value_name = "FILE", default_value = "python3")]
    python: PathBuf,
}

/// Measures and writes the report.
///
/// # Errors
/// The folder cannot be written, or a section failed; the others are written all the same.
pub fn report(args: ReportArgs) -> anyhow::Result<()> {
    let ReportArgs { out, quick, data, seed, only, python } = args;
    let data = data.or_else(|| std::env::var_os("TAXELD_DATA").map(PathBuf::from));
    if let Some(data) = &data {
        anyhow::ensure!(data.is_dir(), "the data: {} is no folder", data.display());
    }
    let taxeld = std::env::current_exe().context("finding the running programme")?;
    let options = Options { quick, data, python, taxeld, seed };
    taxel_report::run(&options, &out, &only)?;
    say!("{}", out.join("index.html").display());
    Ok(())
}
