//! Section C, first part: the live path's arithmetic, error against run time over all counts.
//!
//! Convention of work-precision diagrams: the same task for every method, the knob swept along each line, a reference
//! far better than any contender. The second part, whole frames through the daemon, is `daemon`'s: its text, figures and
//! tables can be appended to this section.

mod forces;
pub(crate) mod measure;
mod methods;
pub mod skin;
mod sweep;
#[cfg(test)]
mod tests;
pub mod total;

use crate::document::Section;
use crate::options::Options;

/// Runs per contender: quick and full.
const REPETITIONS: [usize; 2] = [15, 61];

/// Section `c-live`: evaluation method against error, then evaluation and sum of the engine against its aim.
///
/// # Errors
/// None that a sound build can cause; a method that cannot be built for an order would be told.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let repetitions = REPETITIONS[usize::from(!options.quick)];
    let sweep = sweep::measure(options.seed, repetitions)?;
    let forces = forces::measure(options.seed, repetitions);
    let mut text = vec![
        "How long it takes to turn one scan of counts into pressures, and how far the pressures are off. Every method \
         gets one count a taxel and stores one f32 pressure; counts beyond the calibrated range are held at its ends. \
         The error is the largest over all 256 counts of every taxel against the curve in double-double arithmetic. \
         Times are medians of runs taken in turns in one thread, with the counts and tables as warm as they get; a \
         daemon that wakes for one scan starts colder."
            .to_owned(),
        features(),
    ];
    text.extend(sweep.sentences());
    text.extend(forces.sentences());
    let mut tables = vec![sweep.table()];
    tables.extend(forces.tables());
    Ok(Section {
        id: "c-live".to_owned(),
        title: "C. Live: counts to pressures".to_owned(),
        text,
        figures: sweep.figures(),
        tables,
    })
}

/// What this build lets the compiler vectorise with: it decides between tables and polynomials.
fn features() -> String {
    let width = match () {
        () if cfg!(target_feature = "avx512f") => "AVX-512, sixteen f32 at a time",
        () if cfg!(target_feature = "avx2") => "AVX2, eight f32 at a time",
        () if cfg!(target_feature = "sse2") => "SSE2, four f32 at a time, which every 64-bit PC has",
        () if cfg!(target_feature = "neon") => "NEON, four f32 at a time",
        () => "no vector instructions that are named here",
    };
    format!("This build is for {} with {width}.", std::env::consts::ARCH)
}
