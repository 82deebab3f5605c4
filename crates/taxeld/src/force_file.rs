//! The force of each scan of a replay, as a table that any other program reads.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{ForceState, PatchSnapshot};

use crate::files;

/// A CSV file with one row for each snapshot of each patch.
///
/// Columns: `time_s` of the log (later where its clock stepped back before), `patch`, `state` (as in the service, without its prefix), `total_n`, `sigma_n`
/// (standard uncertainty), `detection_floor_n`, `lower_bound` (0 or 1), `active`, `out_of_range`, `excluded`, `stale`
/// (taxels), and `reasons`, separated by semicolons. Without a force the newtons are empty.
///
/// It is written beside its place and put there when it is whole, so that a replay that comes to nothing leaves what was there.
pub struct ForceFile {
    path: PathBuf,
    beside: Beside,
    patches: Vec<String>,
    csv: csv::Writer<Box<dyn Write>>,
    rows: u64,
    with_force: u64,
}

impl ForceFile {
    /// An empty table.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn create(path: &Path, plan: &Plan) -> anyhow::Result<Self> {
        let beside = Beside::of(path);
        let mut csv = csv::Writer::from_writer(files::writer(beside.0.as_deref().unwrap_or(path))?);
        csv.write_record([
            "time_s",
            "patch",
            "state",
            "total_n",
            "sigma_n",
            "detection_floor_n",
            "lower_bound",
            "active",
            "out_of_range",
            "excluded",
            "stale",
            "reasons",
        ])?;
        let patches = plan.patches.iter().map(|patch| patch.patch.name().to_owned()).collect();
        Ok(Self { path: path.to_owned(), beside, patches, csv, rows: 0, with_force: 0 })
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
            self.csv.write_record([
                format!("{}.{:09}", time_ns.div_euclid(1_000_000_000), time_ns.rem_euclid(1_000_000_000)),
                self.patches[patch].clone(),
                state_name(force.state).to_owned(),
                newton(force.total),
                newton(force.total_sigma),
                newton(force.detection_floor),
                u8::from(force.lower_bound).to_string(),
                force.active.to_string(),
                force.out_of_range.to_string(),
                force.excluded.to_string(),
                force.stale.to_string(),
                force.why(),
            ])?;
            self.rows += 1;
            self.with_force += u64::from(force.total.is_some());
        }
        Ok(())
    }

    /// Writes what is left; says what the file holds.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(mut self) -> anyhow::Result<String> {
        self.csv.flush().with_context(|| self.path.display().to_string())?;
        self.beside.put(&self.path).with_context(|| self.path.display().to_string())?;
        Ok(format!("force: {} rows, {} with a force: {}", self.rows, self.with_force, self.path.display()))
    }
}

/// Where a file is written until it is whole; nowhere else for what is no ordinary file, such as a pipe. It goes with this.
struct Beside(Option<PathBuf>);

impl Beside {
    fn of(path: &Path) -> Self {
        let ordinary = !files::is_standard(path) && std::fs::metadata(path).map_or(true, |found| found.is_file());
        // Through a link its target is replaced.
        let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let name = path.file_name().filter(|_| ordinary).map(|name| {
            let mut name = name.to_owned();
            name.push(".new");
            name
        });
        Self(name.map(|name| path.with_file_name(name)))
    }

    fn put(&mut self, path: &Path) -> std::io::Result<()> {
        let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        self.0.take().map_or(Ok(()), |written| std::fs::rename(written, path))
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        if let Some(written) = &self.0 {
            let _ = std::fs::remove_file(written); // it is not whole, and nobody waits for it
        }
    }
}

const fn state_name(state: ForceState) -> &'static str {
    match state {
        ForceState::Ok => "OK",
        ForceState::Degraded => "DEGRADED",
        ForceState::Stale => "STALE",
        ForceState::TareInvalid => "TARE_INVALID",
        ForceState::Uncalibrated => "UNCALIBRATED",
    }
}
