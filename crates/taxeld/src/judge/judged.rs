//! A recording with its gauge.

use std::path::Path;

use anyhow::Context;

use crate::fit::scans_of;
use crate::recording::Recording;
use crate::soundness::{Wanted, check};

/// A recording that is judged by its own gauge.
pub struct Judged<'a> {
    /// Where it is.
    pub path: &'a Path,
    /// What it holds.
    pub recording: Recording,
    /// Its gauge, scan by scan.
    pub gauge_kpa: Vec<f64>,
}

impl<'a> Judged<'a> {
    /// Reads it.
    ///
    /// # Errors
    /// A file that cannot be read, or without a pressure.
    pub fn read(path: &'a Path) -> anyhow::Result<Self> {
        let mut recording = Recording::read(path)?;
        recording.report_refused(path);
        let named = || path.display().to_string();
        check(&mut recording, Wanted::JUDGE).with_context(named)?;
        let gauge = scans_of(&recording).pressure_kpa.map(<[f64]>::to_vec);
        let gauge_kpa = gauge.context("there is no column `pressure_kpa` to judge by").with_context(named)?;
        Ok(Self { path, recording, gauge_kpa })
    }
}
