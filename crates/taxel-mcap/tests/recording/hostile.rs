//! Files that somebody made to do harm.

use std::io::Write as _;

use taxel_mcap::MAGIC_BYTES;

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

/// A file of one chunk that says to have so many bytes when it is unpacked.
fn file(claimed: u64, compression: &str, records: &[u8]) -> Vec<u8> {
    let mut body = vec![0; 16]; // its times
    body.extend(claimed.to_le_bytes());
    body.extend(0_u32.to_le_bytes()); // no checksum
    body.extend((compression.len() as u32).to_le_bytes());
    body.extend(compression.as_bytes());
    body.extend((records.len() as u64).to_le_bytes());
    body.extend(records);
    let mut bytes = MAGIC_BYTES.to_vec();
    bytes.extend(record(1, &[0; 8]));
    bytes.extend(record(CHUNK, &body));
    bytes
}

fn lz4(content: &[u8]) -> Vec<u8> {
    let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
    encoder.write_all(content).unwrap();
    let (bytes, result) = encoder.finish();
    result.unwrap();
    bytes
}

fn fault(bytes: &[u8]) -> String {
    let (frames, report) = read_bytes(bytes);
    assert_eq!((frames.len(), report.faults.len()), (0, 1), "{report:?}");
    report.faults[0].clone()
}

#[test]
fn a_chunk_that_unpacks_to_more_than_it_says_or_than_is_read_is_refused() {
    let zeros = lz4(&vec![0; CHUNK_BYTES_MAX + 1]);
    assert!(zeros.len() < CHUNK_BYTES_MAX / 100, "a bomb");
    for claimed in [CHUNK_BYTES_MAX as u64 + 1, u64::MAX, 10] {
        fault(&file(claimed, "lz4", &zeros));
    }
    fault(&file(20, "lz4", &lz4(&[0; 10])));
    fault(&file(20, "", &[0; 10]));
}
