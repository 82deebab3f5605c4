//! How a sample gets into a page and out of it whole, without anybody waiting: a seqlock over two places.
//!
//! `writes` counts the samples that were written whole; sample n lies in place n % 2. The writer fills the other place and
//! counts on. A reader takes the place that `writes` names and looks at `writes` again: if it is the same, no write to that
//! place can have begun, because the next one there is two further. So a reader that comes during a write reads the sample
//! before it, and a writer that is killed in the middle leaves that one whole.
//!
//! Words are read and written relaxed, ordered by fences (Boehm, "Can seqlocks get along with programming language memory
//! models?", 2012): a relaxed load is all that is defined for atomics in memory that is mapped read-only.

use std::sync::atomic::{AtomicU64, Ordering, fence};

use crate::layout::{AT_SAMPLES, AT_WRITES, PAGE_WORDS, SAMPLE_WORDS, SampleWords};

/// The words of a page.
pub(crate) type Words = [AtomicU64; PAGE_WORDS];

/// A read of 100 ns during which the writer finishes a sample is repeated so often at most. Samples come at kilohertz at
/// the very most, so that one repetition is rare and a second never needed.
const TRIES: usize = 16;

/// Writes the next sample. There must be one writer.
pub(crate) fn write(words: &Words, sample: &SampleWords) {
    let number = words[AT_WRITES].load(Ordering::Relaxed).wrapping_add(1);
    // A reader that sees a word of this sample also sees the count of the one before it.
    fence(Ordering::Release);
    let at = AT_SAMPLES[(number & 1) as usize];
    for (word, value) in words[at..at + SAMPLE_WORDS].iter().zip(sample) {
        word.store(*value, Ordering::Relaxed);
    }
    words[AT_WRITES].store(number, Ordering::Release);
}

/// The newest sample and its number; none if there is none yet, or if the writer was faster than [`TRIES`] reads.
pub(crate) fn read(words: &Words) -> Option<(u64, SampleWords)> {
    let mut sample = [0; SAMPLE_WORDS];
    for _ in 0..TRIES {
        let number = words[AT_WRITES].load(Ordering::Relaxed);
        if number == 0 {
            return None;
        }
        fence(Ordering::Acquire);
        let at = AT_SAMPLES[(number & 1) as usize];
        for (value, word) in sample.iter_mut().zip(&words[at..]) {
            *value = word.load(Ordering::Relaxed);
        }
        fence(Ordering::Acquire);
        if words[AT_WRITES].load(Ordering::Relaxed) == number {
            return Some((number, sample));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;

    fn page() -> Box<Words> {
        Box::new([const { AtomicU64::new(0) }; PAGE_WORDS])
    }

    #[test]
    fn a_write_that_is_not_finished_leaves_the_sample_before_it_whole() {
        let words = page();
        write(&words, &[7; SAMPLE_WORDS]);
        // A writer that is killed here has filled half of the other place.
        for word in &words[AT_SAMPLES[0]..AT_SAMPLES[0] + SAMPLE_WORDS / 2] {
            word.store(8, Ordering::Relaxed);
        }
        assert_eq!(read(&words), Some((1, [7; SAMPLE_WORDS])));
    }

    /// Also for miri, which runs it in few rounds.
    #[test]
    fn a_reader_beside_a_writer_gets_whole_samples_in_order() {
        let rounds = if cfg!(miri) { 200 } else { 200_000 };
        let (words, end) = (page(), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut number = 0;
                while !end.load(Ordering::Relaxed) {
                    number += 1;
                    write(&words, &[number; SAMPLE_WORDS]);
                }
            });
            let (mut last, mut got) = (0, 0);
            while got < rounds {
                let Some((number, sample)) = read(&words) else { continue };
                assert!(sample.iter().all(|word| *word == number), "torn: {number}: {sample:?}");
                assert!(number >= last, "{number} after {last}");
                (last, got) = (number, got + 1);
            }
            end.store(true, Ordering::Relaxed);
        });
    }
}
