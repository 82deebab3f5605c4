//! The raw data as they are exported, and their hashes.

use sha2::{Digest, Sha256};
use taxel_engine::calibration::SessionSamples;
use taxel_engine::calibration::export::{About, sample_row, table_head};

/// The hash of a text in hexadecimal digits.
pub(crate) fn sha256(text: &str) -> String {
    digits(Sha256::digest(text.as_bytes()).as_slice())
}

/// The hash of the samples as `taxeld sessions export --out` writes them.
pub(crate) fn samples_sha256(about: &About, samples: &SessionSamples) -> String {
    let taxels = samples.samples.first().map_or(0, |sample| sample.counts.counts().len());
    let first_ns = samples.samples.first().map_or(0, |sample| sample.time_ns);
    let mut hash = Sha256::new();
    hash.update(table_head(about, samples));
    for sample in &samples.samples {
        let counts = sample.counts.counts();
        let raw = (0..taxels).filter_map(|taxel| counts.raw(taxel)).map(u32::from);
        let since_first_ns = sample.time_ns.saturating_sub(first_ns);
        hash.update(sample_row(since_first_ns, sample.pressure_kpa, raw, u32::from(sample.ramp) + 1));
    }
    digits(hash.finalize().as_slice())
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
