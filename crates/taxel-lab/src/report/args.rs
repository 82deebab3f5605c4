//! How the report is asked for.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;

/// The sections of the report.
const NAMES: [&str; 3] = ["force", "stability", "scenes"];

/// What can be asked of the report.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxel-lab report --out report\n  taxel-lab report --quick --only force,stability --out report"
)]
pub struct ReportArgs {
    /// Folder for the page and its data; made if it is not there.
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Fewer repetitions and smaller sizes: less than a minute.
    #[arg(long)]
    pub(super) quick: bool,
    /// Folder with recordings of a real skin (`insole/`); without it they are left out.
    #[arg(long, value_name = "DIR", env = "TAXELD_DATA")]
    pub(super) data: Option<PathBuf>,
    /// Of all simulated data.
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Only these sections.
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = PossibleValuesParser::new(NAMES))]
    pub(super) only: Vec<String>,
}
