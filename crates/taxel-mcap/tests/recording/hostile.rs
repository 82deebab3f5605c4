//! Files that somebody made to do harm.

use std::io::Write as _;

use proptest::prelude::*;
use taxel_mcap::{CHUNK_BYTES_MAX, Chunks, MAGIC_BYTES, ReadFault};

use crate::{read_bytes, three_chunks};

const CHUNK: u8 = 6;
const MESSAGE: u8 = 5;

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

fn fault(bytes: &[u8]) -> ReadFault {
    let mut chunks = Chunks::new(bytes);
    loop {
        match chunks.next_record() {
            Ok(Some(_)) => {}
            Ok(None) => panic!("it was read to its end"),
            Err(fault) => {
                assert!(chunks.next_record().unwrap().is_none(), "there is nothing after a fault");
                return fault;
            }
        }
    }
}

#[test]
fn a_chunk_that_unpacks_to_more_than_it_says_or_than_is_read_is_refused() {
    let zeros = lz4(&vec![0; CHUNK_BYTES_MAX + 1]);
    assert!(zeros.len() < CHUNK_BYTES_MAX / 100, "a bomb");
    let most = CHUNK_BYTES_MAX as u64;
    assert!(matches!(fault(&file(most + 1, "lz4", &zeros)), ReadFault::TooLarge { claimed } if claimed == most + 1));
    assert!(matches!(fault(&file(u64::MAX, "lz4", &zeros)), ReadFault::TooLarge { .. }));
    assert!(matches!(fault(&file(10, "lz4", &zeros)), ReadFault::Length { found: 11, claimed: 10 }));
    assert!(matches!(fault(&file(20, "lz4", &lz4(&[0; 10]))), ReadFault::Length { found: 10, claimed: 20 }));
    assert!(matches!(fault(&file(20, "", &[0; 10])), ReadFault::Length { found: 10, claimed: 20 }));
}

#[test]
fn a_compression_that_is_not_read_is_named() {
    let said = fault(&file(10, "zstd", &[0; 10])).to_string();
    assert!(said.contains("\"zstd\", expected lz4 or none"), "{said}");
}

#[test]
fn a_record_that_claims_more_than_its_chunk_has_is_refused() {
    for claimed in [1, 22, u64::from(u32::MAX), u64::MAX - 8, u64::MAX] {
        let mut records = vec![MESSAGE];
        records.extend(claimed.to_le_bytes());
        for (compression, packed) in [("", records.clone()), ("lz4", lz4(&records))] {
            let fault = fault(&file(records.len() as u64, compression, &packed));
            assert!(matches!(fault, ReadFault::Record { wanted, left: 0 } if wanted == claimed), "{fault}");
        }
    }
}

#[test]
fn a_record_that_claims_more_than_is_read_takes_no_memory() {
    for op in [CHUNK, MESSAGE, 9, 0x80] {
        let mut bytes = MAGIC_BYTES.to_vec();
        bytes.push(op);
        bytes.extend((1_u64 << 40).to_le_bytes());
        bytes.extend([0; 100]);
        let (text, ending) = read_bytes(&bytes);
        assert_eq!((text.as_str(), ending.faults.len()), ("", 1), "{ending:?}");
    }
}

proptest! {
    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read_bytes(&bytes);
        read_bytes(&[MAGIC_BYTES, &bytes].concat());
        read_bytes(&file(bytes.len() as u64, "", &bytes));
        read_bytes(&file(bytes.len() as u64, "lz4", &bytes));
    }

    #[test]
    fn no_damage_panics(places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let (mut bytes, _) = three_chunks(true);
        for (place, byte) in places {
            let at = place.index(bytes.len());
            bytes[at] = byte;
        }
        read_bytes(&bytes);
    }
}
