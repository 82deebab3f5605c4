//! What is in rows, read and written again, for `tests/fuzz`: their checksums, which no random change hits, left aside.

use taxel_engine::counts::SharedCounts;
use taxel_engine::record::Sample;

use crate::load_row::{load_from_text, load_to_text};
use crate::rows;

/// A session's view as it is read, and as it is read of what is written of it; or why it is refused.
///
/// # Errors
/// Why the text is no view.
pub fn session_again(text: &str) -> Result<[String; 2], String> {
    let view = rows::view_from_text(text)?;
    let written = rows::view_to_text(&view).map_err(|error| error.to_string());
    let again = written.and_then(|text| rows::view_from_text(&text));
    Ok([format!("{:?}", Ok::<_, String>(view)), format!("{again:?}")])
}

/// The same of a known load.
///
/// # Errors
/// Why the text is no load.
pub fn load_again(text: &str) -> Result<[String; 2], String> {
    let load = load_from_text(text).map_err(|error| error.to_string())?;
    let written = load_to_text(&load).map_err(|error| error.to_string());
    let again = written.and_then(|text| load_from_text(&text).map_err(|error| error.to_string()));
    Ok([format!("{:?}", Ok::<_, String>(load)), format!("{again:?}")])
}

/// The beginning of a ramp as it is written again; `None` if the blob is none.
#[must_use]
pub fn ramp_again(blob: &[u8]) -> Option<Vec<u8>> {
    rows::ramp_from_blob(0, blob).map(|ramp| rows::ramp_to_blob(&ramp))
}

/// The counts of a sample as they are written again, in each of the forms that the blob may be of.
#[must_use]
pub fn counts_again(blob: &[u8]) -> Vec<Vec<u8>> {
    let forms = [Some(SharedCounts::from(blob.to_vec())), rows::wide_counts(blob)];
    let again = |counts: SharedCounts| {
        let sample = Sample { ramp: 0, time_ns: 0, pressure_kpa: 0.0, counts };
        let checksum = rows::sample_checksum(1, 0, &sample);
        let written = rows::counts_to_blob(sample.counts.counts()).into_owned();
        let read = rows::with_counts(1, 0, sample.clone(), written.clone(), &checksum);
        assert_eq!(read.as_ref(), Some(&sample));
        written
    };
    forms.into_iter().flatten().map(again).collect()
}
