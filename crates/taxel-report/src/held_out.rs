//! Section B: how long to calibrate, with which estimator and which order, judged on data that no fit saw.

mod insole;
mod simulated;

use crate::document::Section;
use crate::options::Options;

/// Section `b-held-out`: calibration length against held-out error, on simulated forearms and, where they are there, on
/// recordings.
///
/// # Errors
/// A simulation that cannot be set up, or a recording that is there and cannot be read.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let simulated = simulated::measure(options.seed, options.quick)?;
    let insole =
        options.data.as_deref().map(|data| insole::measure(&data.join("insole"), options.quick)).transpose()?;
    let mut text = vec![
        "How far pressures and forces are off on data that no fit saw, by the length of the calibration. The skin in the \
         bag is the simulator's, whose physics shares nothing with what is fitted: friction, creep, drift of \
         temperature, noise and rounding are in it. Every calibration of a skin starts from the same rest, and all are \
         judged on the same later ramp and the same weighings, each with a zero of its own before it."
            .to_owned(),
    ];
    text.extend(simulated.sentences());
    let (mut figures, mut tables) = (simulated.figures(), vec![simulated.table()]);
    match insole.flatten() {
        Some(insole) => {
            text.extend(insole.sentences());
            figures.push(insole.figure());
            tables.push(insole.table());
        }
        None => text.push("Recordings of a real skin are not there and are left out.".to_owned()),
    }
    Ok(Section {
        id: "b-held-out".to_owned(),
        title: "B. Model: calibration length and held-out error".to_owned(),
        text,
        figures,
        tables,
        ..Section::default()
    })
}
