//! Whether the write-ahead log is whole. SQLite reads it up to the first frame that does not fit and says nothing: that is
//! right where a power cut tore the last transaction, and a loss where older ones follow.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::Path;

use crate::{beside, open_mark};

const HEADER_BYTES: usize = 32;
const FRAME_HEADER_BYTES: usize = 24;
const MAGIC: u32 = 0x377f_0682;
const PAGE_BYTES_MAX: usize = 65536;

/// So many bytes a log has at least that has so many pages of this size.
pub(crate) fn bytes_of(pages: u32, page_bytes: u64) -> u64 {
    if pages == 0 { 0 } else { HEADER_BYTES as u64 + u64::from(pages) * (FRAME_HEADER_BYTES as u64 + page_bytes) }
}

/// What is lost of the log of a database that is about to be opened; nothing if it is whole, if only what nobody was told to be on
/// disk is torn off its end, or if there is none after a clean stop. By itself a log tells what is broken before its last
/// transaction; that it is missing, was cut off or has a damaged last transaction tells the [mark](open_mark).
pub(crate) fn problem(database: &Path) -> io::Result<Option<String>> {
    let log = beside::wal(database);
    let unreadable =
        |why: &dyn fmt::Display| format!("it cannot be read, and what was written from there on is lost: {why}");
    match fs::metadata(&log) {
        Ok(about) if about.is_file() => {}
        Ok(_) => return Ok(Some(unreadable(&"it is no regular file"))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let lost = "it is missing after a stop that was not clean: what was written since it was last folded back \
                        into the store is lost";
            let clean = !open_mark::is_set(database);
            return Ok((!clean).then(|| lost.to_owned()));
        }
        Err(error) => return Err(error),
    }
    let found = match read(BufReader::new(File::open(&log)?)) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Found::default(), // not even a beginning
        Err(error) => return Ok(Some(unreadable(&error))),
        Ok(found) => found,
    };
    Ok(found.problem.or_else(|| cut_off(found.pages, open_mark::pages(database))))
}

/// How many pages a database has by the last transaction of its log; `None` if that has none, or cannot be read.
pub(crate) fn database_pages(database: &Path) -> Option<u32> {
    let log = beside::wal(database);
    let is_file = fs::metadata(&log).is_ok_and(|about| about.is_file());
    is_file.then(|| read(BufReader::new(File::open(log).ok()?)).ok()?.database_pages).flatten()
}

/// What is lost of a log that has `usable` pages, of which there were `once` so many on disk.
fn cut_off(usable: u32, once: u32) -> Option<String> {
    let lost =
        || format!("{once} pages of it were on disk and {usable} can be used: what was written after these is lost");
    (usable < once).then(lost)
}

