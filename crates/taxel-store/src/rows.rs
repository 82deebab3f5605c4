//! How records look in a row: blobs, checksums, and the text of a session's view.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{Direction, RefusalCounts, SampleRefusal, SessionState, SessionView};
use taxel_engine::counts::{Counts, SharedCounts};
use taxel_engine::record::{RampBaseline, Sample};
use taxel_skin::CountRange;

/// Bytes of a row's checksum: enough against chance, small beside a sample of 230 counts.
const CHECKSUM_BYTES: usize = 8;

/// The first bytes of the SHA-256 of the parts, each preceded by its length so that bytes cannot move between them.
fn checksum(parts: &[&[u8]]) -> Vec<u8> {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hash.finalize()[..CHECKSUM_BYTES].to_vec()
}

/// SHA-256 of the bytes of a model set's file.
pub(crate) fn sha256_of(bytes: &[u8]) -> Vec<u8> {
    Sha256::digest(bytes).to_vec()
}

/// Checksum of a session's row.
pub(crate) fn view_checksum(session: u64, view: &str) -> Vec<u8> {
    checksum(&[&session.to_le_bytes(), view.as_bytes()])
}

/// Counts as they lie in a row: a byte each up to eight bits; of a finer converter its greatest count and then each
/// count, 16 bits each, little-endian. The checksum tells the two apart.
pub(crate) fn counts_to_blob(counts: Counts<'_>) -> Cow<'_, [u8]> {
    match counts {
        Counts::Bytes(bytes) => Cow::Borrowed(bytes),
        Counts::Words(words, range) => {
            Cow::Owned(std::iter::once(&range.top()).chain(words).flat_map(|word| word.to_le_bytes()).collect())
        }
    }
}

/// Counts of more than eight bits; `None` if the blob holds none.
pub(crate) fn wide_counts(blob: &[u8]) -> Option<SharedCounts> {
    let words: Vec<u16> = blob.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    let (top, words) = words.split_first()?;
    let range = CountRange::to(*top).filter(|range| !range.is_byte() && blob.len().is_multiple_of(2))?;
    words.iter().all(|word| word <= top).then(|| SharedCounts::Words(words.into(), range))
}

/// A sample with the counts of a row, if the row's checksum is its.
pub(crate) fn with_counts(session: u64, index: u64, sample: Sample, blob: Vec<u8>, found: &[u8]) -> Option<Sample> {
    let wide = wide_counts(&blob);
    [Some(SharedCounts::from(blob)), wide].into_iter().flatten().find_map(|counts| {
        let sample = Sample { counts, ..sample.clone() };
        (sample_checksum(session, index, &sample) == found).then_some(sample)
    })
}

/// Checksum of a sample's row.
pub(crate) fn sample_checksum(session: u64, index: u64, sample: &Sample) -> Vec<u8> {
    let (session, index) = (session.to_le_bytes(), index.to_le_bytes());
    let (ramp, time_ns) = (sample.ramp.to_le_bytes(), sample.time_ns.to_le_bytes());
    // Adding zero turns -0 into 0: SQLite does not keep the difference.
    let pressure_kpa = (sample.pressure_kpa + 0.0).to_le_bytes();
    let counts = counts_to_blob(sample.counts.counts());
    let parts: [&[u8]; 6] = [&session, &index, &ramp, &time_ns, &pressure_kpa, &counts];
    match sample.counts.counts() {
        Counts::Bytes(_) => checksum(&parts),
        Counts::Words(..) => checksum(&[b"wide".as_slice()].into_iter().chain(parts).collect::<Vec<_>>()),
    }
}

/// Checksum of a ramp's row.
pub(crate) fn ramp_checksum(session: u64, ramp: u16, baseline: &[u8]) -> Vec<u8> {
    checksum(&[&session.to_le_bytes(), &ramp.to_le_bytes(), baseline])
}

/// Checksum of an activation's row.
pub(crate) fn activation_checksum(seq: u64, patch: &str, model_set: &str, wall_ns: i64) -> Vec<u8> {
    checksum(&[&seq.to_le_bytes(), patch.as_bytes(), model_set.as_bytes(), &wall_ns.to_le_bytes()])
}

/// Checksum of a set in the file of active ones.
pub(crate) fn active_checksum(activation: u64, id: &str, text: &[u8]) -> Vec<u8> {
    checksum(&[b"active", &activation.to_le_bytes(), id.as_bytes(), text])
}

/// Checksum of the index row of a model set, `sha256` being that of the set's text.
pub(crate) fn index_checksum(seq: u64, sha256: &[u8], entry: &str) -> Vec<u8> {
    checksum(&[b"set index", &seq.to_le_bytes(), sha256, entry.as_bytes()])
}

/// Checksum of a known load's row.
pub(crate) fn load_checksum(number: u64, load: &str) -> Vec<u8> {
    checksum(&[b"load", &number.to_le_bytes(), load.as_bytes()])
}

/// Checksum of the row that stands for a deleted session.
pub(crate) fn deleted_session_checksum(session: u64, wall_ns: i64) -> Vec<u8> {
    checksum(&[b"deleted session", &session.to_le_bytes(), &wall_ns.to_le_bytes()])
}

/// Checksum of the row that stands for a deleted model set.
pub(crate) fn deleted_set_checksum(seq: u64, id: &str, activation: u64, wall_ns: i64) -> Vec<u8> {
    let numbers = [seq.to_le_bytes(), activation.to_le_bytes(), wall_ns.to_le_bytes()];
    checksum(&[b"deleted model set", numbers.as_flattened(), id.as_bytes()])
}

/// Checksum of a row of what is known of the zeros of a patch's boards, `blobs` being the counts that they hide and those that
/// the taxels read then.
pub(crate) fn board_zeros_checksum(
    seq: u64,
    patch: &str,
    why: &str,
    wall_ns: i64,
    blobs: Option<&[Vec<u8>; 2]>,
) -> Vec<u8> {
    let (seq, wall_ns) = (seq.to_le_bytes(), wall_ns.to_le_bytes());
    let before_version_8: [&[u8]; 5] = [b"zero doubt", &seq, patch.as_bytes(), why.as_bytes(), &wall_ns];
    let blobs = blobs.into_iter().flatten().map(Vec::as_slice);
    checksum(&before_version_8.into_iter().chain(blobs).collect::<Vec<_>>())
}

/// Little-endian f32, 4 bytes a taxel; NaN is kept.
pub(crate) fn f32_to_blob(counts: &[f32]) -> Vec<u8> {
    counts.iter().flat_map(|counts| counts.to_le_bytes()).collect()
}

/// The inverse of [`f32_to_blob`]; `None` if the length is not a multiple of 4.
pub(crate) fn f32_from_blob(blob: &[u8]) -> Option<Vec<f32>> {
    let (counts, odd) = blob.as_chunks::<4>();
    odd.is_empty().then(|| counts.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
}

/// Checksum of a row of the audit log, `table` being that of requests or that of results.
pub(crate) fn audit_checksum(table: &str, seq: u64, entry: &str) -> Vec<u8> {
    checksum(&[table.as_bytes(), &seq.to_le_bytes(), entry.as_bytes()])
}

/// Checksum of the number of rows of a stream.
pub(crate) fn tally_checksum(stream: &str, rows: u64) -> Vec<u8> {
    checksum(&[stream.as_bytes(), &rows.to_le_bytes()])
}

/// Mean and noise of each taxel as little-endian f64, 16 bytes a taxel; NaN is kept.
pub(crate) fn baseline_to_blob(baseline: &[TaxelBaseline]) -> Vec<u8> {
    baseline.iter().flat_map(|taxel| [taxel.mean.to_le_bytes(), taxel.noise.to_le_bytes()]).flatten().collect()
}

/// Ramps -> bytes: the zero of the taxels, and behind it what the gauge read, if that is known, 8 bytes.
pub(crate) fn ramp_to_blob(ramp: &RampBaseline) -> Vec<u8> {
    let mut blob = baseline_to_blob(&ramp.taxels);
    blob.extend(ramp.gauge_kpa.into_iter().flat_map(f64::to_le_bytes));
    blob
}

/// The inverse of [`ramp_to_blob`]; `None` if the length is not a multiple of 8.
pub(crate) fn ramp_from_blob(ramp: u16, blob: &[u8]) -> Option<RampBaseline> {
    let (taxels, gauge) = blob.split_at(blob.len() / 16 * 16);
    let gauge_kpa = if gauge.is_empty() { None } else { Some(f64::from_le_bytes(gauge.try_into().ok()?)) };
    Some(RampBaseline { ramp, taxels: baseline_from_blob(taxels)?, gauge_kpa })
}

/// The inverse of [`baseline_to_blob`]; `None` if the length is not a multiple of 16.
pub(crate) fn baseline_from_blob(blob: &[u8]) -> Option<Vec<TaxelBaseline>> {
    let (numbers, rest) = blob.as_chunks::<8>();
    let (taxels, odd) = numbers.as_chunks::<2>();
    (rest.is_empty() && odd.is_empty()).then(|| {
        let number = |bytes: [u8; 8]| f64::from_le_bytes(bytes);
        taxels.iter().map(|&[mean, noise]| TaxelBaseline { mean: number(mean), noise: number(noise) }).collect()
    })
}

/// What is kept of a [`SessionView`]: all but the readings of the moment.
#[derive(Serialize, Deserialize)]
struct StoredView {
    number: u64,
    patch: String,
    state: String,
    reason: String,
    started_wall_ns: i64,
    changed_wall_ns: i64,
    confirmed_by: Option<String>,
    target_kpa: Option<f64>,
    /// Absent in views of earlier versions, which knew the rising branch alone.
    #[serde(default)]
    both_branches: bool,
    #[serde(default)]
    falling: bool,
    ramps: u16,
    accepted: u64,
    refused: Vec<(String, u64)>,
    coverage: Option<f64>,
    responding: (u32, u32),
    model_set: Option<String>,
    /// Absent in views of earlier versions, which needed every module.
    #[serde(default)]
    left_out: Vec<u16>,
    /// Absent in views of earlier versions, and of a session that goes on from none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    predecessor: Option<u64>,
    /// Absent in views of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    board_settings: Vec<String>,
    /// Absent in views of earlier versions, and where pressures came with the scans.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    gauge: String,
    /// Absent in views of earlier versions, and where nothing is known against what it gathered.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    untrusted: String,
}

/// The view as JSON.
pub(crate) fn view_to_text(view: &SessionView) -> Result<String, serde_json::Error> {
    serde_json::to_string(&StoredView {
        number: view.number,
        patch: view.patch.clone(),
        state: view.state.name().to_owned(),
        reason: view.reason.clone(),
        started_wall_ns: view.started_wall_ns,
        changed_wall_ns: view.changed_wall_ns,
        confirmed_by: view.confirmed_by.clone(),
        target_kpa: view.target_kpa.is_finite().then_some(view.target_kpa),
        both_branches: view.branches == Branch::Both,
        falling: view.direction == Direction::Falling,
        ramps: view.ramps,
        accepted: view.accepted,
        refused: SampleRefusal::ALL.iter().map(|&why| (why.name().to_owned(), view.refused.get(why))).collect(),
        coverage: view.coverage.is_finite().then_some(view.coverage),
        responding: view.responding,
        model_set: view.model_set.as_deref().map(str::to_owned),
        left_out: view.left_out.clone(),
        predecessor: view.predecessor,
        board_settings: view.board_settings.to_vec(),
        gauge: view.gauge.clone(),
        untrusted: view.untrusted.clone(),
    })
}

/// The inverse of [`view_to_text`]; a refusal reason that this version does not know is left out.
pub(crate) fn view_from_text(text: &str) -> Result<SessionView, String> {
    let stored: StoredView = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let state = SessionState::from_name(&stored.state)
        .ok_or_else(|| format!("there is no session state `{}`", stored.state))?;
    let mut refused = RefusalCounts::default();
    for (name, count) in &stored.refused {
        if let Some(why) = SampleRefusal::ALL.into_iter().find(|why| why.name() == name) {
            refused.0[why as usize] = *count;
        }
    }
    Ok(SessionView {
        number: stored.number,
        patch: stored.patch,
        state,
        reason: stored.reason,
        started_wall_ns: stored.started_wall_ns,
        changed_wall_ns: stored.changed_wall_ns,
        confirmed_by: stored.confirmed_by,
        target_kpa: stored.target_kpa.unwrap_or_default(),
        branches: if stored.both_branches { Branch::Both } else { Branch::Rising },
        direction: if stored.falling { Direction::Falling } else { Direction::Rising },
        ramps: stored.ramps,
        accepted: stored.accepted,
        refused,
        durable: stored.accepted,
        coverage: stored.coverage.unwrap_or_default(),
        responding: stored.responding,
        not_responding: std::sync::Arc::default(), // of a session that is held alone
        model_set: stored.model_set.map(Into::into),
        left_out: stored.left_out,
        predecessor: stored.predecessor,
        board_settings: stored.board_settings.into(),
        gauge: stored.gauge,
        untrusted: stored.untrusted,
        ..SessionView::default()
    })
}

#[cfg(test)]
mod tests;
