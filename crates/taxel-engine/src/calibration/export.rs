//! The samples of a session as a table, the same wherever it is written and wherever its hash is made.
//!
//! `t_s,pressure_kpa,c0,c1,...,ramp,figure`: a row a scan, of which `figure` is empty, after rows of figures, which have no time.
//! These are what a fit needs beside the scans, so that a fit of the table is that of the session: counts of different ramps
//! compare by their distance from the zeros at which these began, and pressures by that from what the gauge read then.
//!
//! | figure | `pressure_kpa` | `c0`, `c1`, ... |
//! |---|---|---|
//! | `patch NAME` | | nothing: the patch it is of |
//! | `rising` or `both` | | nothing: that the session gathered rising pressure, or the fall after it too |
//! | `simulated` | | nothing: that a simulator or a replayed log sent the scans |
//! | `module` | | number of the taxel's module, from 0; empty if the session was without it |
//! | `count_max` | | greatest raw count of the taxel's converter |
//! | `gauge_gain` | relative standard uncertainty of the gauge's gain | |
//! | `gauge_offset` | standard uncertainty of its offset, kPa | |
//! | `gauge_noise` | its noise, kPa | |
//! | `zero` | what the gauge read at the ramp's zero, kPa | mean count at rest, in units |
//! | `noise` | | standard deviation at rest, in units |

use std::fmt::Write;

use taxel_model::GaugeUncertainty;

use crate::calibration::branch::Branch;
use crate::calibration::samples::{RampBaseline, SessionSamples};
use crate::calibration::view::SessionView;
use crate::plan::PatchPlan;

/// The columns after the counts.
pub const LAST_COLUMNS: [&str; 2] = ["ramp", "figure"];

/// What the table of a session of this patch begins with: its header, and the rows of figures.
#[must_use]
pub fn table_head(plan: &PatchPlan, session: &SessionView, samples: &SessionSamples) -> String {
    let of_samples = samples.samples.first().map(|sample| sample.counts.counts().len());
    let taxels = of_samples.or_else(|| samples.ramps.first().map(|ramp| ramp.taxels.len())).unwrap_or_default();
    let names: String = (0..taxels).map(|taxel| format!(",c{taxel}")).collect();
    let mut head = format!("t_s,pressure_kpa{names},{}\n", LAST_COLUMNS.join(","));
    let mut row = |kpa: Option<f64>, cells: &dyn Fn(usize) -> Option<f64>, ramp: &str, figure: &str| {
        let cell = |value: Option<f64>| value.filter(|v| v.is_finite()).map_or_else(String::new, |v| v.to_string());
        let cells: String = (0..taxels).map(|taxel| format!(",{}", cell(cells(taxel)))).collect();
        let _ = writeln!(head, ",{}{cells},{ramp},{figure}", cell(kpa)); // writing to a string cannot fail
    };
    row(None, &|_| None, "", &format!("patch {}", plan.patch.name()));
    row(None, &|_| None, "", if session.branches == Branch::Both { "both" } else { "rising" });
    if plan.simulated {
        row(None, &|_| None, "", "simulated");
    }
    // Modules of another layout of the patch say nothing of these samples.
    if plan.patch.taxels().len() == taxels {
        let module = |taxel: usize| {
            let module = plan.patch.taxels().get(taxel)?.module;
            (!session.left_out.contains(&module)).then_some(f64::from(module))
        };
        row(None, &module, "", "module");
    }
    row(None, &|_| Some(f64::from(plan.patch.counts().top())), "", "count_max");
    let GaugeUncertainty { gain_rel, offset_kpa, noise_kpa } = plan.fit.gauge;
    for (value, figure) in [(gain_rel, "gauge_gain"), (offset_kpa, "gauge_offset"), (noise_kpa, "gauge_noise")] {
        row(Some(value), &|_| None, "", figure);
    }
    for RampBaseline { ramp, taxels, gauge_kpa } in &samples.ramps {
        let ramp = (u32::from(*ramp) + 1).to_string();
        row(*gauge_kpa, &|taxel| taxels.get(taxel).map(|rest| rest.mean), &ramp, "zero");
        row(None, &|taxel| taxels.get(taxel).map(|rest| rest.noise), &ramp, "noise");
    }
    head
}

/// One scan: seconds since the first one, kPa, a raw count per taxel, and its ramp from 1.
#[must_use]
pub fn sample_row(since_first_ns: i64, pressure_kpa: f64, counts: impl Iterator<Item = u32>, ramp: u32) -> String {
    let mut row = format!("{:.9},{pressure_kpa}", since_first_ns as f64 * 1e-9);
    for count in counts {
        let _ = write!(row, ",{count}");
    }
    let _ = writeln!(row, ",{ramp},");
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline::TaxelBaseline;
    use crate::calibration::samples::Sample;
    use taxel_skin::ModuleKind;

    #[test]
    fn a_table_has_what_a_fit_needs_to_the_last_bit_and_leaves_unknown_cells_empty() {
        let rest = TaxelBaseline { mean: 240.25, noise: 0.5 };
        let ramp = |ramp, gauge_kpa| RampBaseline { ramp, taxels: vec![rest, TaxelBaseline::UNKNOWN], gauge_kpa };
        let sample = Sample { ramp: 0, time_ns: 0, pressure_kpa: 0.0, counts: vec![240, 7].into() };
        let samples = SessionSamples { ramps: vec![ramp(0, Some(5.75)), ramp(1, None)], samples: vec![sample] };
        let mut plan = PatchPlan::new(crate::tests::patch(&[ModuleKind::Cells(1); 2]));
        plan.simulated = true;
        plan.fit.gauge = GaugeUncertainty { gain_rel: 0.0025, offset_kpa: 0.05, noise_kpa: 0.0 };
        let session = SessionView { left_out: vec![1], ..SessionView::default() };
        assert_eq!(
            table_head(&plan, &session, &samples),
            "t_s,pressure_kpa,c0,c1,ramp,figure\n,,,,,patch p\n,,,,,rising\n,,,,,simulated\n,,0,,,module\n,,255,255,,count_max\n,0.0025,,,,gauge_gain\n\
             ,0.05,,,,gauge_offset\n,0,,,,gauge_noise\n,5.75,240.25,,1,zero\n,,0.5,,1,noise\n,,240.25,,2,zero\n\
             ,,0.5,,2,noise\n"
        );
        let row = sample_row(1_500_000_000, 0.1 + 0.2, [240, 7].into_iter(), 2);
        assert_eq!(row, "1.500000000,0.30000000000000004,240,7,2,\n");
    }
}
