//! Files that somebody made to do harm.

use mcap::MAGIC;

use crate::read_bytes;

const CHUNK: u8 = 6;

/// The largest chunk that is read.
const CHUNK_BYTES_MAX: usize = 32 << 20;

fn record(op: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = vec![op];
    bytes.extend((body.len() as u64).to_le_bytes());
    bytes.extend(body);
    bytes
}

/// A file of one chunk of these bytes, which says to have so many when it is unpacked.
fn file(claimed: u64, records: &[u8]) -> Vec<u8> {
    let mut body = vec![0; 16]; // its times
    body.extend(claimed.to_le_bytes());
    body.extend([0; 8]); // no checksum, and it is not compressed
    body.extend((records.len() as u64).to_le_bytes());
    body.extend(records);
    let mut bytes = MAGIC.to_vec();
    bytes.extend(record(1, &[0; 8]));
    bytes.extend(record(CHUNK, &body));
    bytes
}

#[test]
fn a_chunk_that_unpacks_to_more_than_it_says_or_than_is_read_is_refused() {
    let large = vec![0; CHUNK_BYTES_MAX + 1];
    for bytes in [file(large.len() as u64, &large), file(u64::MAX, &[0; 10]), file(20, &[0; 10])] {
        let (frames, report) = read_bytes(&bytes);
        assert_eq!((frames.len(), report.faults.len()), (0, 1), "{report:?}");
    }
}
