//! How a known load looks in a row: JSON, every figure as it was.

use serde::{Deserialize, Serialize};
use taxel_engine::loads::{Load, Reading};

/// A [`Load`] by the names that the file uses.
#[derive(Serialize, Deserialize)]
struct StoredLoad {
    number: u64,
    patch: String,
    wall_ns: i64,
    by: String,
    note: String,
    mass_kg: Option<f64>,
    force_n: f64,
    force_sigma_n: f64,
    replaces: Option<u64>,
    scans: u32,
    mean_n: f64,
    scatter_n: f64,
    sigma_n: f64,
    out_of_range: u32,
    uncovered_share: f64,
    reasons: Vec<String>,
    /// Not in rows of earlier versions.
    #[serde(default)]
    taxels: Vec<u16>,
    #[serde(default)]
    filled_share: f64,
    model_set: String,
    mean_area_mm2: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    filled: Option<bool>,
    area_factor: f64,
    area_uncertainty: f64,
}

/// The load as JSON. A figure that is not finite becomes null, which is refused when read.
pub(crate) fn load_to_text(load: &Load) -> Result<String, serde_json::Error> {
    let Load { read, .. } = load;
    serde_json::to_string(&StoredLoad {
        number: load.number,
        patch: load.patch.clone(),
        wall_ns: load.wall_ns,
        by: load.by.clone(),
        note: load.note.clone(),
        mass_kg: load.mass_kg,
        force_n: load.force_n,
        force_sigma_n: load.force_sigma_n,
        replaces: load.replaces,
        scans: read.scans,
        mean_n: read.mean_n,
        scatter_n: read.scatter_n,
        sigma_n: read.sigma_n,
        out_of_range: read.out_of_range,
        uncovered_share: read.uncovered_share,
        reasons: read.reasons.clone(),
        taxels: read.taxels.clone(),
        filled_share: read.filled_share,
        model_set: load.model_set.clone(),
        mean_area_mm2: load.mean_area_mm2,
        filled: load.filled,
        area_factor: load.area_factor,
        area_uncertainty: load.area_uncertainty,
    })
}

/// The inverse of [`load_to_text`].
pub(crate) fn load_from_text(text: &str) -> Result<Load, serde_json::Error> {
    let stored: StoredLoad = serde_json::from_str(text)?;
    Ok(Load {
        number: stored.number,
        patch: stored.patch,
        wall_ns: stored.wall_ns,
        by: stored.by,
        note: stored.note,
        mass_kg: stored.mass_kg,
        force_n: stored.force_n,
        force_sigma_n: stored.force_sigma_n,
        replaces: stored.replaces,
        read: Reading {
            scans: stored.scans,
            mean_n: stored.mean_n,
            scatter_n: stored.scatter_n,
            sigma_n: stored.sigma_n,
            out_of_range: stored.out_of_range,
            uncovered_share: stored.uncovered_share,
            reasons: stored.reasons,
            taxels: stored.taxels,
            filled_share: stored.filled_share,
        },
        model_set: stored.model_set,
        mean_area_mm2: stored.mean_area_mm2,
        filled: stored.filled,
        area_factor: stored.area_factor,
        area_uncertainty: stored.area_uncertainty,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_load_comes_back_as_it_went(
            (patch, by, note, reason) in (".*", ".*", ".*", ".*"),
            (number, wall_ns, scans, replaces) in (any::<u64>(), any::<i64>(), any::<u32>(), any::<Option<u64>>()),
            figures in proptest::array::uniform9(-1e9_f64..1e9),
        ) {
            let [kg, force_n, force_sigma_n, mean_n, scatter_n, sigma_n, mean_area_mm2, area_factor, share] = figures;
            let read = Reading {
                scans, mean_n, scatter_n, sigma_n, out_of_range: scans, uncovered_share: share, reasons: vec![reason],
                taxels: vec![0, scans as u16], filled_share: share,
            };
            let mass_kg = (kg > 0.0).then_some(kg);
            let load = Load {
                number, patch, wall_ns, by, note, mass_kg, force_n, force_sigma_n, replaces, read,
                model_set: "m-1".to_owned(), mean_area_mm2, area_factor, area_uncertainty: share,
                filled: [None, Some(false), Some(true)][scans as usize % 3],
            };
            prop_assert_eq!(load_from_text(&load_to_text(&load).unwrap()).unwrap(), load);
        }
    }
}
