//! Where everything is in a page. `deploy/shared-memory.md` has the same as a table of bytes; a change here needs a new
//! [`VERSION`], and the same change there, in `deploy/taxel_force.h` and in `deploy/python`.

use crate::sample::{MODEL_SET_BYTES, REASON_BYTES, Sample, State};
use crate::text::Text;

/// Version of the layout.
pub const VERSION: u32 = 1;
/// Bytes of a page.
pub const PAGE_BYTES: usize = 4096;
/// Words of eight bytes in it.
pub(crate) const PAGE_WORDS: usize = PAGE_BYTES / 8;
/// The first eight bytes.
pub(crate) const MAGIC: [u8; 8] = *b"TAXELFRC";

// The header, by word. It is written before the page has its name and never again.
pub(crate) const AT_MAGIC: usize = 0;
pub(crate) const AT_VERSION_AND_BYTES: usize = 1;
pub(crate) const AT_AGE_LIMIT: usize = 4;
pub(crate) const AT_BEAT_LIMIT: usize = 5;

// What changes.
/// How many samples were written: sample n is in place n % 2.
pub(crate) const AT_WRITES: usize = 16;
/// When the writer was last seen alive, in ns of `CLOCK_BOOTTIME`.
pub(crate) const AT_BEAT: usize = 17;
/// Not zero once the writer has ended.
pub(crate) const AT_CLOSED: usize = 18;

/// Where the two samples are.
pub(crate) const AT_SAMPLES: [usize; 2] = [32, 96];
/// Words of a sample.
pub(crate) const SAMPLE_WORDS: usize = 64;

/// A sample as it lies in the page.
pub(crate) type SampleWords = [u64; SAMPLE_WORDS];

// A sample, by word.
const SEQUENCE: usize = 0;
const MONOTONIC: usize = 1;
const WALL: usize = 2;
const WRITTEN: usize = 3;
const STATE_AND_FLAGS: usize = 4;
const TOTAL: usize = 5;
const SIGMA: usize = 6;
const LOW: usize = 7;
const HIGH: usize = 8;
const UNDETECTED: usize = 9;
const STEP: usize = 10;
const ZERO_EPOCH: usize = 11;
const RESULTANT: usize = 12;
const MOMENT: usize = 15;
const CENTRE: usize = 18;
const ACTIVE_AND_EXCLUDED: usize = 21;
const STALE_AND_OUT_OF_RANGE: usize = 22;
const MODEL_SET: usize = 23;
const REASONS: usize = 31;
/// CRC-32 of all words before it, for readers whose language has no memory barriers.
const CHECK: usize = 63;

// Flags. A figure that is not there is NaN.
const SEEN: u32 = 1;
const SIMULATED: u32 = 1 << 1;

// Every part is inside of the page, and no two overlap.
const _: () = {
    assert!(AT_CLOSED < AT_SAMPLES[0] && AT_SAMPLES[0] + SAMPLE_WORDS <= AT_SAMPLES[1]);
    assert!(AT_SAMPLES[1] + SAMPLE_WORDS <= PAGE_WORDS);
    assert!(MODEL_SET + MODEL_SET_BYTES / 8 <= REASONS && REASONS + REASON_BYTES / 8 <= CHECK);
};

/// Two numbers of four bytes, the first one first.
pub(crate) fn pair(first: u32, second: u32) -> u64 {
    let ([a, b, c, d], [e, f, g, h]) = (first.to_ne_bytes(), second.to_ne_bytes());
    u64::from_ne_bytes([a, b, c, d, e, f, g, h])
}

/// The two numbers of [`pair`].
pub(crate) fn unpair(word: u64) -> (u32, u32) {
    let [a, b, c, d, e, f, g, h] = word.to_ne_bytes();
    (u32::from_ne_bytes([a, b, c, d]), u32::from_ne_bytes([e, f, g, h]))
}

/// Bytes, eight a word.
pub(crate) fn put_bytes(words: &mut [u64], bytes: &[u8]) {
    for (word, chunk) in words.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *word = u64::from_ne_bytes(*chunk);
    }
}

/// The bytes of [`put_bytes`].
pub(crate) fn get_bytes<const N: usize>(words: &[u64]) -> [u8; N] {
    let mut bytes = [0; N];
    for (chunk, word) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(words) {
        *chunk = word.to_ne_bytes();
    }
    bytes
}

