//! The mark beside an open database: that a stop was not clean if it is still there, and how many pages of the write-ahead
//! log were on disk by then.
//!
//! A log says of itself only what is in it. One that was cut off after a kill, or of which the last transaction was damaged,
//! looks like one that a power cut tore before anything of it was acknowledged. The mark tells them apart. It is written after
//! the log was flushed and is not flushed itself: after a power cut it may say too little, and never too much.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use crate::beside;

/// A number of pages and its complement: what is torn, damaged or of an older program says nothing.
type Content = [u8; 8];

fn content(pages: u32) -> Content {
    let mut content = [0; 8];
    content[..4].copy_from_slice(&pages.to_le_bytes());
    content[4..].copy_from_slice(&(!pages).to_le_bytes());
    content
}

fn name(database: &Path) -> PathBuf {
    beside::open_mark(database)
}

/// The mark of a database that this process has open.
#[derive(Debug)]
pub(crate) struct OpenMark(File);

impl OpenMark {
    /// Marks a database whose log was folded back and has nothing since: none of its pages is known to be on disk.
    ///
    /// # Errors
    /// If it cannot be marked.
    pub(crate) fn set(database: &Path) -> io::Result<Self> {
        let mark = name(database);
        beside::replace(database, &mark, &[])?;
        File::options().write(true).open(&mark).map(Self)
    }

    /// So many pages of the log are on disk. Where that cannot be noted, fewer are known to be.
    pub(crate) fn note(&self, pages: u32) {
        if let Err(error) = self.0.write_all_at(&content(pages), 0) {
            tracing::debug!(%error, pages, "how much of the log is on disk could not be noted");
        }
    }
}

/// Whether the database was open when its process ended.
pub(crate) fn is_set(database: &Path) -> bool {
    name(database).exists()
}

/// So many pages of the log were on disk at least.
pub(crate) fn pages(database: &Path) -> u32 {
    if !is_file(database) {
        return 0;
    }
    let mut found = Content::default();
    let read = File::open(name(database)).and_then(|mark| mark.read_exact_at(&mut found, 0));
    let [a, b, c, d, ..] = found;
    let pages = u32::from_le_bytes([a, b, c, d]);
    if read.is_ok() && found == content(pages) { pages } else { 0 }
}

/// Whether what has the name of the mark is a file: a pipe would be waited for.
fn is_file(database: &Path) -> bool {
    fs::metadata(name(database)).is_ok_and(|found| found.is_file())
}

/// The log is about to be folded back: from here on nothing is known to be in it.
///
/// # Errors
/// If that cannot be noted; then nothing may be folded back.
pub(crate) fn folds_back(database: &Path) -> io::Result<()> {
    if !is_file(database) {
        return Ok(());
    }
    let mark = File::options().write(true).open(name(database))?;
    if mark.metadata()?.len() > 0 {
        mark.set_len(0)?;
        mark.sync_all()?;
    }
    Ok(())
}

/// From here on the log may be missing: what is in it is in the database, or kept elsewhere.
///
/// # Errors
/// If the mark cannot be removed.
pub(crate) fn clear(database: &Path) -> io::Result<()> {
    beside::remove(&name(database))?;
    beside::sync_folder(database)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_noted_is_known_until_the_log_is_folded_back() {
        let dir = tempfile::tempdir().unwrap();
        let database = dir.path().join("store.db");
        folds_back(&database).unwrap();
        assert!(!is_set(&database) && pages(&database) == 0, "nobody has opened it");
        let mark = OpenMark::set(&database).unwrap();
        assert!(is_set(&database) && pages(&database) == 0);
        for noted in [1, 1000, u32::MAX] {
            mark.note(noted);
            assert_eq!(pages(&database), noted);
        }
        folds_back(&database).unwrap();
        assert!(is_set(&database) && pages(&database) == 0);
        mark.note(7);
        assert_eq!(pages(&database), 7);
        clear(&database).unwrap();
        assert!(!is_set(&database) && pages(&database) == 0);
    }

    #[test]
    fn a_mark_that_is_torn_or_damaged_says_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let database = dir.path().join("store.db");
        let whole = content(0x1234_5678);
        for bit in 0..64 {
            let mut damaged = whole;
            damaged[bit / 8] ^= 1 << (bit % 8);
            fs::write(name(&database), damaged).unwrap();
            assert_eq!(pages(&database), 0, "bit {bit}");
        }
        for torn in [&whole[..7], &[0; 8], &[7; 8], b"a longer one"] {
            fs::write(name(&database), torn).unwrap();
            assert_eq!(pages(&database), 0, "{torn:?}");
        }
        fs::write(name(&database), whole).unwrap();
        assert_eq!(pages(&database), 0x1234_5678);
        for make in ["mkfifo", "mkdir"] {
            clear(&database).unwrap();
            assert!(std::process::Command::new(make).arg(name(&database)).status().unwrap().success());
            assert_eq!(pages(&database), 0, "{make}");
            folds_back(&database).unwrap();
        }
    }
}
