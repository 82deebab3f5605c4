//! Section `scenes`: what each output of a patch costs, by the time from the counts of a scan to the force.

use std::sync::Arc;

use taxel_engine::calibration::fit::{FitRecipe, OneByOne, fit};
use taxel_engine::plan::Outputs;

use super::args::ReportArgs;
use crate::document::{Aim, Section, Table, row};
use crate::forearm::Tried;

/// Of the forearm with every output.
const SCAN_AIM_US: f64 = 6.0;

/// Measures every output by itself, and all of them.
///
/// # Errors
/// A simulation that cannot be set up, which it can.
pub(super) fn section(args: &ReportArgs) -> anyhow::Result<Section> {
    let tried = Tried::new(&[], args.seed, 1, 0)?;
    let set = Arc::new(fit(&tried.calibration.as_scans(), &FitRecipe::default(), &OneByOne)?);
    let none = Outputs::default();
    let all = Outputs { resultant: true, moment: true, contacts: true, fill: true, place: true };
    let scenes = [
        ("the total force alone", none),
        ("the total force by the places of contacts (shipped default)", Outputs { place: true, ..none }),
        ("resultant", Outputs { resultant: true, ..none }),
        ("moment and centre of pressure", Outputs { moment: true, ..none }),
        ("contacts", Outputs { contacts: true, ..none }),
        ("fill of excluded taxels", Outputs { fill: true, ..none }),
        ("everything", all),
    ];
    let times = scenes.map(|(what, outputs)| (what, tried.scan_us(Arc::clone(&set), outputs)));
    let (lean_us, full_us) = (times[0].1, times[times.len() - 1].1);
    let rows = times.iter().map(|(what, us)| row![*what, *us, us / lean_us]).collect();
    Ok(Section {
        text: vec![
            "Outputs that a patch does not ask for are not computed. Ten full buses are measured by the example scan_time of \
             taxel-engine."
                .to_owned(),
        ],
        aims: vec![Aim::at_most("from the counts of a scan to the force with every output, us", full_us, SCAN_AIM_US)],
        tables: vec![Table::new(
            "scenes-costs",
            "The same scans of known masses, in one thread of the engine's own code.",
            ["outputs", "scan, us", "by the total alone"],
            rows,
        )],
        ..Section::default()
    })
}
