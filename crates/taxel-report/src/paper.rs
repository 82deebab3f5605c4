//! Every figure and table of the paper that given data can draw: `taxeld paper`.
//!
//! J. Kangro, S. Traversaro, D. Pucci, F. Nori, "Skin Normal Force Calibration Using Vacuum Bags". The data are scans
//! of a skin under a rising and falling pressure and, where there are any, known loads: from the simulator
//! ([`simulate`]), or from wherever the caller has them ([`Data`]).

mod data;
mod figures;
mod page;
mod simulate;
mod statistics;
mod table;

use std::path::Path;

use anyhow::Context as _;

pub use data::{Data, Weighing, Weighings};
pub use figures::LeftOut;
pub use simulate::simulate;
pub use table::{Calibration, ErrorRow, Errors, Tables};

use crate::draw;
use crate::page::put;

/// Draws `data` into the folder `out`, which is made if it is not there: a picture for each figure (`raw.svg`, ...),
/// `table.md`, `table.json` and, last, `index.html` with all of it. Taxels of less swing than `min_swing_counts` are
/// excluded.
///
/// # Errors
/// A file that cannot be written. What the data cannot draw is no error: [`Tables::left_out`] says why.
pub fn write(out: &Path, data: &Data, min_swing_counts: f64) -> anyhow::Result<Tables> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let models = data.models(min_swing_counts);
    let (figures, left_out) = figures::Figures::new(data, &models, min_swing_counts).all();
    let tables = Tables::new(data, &models, min_swing_counts, left_out);
    for figure in &figures {
        put(out, &format!("{}.svg", figure.id), draw::svg(figure).as_bytes())?;
    }
    put(out, "table.md", tables.markdown().as_bytes())?;
    put(out, "table.json", &serde_json::to_vec_pretty(&tables)?)?;
    put(out, "index.html", page::page(&figures, &tables).into_string().as_bytes())?;
    Ok(tables)
}

#[cfg(test)]
mod tests;
