//! Files that a command line or a configuration names, to be read.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use anyhow::Context;
use flate2::read::MultiGzDecoder;

use crate::write::is_standard;

/// The name by which the system itself opens what `-` stands for as an input.
#[must_use]
pub fn named(path: PathBuf) -> PathBuf {
    if is_standard(&path) { PathBuf::from("/dev/stdin") } else { path }
}

/// Opens a file that has an end. A pipe without a writer would hold the daemon up for ever, at its start or at a reload.
fn open_regular(path: &Path) -> io::Result<File> {
    let file = File::options().read(true).custom_flags(nix::libc::O_NONBLOCK).open(path)?;
    match file.metadata()?.is_file() {
        true => Ok(file),
        false => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "it is no regular file: expected one, no pipe and no device",
        )),
    }
}

/// The text of a file.
///
/// # Errors
/// The system's reason, or that it is no regular file, or no UTF-8.
pub fn read_utf8(path: &Path) -> io::Result<String> {
    io::read_to_string(open_regular(path)?)
}

/// Opens a file, or the standard input; gzipped ones are unpacked, by their first bytes.
///
/// # Errors
/// The file's path and the system's reason.
pub fn open(path: &Path) -> anyhow::Result<Box<dyn Read>> {
    let shown = || path.display().to_string();
    let file: Box<dyn Read> = match is_standard(path) {
        true => Box::new(io::stdin().lock()),
        false => Box::new(File::open(path).with_context(shown)?),
    };
    let mut file = BufReader::with_capacity(1 << 16, file);
    let gzipped = file.fill_buf().with_context(shown)?.starts_with(&[0x1F, 0x8B]);
    Ok(if gzipped { Box::new(MultiGzDecoder::new(file)) } else { Box::new(file) })
}

/// The text of such a file.
///
/// # Errors
/// The file's path, and the system's reason or bytes that are not UTF-8.
pub fn read_text(path: &Path) -> anyhow::Result<String> {
    io::read_to_string(open(path)?).with_context(|| path.display().to_string())
}

/// The text of a file of which nobody says in which encoding it is: bytes that are no UTF-8 are replaced, since nothing that
/// matters in such files is beyond ASCII, and a byte order mark is left out.
///
/// # Errors
/// The file's path, and the system's reason or that it is no regular file.
pub fn read_any_text(path: &Path) -> anyhow::Result<String> {
    let mut bytes = Vec::new();
    let read = open_regular(path).and_then(|mut file| file.read_to_end(&mut bytes));
    read.with_context(|| path.display().to_string())?;
    Ok(taxel_skin::text::decode(&bytes))
}
