//! The force of each scan of a replay, as a table that any other program reads.

use std::ffi::OsString;
use std::fs::File;
use std::io::{BufWriter, Write};
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
        let mut csv = csv::Writer::from_writer(beside.writer()?);
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
        self.beside.put().with_context(|| self.path.display().to_string())?;
        Ok(format!("force: {} rows, {} with a force: {}", self.rows, self.with_force, self.path.display()))
    }
}

/// Where a file is written until it is whole, under a name that no other file has; what is no ordinary file, such as a pipe,
/// is written at its place. A part that was not put there goes with this.
struct Beside {
    place: PathBuf,
    part: Option<PathBuf>,
}

impl Beside {
    fn of(path: &Path) -> Self {
        let ordinary = !files::is_standard(path) && std::fs::metadata(path).map_or(true, |found| found.is_file());
        // Through a link its target is replaced.
        let place = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let name = place.file_name().filter(|_| ordinary).map(|name| {
            let mut part = OsString::from(".");
            part.push(name);
            part.push(format!(".{}.part", std::process::id()));
            part
        });
        let part = name.map(|name| place.with_file_name(name));
        Self { place, part }
    }

    /// The file to write; none that is there already is touched.
    fn writer(&self) -> anyhow::Result<Box<dyn Write>> {
        let Some(part) = &self.part else { return files::writer(&self.place) };
        let file = File::create_new(part).with_context(|| part.display().to_string())?;
        Ok(Box::new(BufWriter::new(file)))
    }

    fn put(&mut self) -> std::io::Result<()> {
        self.part.take().map_or(Ok(()), |part| std::fs::rename(part, &self.place))
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        if let Some(part) = &self.part {
            let _ = std::fs::remove_file(part); // it is not whole, and nobody waits for it
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_whole_leaves_the_folder_as_it_was_and_what_is_takes_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::os::unix::fs::symlink(at("force.csv"), at("link.csv")).unwrap();
        for name in ["force.csv", "force.csv.new", "force.csv.part"] {
            std::fs::write(at(name), name).unwrap();
        }
        let names = || {
            let entries = std::fs::read_dir(folder.path()).unwrap();
            let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let before = names();
        let begun = |path: &str| {
            let beside = Beside::of(&at(path));
            beside.writer().unwrap().write_all(b"new").unwrap();
            beside
        };
        drop(begun("force.csv"));
        assert_eq!((names(), std::fs::read(at("force.csv")).unwrap()), (before.clone(), b"force.csv".to_vec()));
        begun("link.csv").put().unwrap();
        assert_eq!((names(), std::fs::read(at("force.csv")).unwrap()), (before, b"new".to_vec()));
        assert_eq!(std::fs::read(at("force.csv.new")).unwrap(), b"force.csv.new");
        assert!(std::fs::symlink_metadata(at("link.csv")).unwrap().is_symlink());
    }
}
