//! The report as files: one self-contained page, and the data of every figure and table beside it.
//!
//! `index.html` has the figures within it and needs no other file. `ID.svg`, `ID.csv` and `ID.json` are one figure or
//! table each, `report.json` is everything. Each file is written beside its place and then renamed, the page last: what
//! is there is whole.

mod data;
mod html;

use crate::document::Section;
use crate::machine::Machine;
use crate::plot;
use anyhow::{Context as _, ensure};
use serde::Serialize;
use std::collections::HashSet;
use std::path::Path;

/// Everything that `report.json` holds.
#[derive(Serialize)]
struct Report<'a> {
    machine: &'a Machine,
    sections: &'a [Section],
}

/// Writes the page of `sections` and all that goes with it into `out`, which is made if it is not there.
///
/// # Errors
/// A file cannot be written. Or an id of a figure or table is not made of a-z, 0-9 and `-`, or is another's too: then it
/// has no files of its own, but everything else is there, also the page with it.
pub fn write(out: &Path, machine: &Machine, sections: &[Section]) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let put = |name: &str, bytes: &[u8]| put(out, name, bytes);
    let mut names = Names::default();
    for section in sections {
        for figure in section.figures.iter().filter(|figure| names.take(&figure.id)) {
            put(&format!("{}.svg", figure.id), plot::svg(figure).as_bytes())?;
            put(&format!("{}.csv", figure.id), &data::figure_csv(figure)?)?;
            put(&format!("{}.json", figure.id), &serde_json::to_vec_pretty(figure)?)?;
        }
        for table in section.tables.iter().filter(|table| names.take(&table.id)) {
            put(&format!("{}.csv", table.id), &data::table_csv(table)?)?;
            put(&format!("{}.json", table.id), &serde_json::to_vec_pretty(table)?)?;
        }
    }
    put("report.json", &serde_json::to_vec_pretty(&Report { machine, sections })?)?;
    put("index.html", html::page(machine, sections).as_bytes())?;
    let refused = names.refused.join(", ");
    ensure!(refused.is_empty(), "ids of figures or tables that are no file names, or used twice: {refused}");
    Ok(())
}

/// The names of files that are taken, and the ids that got none.
#[derive(Default)]
struct Names {
    taken: HashSet<String>,
    refused: Vec<String>,
}

impl Names {
    fn take(&mut self, id: &str) -> bool {
        let plain = !id.is_empty() && id.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-');
        let free = plain && !["report", "index"].contains(&id) && self.taken.insert(id.to_owned());
        if !free {
            self.refused.push(format!("`{id}`"));
        }
        free
    }
}

/// Writes a file beside its place and renames it, so that what is there is whole.
pub(crate) fn put(folder: &Path, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
    let (place, beside) = (folder.join(name), folder.join(format!(".{name}.part")));
    std::fs::write(&beside, bytes).with_context(|| format!("cannot write {}", beside.display()))?;
    std::fs::rename(&beside, &place).with_context(|| format!("cannot write {}", place.display()))
}
