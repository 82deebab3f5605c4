//! The raw data as they are exported, and their hashes.

use sha2::{Digest, Sha256};
use taxel_engine::calibration::SessionSamples;
use taxel_engine::calibration::export::{sample_row, samples_header, zero_rows, zeros_header};

/// The hash of a text in hexadecimal digits.
pub(crate) fn sha256(text: &str) -> String {
    digits(Sha256::digest(text.as_bytes()).as_slice())
}

/// The hash of the samples as `taxeld sessions export --out` writes them.
pub(crate) fn samples_sha256(samples: &SessionSamples) -> String {
    let taxels = samples.samples.first().map_or(0, |sample| sample.counts.counts().len());
    let first_ns = samples.samples.first().map_or(0, |sample| sample.time_ns);
    let mut hash = Sha256::new();
    hash.update(samples_header(taxels));
    for sample in &samples.samples {
        let counts = sample.counts.counts();
        let raw = (0..taxels).filter_map(|taxel| counts.raw(taxel)).map(u32::from);
        hash.update(sample_row(sample.time_ns.saturating_sub(first_ns), sample.pressure_kpa, raw));
    }
    digits(hash.finalize().as_slice())
}

/// The zeros as `taxeld sessions export --zeros` writes them.
pub(crate) fn zeros_csv(samples: &SessionSamples) -> String {
    let mut text = zeros_header(samples.ramps.first().map_or(0, |ramp| ramp.taxels.len()));
    for ramp in &samples.ramps {
        let scans = samples.samples.iter().filter(|sample| sample.ramp == ramp.ramp).count();
        let zero = ramp.taxels.iter().map(|taxel| (taxel.mean, taxel.noise));
        text += &zero_rows(u32::from(ramp.ramp) + 1, scans, zero, ramp.gauge_kpa);
    }
    text
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
