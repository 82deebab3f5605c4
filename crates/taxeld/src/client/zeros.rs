//! The zeros at which the ramps of a session began, as a table.

use std::path::Path;

use taxel_engine::calibration::export::{zero_rows, zeros_header};
use taxel_proto::v1::{RampZero, RestCount};

use super::failure::Outcome;
use crate::output;

/// Writes the zeros of the ramps where they are wanted.
pub fn write_zeros(to: Option<&Path>, ramps: &[RampZero]) -> Outcome {
    match to.filter(|_| !ramps.is_empty()) {
        Some(zeros) => Ok(output::write_text(zeros, &zeros_csv(ramps))?),
        None => Ok(()),
    }
}

fn zeros_csv(ramps: &[RampZero]) -> String {
    let rows = ramps.iter().map(|ramp| {
        let rest = |taxel: &RestCount| (taxel.mean_counts.unwrap_or(f64::NAN), taxel.noise_counts.unwrap_or(f64::NAN));
        zero_rows(
            ramp.ramp,
            usize::try_from(ramp.samples).unwrap_or(usize::MAX),
            ramp.taxels.iter().map(rest),
            ramp.gauge_kpa,
        )
    });
    zeros_header(ramps.first().map_or(0, |ramp| ramp.taxels.len())) + &rows.collect::<String>()
}
