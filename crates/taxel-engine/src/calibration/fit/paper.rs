//! The paper's fit: its equation over all samples of rising pressure, as they are. No fault is looked for, nothing is averaged,
//! shifted in time or compensated.

use taxel_model::{FitOptions, Samples, TaxelModel, Workers, map};

use crate::calibration::fit::scans::Scans;

/// How it fits, in words.
pub(super) fn method(options: &FitOptions) -> String {
    format!("order {}, paper", options.order)
}

/// One model per taxel.
pub(super) fn models(scans: &Scans<'_>, kpa: &[f64], options: &FitOptions, workers: &dyn Workers) -> Vec<TaxelModel> {
    map(workers, scans.counts.len(), |taxel| {
        let all = scans.counts[taxel].iter().zip(kpa).filter(|(count, kpa)| count.is_finite() && kpa.is_finite());
        let (counts, kpa): (Vec<f64>, Vec<f64>) = all.unzip();
        taxel_model::fit(&Samples::new(&counts, &kpa), options)
    })
}
