//! The force of each scan of a replay, as a table that any other program reads.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::judge::word;

use taxel_files::Output;

/// The columns of the table.
const COLUMNS: &str = "time_s,patch,state,total_n,sigma_n,low_n,high_n,active,out_of_range,excluded,stale,reasons";

/// A CSV file with one row for each snapshot of each patch.
///
/// Columns: `time_s` of the log (later where its clock stepped back before), `patch`, `state` (as in the service, without its prefix), `total_n`, `sigma_n`
/// (standard uncertainty), `low_n`, `high_n` (95 % interval; no `high_n` where nothing bounds the force above), `active`, `out_of_range`, `excluded`, `stale`
/// (taxels), and `reasons`, separated by semicolons. Without a force the newtons are empty.
///
/// It is written beside its place and put there when it is whole, so that a replay that comes to nothing leaves what was there.
pub struct ForceFile {
    path: PathBuf,
    patches: Vec<String>,
    csv: Output,
    rows: u64,
    with_force: u64,
}

impl ForceFile {
    /// An empty table.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn create(path: &Path, plan: &Plan) -> anyhow::Result<Self> {
        let mut csv = Output::create(path).with_context(|| path.display().to_string())?;
        writeln!(csv, "{COLUMNS}")?;
        let patches = plan.patches.iter().map(|patch| patch.patch.name().to_owned()).collect();
        Ok(Self { path: path.to_owned(), patches, csv, rows: 0, with_force: 0 })
    }

    /// Appends snapshots, each with the position of its patch.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, snapshots: impl Iterator<Item = (usize, Arc<PatchSnapshot>)>) -> anyhow::Result<()> {
        for (patch, snapshot) in snapshots.filter(|(_, snapshot)| snapshot.seen) {
            let force = &snapshot.force;
            let newton = |value: Option<taxel_skin::Newton>| value.map_or_else(String::new, |n| format!("{:.6}", n.0));
            let time_ns = snapshot.time.as_nanos();
            let row = [
                format!("{}.{:09}", time_ns.div_euclid(1_000_000_000), time_ns.rem_euclid(1_000_000_000)),
                self.patches[patch].clone(),
                word(taxel_rpc::force_state(force.state)).to_owned(),
                newton(force.total),
                newton(force.total_sigma),
                newton(force.low()),
                newton(force.high()),
                force.active.to_string(),
                force.out_of_range.to_string(),
                force.excluded.to_string(),
                force.stale.to_string(),
                quoted(force.why()),
            ];
            writeln!(self.csv, "{}", row.join(",")).with_context(|| self.path.display().to_string())?;
            self.rows += 1;
            self.with_force += u64::from(force.total.is_some());
        }
        Ok(())
    }

    /// Writes what is left; says what the file holds.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> anyhow::Result<String> {
        let Self { path, csv, rows, with_force, .. } = self;
        csv.finish().with_context(|| path.display().to_string())?;
        Ok(format!("force: {rows} rows, {with_force} with a force: {}", path.display()))
    }
}

/// A text as a cell of the table.
fn quoted(text: String) -> String {
    if text.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_with_commas_and_quotes_is_one_cell() {
        assert_eq!(quoted("no zero".to_owned()), "no zero");
        assert_eq!(quoted("a \"b\", c".to_owned()), "\"a \"\"b\"\", c\"");
    }
}
