//! What a report is asked for.

use std::path::PathBuf;

/// The same for every section.
#[derive(Clone, Debug)]
pub struct Options {
    /// Fewer repetitions and smaller sizes, for less than a minute in all.
    pub quick: bool,
    /// Where recordings and regression sets lie (`insole/`, `strd/`), if they are there.
    pub data: Option<PathBuf>,
    /// A Python that may have numpy.
    pub python: PathBuf,
    /// The `taxeld` that is measured as a process.
    pub taxeld: PathBuf,
    /// Of all simulated data.
    pub seed: u64,
}
