//! Whether the write-ahead log is whole. SQLite reads it up to the first frame that does not fit and says nothing: that is
//! right where a power cut tore the last transaction, and a loss where older ones follow.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use crate::beside;

const HEADER_BYTES: usize = 32;
const FRAME_HEADER_BYTES: usize = 24;
const MAGIC: u32 = 0x377f_0682;
const PAGE_BYTES_MAX: usize = 65536;

/// What is wrong with the log of a database that is about to be opened; nothing if it is whole or only its end is torn.
pub(crate) fn problem(database: &Path) -> io::Result<Option<String>> {
    let file = match File::open(beside::wal(database)) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let lost = "it is missing after a stop that was not clean: what was written since it was last folded back \
                        into the store is lost";
            let clean = !beside::open_mark(database).exists();
            return Ok((!clean).then(|| lost.to_owned()));
        }
        Err(error) => return Err(error),
    };
    match read(BufReader::new(file)) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None), // the end is torn
        Err(error) => Ok(Some(format!("it cannot be read, and what was written from there on is lost: {error}"))),
        found => found,
    }
}

fn number(bytes: &[u8], at: usize) -> u32 {
    bytes[at..at + 4].iter().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

/// SQLite's sum over pairs of 32-bit words, in the byte order that the magic number tells.
fn add(sum: [u32; 2], bytes: &[u8], big_endian: bool) -> [u32; 2] {
    let (words, _) = bytes.as_chunks::<4>();
    let word = |bytes: &[u8; 4]| if big_endian { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) };
    words.chunks_exact(2).fold(sum, |[a, b], pair| {
        let a = a.wrapping_add(word(&pair[0])).wrapping_add(b);
        [a, b.wrapping_add(word(&pair[1])).wrapping_add(a)]
    })
}

fn read(mut log: impl Read) -> io::Result<Option<String>> {
    let mut header = [0; HEADER_BYTES];
    log.read_exact(&mut header)?;
    let (magic, page_bytes) = (number(&header, 0), number(&header, 8) as usize);
    let big_endian = magic & 1 == 1;
    let mut sum = add([0; 2], &header[..24], big_endian);
    let fits = magic & !1 == MAGIC && (512..=PAGE_BYTES_MAX).contains(&page_bytes);
    if !fits || sum != [number(&header, 24), number(&header, 28)] {
        // The header is flushed before the first page follows: one that was torn never had any.
        if log.read(&mut [0])? == 0 {
            return Ok(None);
        }
        return Ok(Some("its beginning is not what was written: nothing of it can be used".to_owned()));
    }
    let salts = &header[16..24];
    let mut frame = vec![0; FRAME_HEADER_BYTES + page_bytes];
    let (mut broken, mut commits_after) = (None, 0);
    for position in 0_u64.. {
        if let Err(error) = log.read_exact(&mut frame) {
            if error.kind() == io::ErrorKind::UnexpectedEof { break } else { return Err(error) }
        }
        sum = add(add(sum, &frame[..8], big_endian), &frame[FRAME_HEADER_BYTES..], big_endian);
        let whole = &frame[8..16] == salts && sum == [number(&frame, 16), number(&frame, 20)];
        if broken.is_none() && !whole {
            broken = Some(position);
        }
        if broken.is_some() && &frame[8..16] == salts && number(&frame, 4) > 0 {
            commits_after += 1;
        }
    }
    // The writer waits for the disk before it begins the next transaction: two ends of transactions from the break on
    // mean that one of them was on disk.
    Ok(broken.filter(|_| commits_after > 1).map(|position| {
        format!("page {position} of it is not what was written: {commits_after} transactions from there on are lost")
    }))
}