/// A figure; one that is absent or no number is NaN.
fn put<const N: usize>(words: &mut SampleWords, at: usize, figure: Option<[f64; N]>) {
    let parts = figure.filter(|parts| parts.iter().all(|part| part.is_finite())).unwrap_or([f64::NAN; N]);
    words[at..at + N].copy_from_slice(&parts.map(f64::to_bits));
}

/// A figure, if it is a number.
fn get<const N: usize>(words: &SampleWords, at: usize) -> Option<[f64; N]> {
    let parts: [f64; N] = std::array::from_fn(|part| f64::from_bits(words[at + part]));
    Some(parts).filter(|parts| parts.iter().all(|part| part.is_finite()))
}

/// The sample as words.
pub(crate) fn encode(sample: &Sample) -> SampleWords {
    let mut words = [0; SAMPLE_WORDS];
    words[SEQUENCE] = sample.sequence;
    words[MONOTONIC] = sample.monotonic_ns.unwrap_or_default().cast_unsigned();
    words[WALL] = sample.wall_ns.cast_unsigned();
    words[WRITTEN] = sample.written_ns.cast_unsigned();
    let flags = (u32::from(sample.monotonic_ns.is_some()) * SEEN) | (u32::from(sample.simulated) * SIMULATED);
    words[STATE_AND_FLAGS] = pair(sample.state as u32, flags);
    let figures = [sample.total_n, sample.sigma_n, sample.low_n, sample.high_n, sample.undetected_n, sample.step_n];
    for (at, figure) in [TOTAL, SIGMA, LOW, HIGH, UNDETECTED, STEP].into_iter().zip(figures) {
        put(&mut words, at, figure.map(|figure| [figure]));
    }
    words[ZERO_EPOCH] = sample.zero_epoch;
    put(&mut words, RESULTANT, sample.resultant_n);
    put(&mut words, MOMENT, sample.moment_nm);
    put(&mut words, CENTRE, sample.centre_of_pressure_m);
    words[ACTIVE_AND_EXCLUDED] = pair(sample.active, sample.excluded);
    words[STALE_AND_OUT_OF_RANGE] = pair(sample.stale, sample.out_of_range);
    put_bytes(&mut words[MODEL_SET..], sample.model_set.bytes());
    put_bytes(&mut words[REASONS..], sample.reasons.bytes());
    words[CHECK] = check(&words);
    words
}

/// The sample of these words, whatever they are.
pub(crate) fn decode(words: &SampleWords) -> Sample {
    let (state, flags) = unpair(words[STATE_AND_FLAGS]);
    let one = |at: usize| get::<1>(words, at).map(|[figure]| figure);
    let (active, excluded) = unpair(words[ACTIVE_AND_EXCLUDED]);
    let (stale, out_of_range) = unpair(words[STALE_AND_OUT_OF_RANGE]);
    Sample {
        sequence: words[SEQUENCE],
        monotonic_ns: (flags & SEEN != 0).then_some(words[MONOTONIC].cast_signed()),
        wall_ns: words[WALL].cast_signed(),
        written_ns: words[WRITTEN].cast_signed(),
        state: State::of_number(state),
        simulated: flags & SIMULATED != 0,
        total_n: one(TOTAL),
        sigma_n: one(SIGMA),
        low_n: one(LOW),
        high_n: one(HIGH),
        undetected_n: one(UNDETECTED),
        step_n: one(STEP),
        zero_epoch: words[ZERO_EPOCH],
        resultant_n: get(words, RESULTANT),
        moment_nm: get(words, MOMENT),
        centre_of_pressure_m: get(words, CENTRE),
        active,
        excluded,
        stale,
        out_of_range,
        model_set: Text::of_bytes(get_bytes::<MODEL_SET_BYTES>(&words[MODEL_SET..])),
        reasons: Text::of_bytes(get_bytes::<REASON_BYTES>(&words[REASONS..])),
    }
}

/// CRC-32 of all words but the last.
fn check(words: &SampleWords) -> u64 {
    let bytes = get_bytes::<{ 8 * CHECK }>(&words[..CHECK]);
    u64::from(crc32fast::hash(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_that_is_no_number_is_absent() {
        for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let sample = Sample { total_n: Some(odd), resultant_n: Some([0.0, odd, 0.0]), ..Sample::default() };
            let back = decode(&encode(&sample));
            assert_eq!((back.total_n, back.resultant_n), (None, None));
            // Nor is one that a fault of the memory put there.
            let mut words = encode(&Sample { total_n: Some(5.0), ..Sample::default() });
            words[TOTAL] = odd.to_bits();
            assert_eq!(decode(&words).total_n, None);
        }
    }
}