/// What a log has.
#[derive(Debug, Default, PartialEq, Eq)]
struct Found {
    /// Up to the last end of a transaction before the first page that is not what was written.
    pages: u32,
    /// How many the database has after that transaction.
    database_pages: Option<u32>,
    /// What is wrong with it, as far as it can tell itself.
    problem: Option<String>,
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

fn read(mut log: impl Read) -> io::Result<Found> {
    let mut header = [0; HEADER_BYTES];
    log.read_exact(&mut header)?;
    let (magic, page_bytes) = (number(&header, 0), number(&header, 8) as usize);
    let big_endian = magic & 1 == 1;
    let mut sum = add([0; 2], &header[..24], big_endian);
    let fits = magic & !1 == MAGIC && (512..=PAGE_BYTES_MAX).contains(&page_bytes);
    if !fits || sum != [number(&header, 24), number(&header, 28)] {
        // The header is flushed before the first page follows: one that was torn never had any.
        if log.read(&mut [0])? == 0 {
            return Ok(Found::default());
        }
        let problem = "its beginning is not what was written: nothing of it can be used".to_owned();
        return Ok(Found { problem: Some(problem), ..Found::default() });
    }
    let salts = &header[16..24];
    let mut frame = vec![0; FRAME_HEADER_BYTES + page_bytes];
    let (mut broken, mut commits_after, mut pages, mut database_pages) = (None, 0, 0, None);
    for position in 0_u32.. {
        if let Err(error) = log.read_exact(&mut frame) {
            if error.kind() == io::ErrorKind::UnexpectedEof { break } else { return Err(error) }
        }
        sum = add(add(sum, &frame[..8], big_endian), &frame[FRAME_HEADER_BYTES..], big_endian);
        let whole = &frame[8..16] == salts && sum == [number(&frame, 16), number(&frame, 20)];
        if broken.is_none() && !whole {
            broken = Some(position);
        }
        let pages_after = number(&frame, 4);
        let ends_transaction = &frame[8..16] == salts && pages_after > 0;
        match broken {
            Some(_) => commits_after += u32::from(ends_transaction),
            None if ends_transaction => (pages, database_pages) = (position + 1, Some(pages_after)),
            None => {}
        }
    }
    // The writer waits for the disk before it begins the next transaction: two ends of transactions from the break on
    // mean that one of them was on disk.
    let problem = broken.filter(|_| commits_after > 1).map(|position| {
        format!("page {position} of it is not what was written: {commits_after} transactions from there on are lost")
    });
    Ok(Found { pages, database_pages, problem })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: usize = 512;
    const SALTS: [u8; 8] = *b"saltsalt";

    /// A log of frames, each the last of a transaction or not, as SQLite writes it (its file format, section 4).
    fn log(magic: u32, page_bytes: u32, frames: &[bool]) -> Vec<u8> {
        let big_endian = magic & 1 == 1;
        let mut log = [magic, 3_007_000, page_bytes, 0].map(u32::to_be_bytes).concat();
        log.extend(SALTS);
        let mut sum = add([0; 2], &log, big_endian);
        log.extend(sum.map(u32::to_be_bytes).concat());
        for (position, &is_last) in (1_u32..).zip(frames) {
            let head = [position, if is_last { position } else { 0 }].map(u32::to_be_bytes).concat();
            let page = vec![position as u8; page_bytes as usize];
            sum = add(add(sum, &head, big_endian), &page, big_endian);
            log.extend([&head[..], &SALTS, &sum.map(u32::to_be_bytes).concat(), &page].concat());
        }
        log
    }

    fn found(log: &[u8]) -> Option<String> {
        match read(log) {
            Ok(found) => found.problem,
            Err(error) => Some(error.to_string()),
        }
    }

    /// The same with another byte in this frame's page.
    fn damaged(mut log: Vec<u8>, frame: usize) -> Vec<u8> {
        log[HEADER_BYTES + frame * (FRAME_HEADER_BYTES + PAGE) + FRAME_HEADER_BYTES + 9] ^= 1;
        log
    }

    #[test]
    fn what_is_no_file_in_the_place_of_the_log_is_told_as_that() {
        let dir = tempfile::tempdir().unwrap();
        let database = dir.path().join("store.db");
        fs::create_dir(beside::wal(&database)).unwrap();
        let told = problem(&database).unwrap().unwrap();
        assert!(told.ends_with("is lost: it is no regular file"), "{told}");
    }

    #[test]
    fn a_whole_log_of_either_byte_order_has_no_problem() {
        for magic in [MAGIC, MAGIC | 1] {
            for page_bytes in [512, 4096, 65536] {
                assert_eq!(found(&log(magic, page_bytes, &[true, false, true])), None, "{magic:x}, {page_bytes}");
            }
            let mut turned = log(magic, PAGE as u32, &[true]);
            turned[3] ^= 1; // the other order, by which its sums are wrong
            assert!(found(&turned).is_some(), "{magic:x}");
        }
    }

    #[test]
    fn a_beginning_that_is_not_sqlite_s_is_told_unless_nothing_follows() {
        let beginning = "its beginning is not what was written: nothing of it can be used";
        let [mut no_log, mut no_size, mut no_sum] = [(); 3].map(|()| log(MAGIC, PAGE as u32, &[true]));
        // The sum is right in the first two: what it is of is none of a log.
        for (log, at, bytes) in [(&mut no_log, 0, 0x1234_5678), (&mut no_size, 8, 256)] {
            log[at..at + 4].copy_from_slice(&u32::to_be_bytes(bytes));
            let sum = add([0; 2], &log[..24], false);
            log[24..32].copy_from_slice(&sum.map(u32::to_be_bytes).concat());
        }
        no_sum[31] ^= 1;
        for log in [no_log, no_size, no_sum] {
            assert_eq!(found(&log).as_deref(), Some(beginning));
            assert_eq!(found(&log[..HEADER_BYTES]), None, "it never had a page");
        }
    }

    #[test]
    fn what_is_lost_is_told_where_older_transactions_follow_the_break() {
        let three = log(MAGIC, PAGE as u32, &[true, false, true, true]);
        let told = |transactions, page| {
            Some(format!(
                "page {page} of it is not what was written: {transactions} transactions from there on are lost"
            ))
        };
        assert_eq!(found(&damaged(three.clone(), 0)), told(3, 0));
        assert_eq!(found(&damaged(three.clone(), 1)), told(2, 1));
        assert_eq!(found(&damaged(three.clone(), 2)), told(2, 2));
        assert_eq!(found(&damaged(three.clone(), 3)), None, "a power cut tore the last one");
        assert_eq!(found(&three[..three.len() - 1]), None, "a power cut tore the last one");
    }

    #[test]
    fn pages_count_up_to_the_last_end_of_a_transaction() {
        let pages = |frames: &[bool]| read(&log(MAGIC, PAGE as u32, frames)[..]).unwrap().pages;
        assert_eq!([&[][..], &[false, false], &[true, false, false], &[false, true, false]].map(pages), [0, 0, 1, 2]);
        let torn = read(&damaged(log(MAGIC, PAGE as u32, &[true, true, false, true]), 3)[..]).unwrap();
        assert_eq!(torn, Found { pages: 2, database_pages: Some(2), problem: None });
    }

    /// A log is begun anew over an older one, whose frames have other salts.
    #[test]
    fn what_is_left_of_an_older_log_is_none_of_this_one() {
        let mut begun_anew = log(MAGIC, PAGE as u32, &[true, true, true, true]);
        let frame = FRAME_HEADER_BYTES + PAGE;
        for older in [1, 2, 3] {
            begun_anew[HEADER_BYTES + older * frame + 8] ^= 0xFF;
        }
        assert_eq!(found(&begun_anew), None);
        // A frame with the right salts and a wrong sum that ends no transaction says nothing either.
        assert_eq!(found(&damaged(log(MAGIC, PAGE as u32, &[true, false, false, true]), 1)), None);
    }

    #[test]
    fn a_log_that_cannot_be_opened_or_read_is_not_a_torn_one() {
        let dir = tempfile::tempdir().unwrap();
        let database = dir.path().join("store.db");
        assert_eq!(problem(&database).unwrap(), None, "no store has been there");
        std::fs::create_dir(beside::wal(&database)).unwrap();
        let said = problem(&database).unwrap().unwrap();
        assert!(said.starts_with("it cannot be read, and what was written from there on is lost: "), "{said}");
        std::fs::remove_dir(beside::wal(&database)).unwrap();
        std::os::unix::fs::symlink(beside::wal(&database), beside::wal(&database)).unwrap();
        assert_ne!(problem(&database).unwrap_err().kind(), io::ErrorKind::NotFound);
        // A file whose beginning cannot be read: no memory of this process lies there.
        std::fs::remove_file(beside::wal(&database)).unwrap();
        std::os::unix::fs::symlink("/proc/self/mem", beside::wal(&database)).unwrap();
        let said = problem(&database).unwrap().unwrap();
        assert!(said.ends_with(" is lost: Input/output error (os error 5)"), "{said}");
    }
}
