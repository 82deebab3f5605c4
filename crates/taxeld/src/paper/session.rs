//! What a session gathered, as data for the figures.

use std::path::Path;

use anyhow::Context;
use taxel_engine::calibration::SessionSamples;
use taxel_report::paper::Data;

/// A session's samples as scans, run after run.
///
/// # Errors
/// A session without a sample.
pub(super) fn of_session(source: String, samples: &SessionSamples) -> anyhow::Result<Data> {
    let first = samples.samples.first().context("the session has no sample")?;
    let kpa = samples.pressures_kpa();
    let count = |taxel: usize| {
        samples.samples.iter().map(|sample| sample.counts.counts().units(taxel).unwrap_or(f64::NAN)).collect()
    };
    Ok(Data::of_scans(source, kpa, (0..first.counts.counts().len()).map(count).collect()))
}

/// A file's name without its folder.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
