//! Files that a command line names, to be read: `-` is the standard input.

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use anyhow::Context;
use taxel_files::is_standard;

/// The name by which the system itself opens what `-` stands for as an input.
pub fn named(path: PathBuf) -> PathBuf {
    if is_standard(&path) { PathBuf::from("/dev/stdin") } else { path }
}

/// Longest text that is read whole: configurations, positions, models and messages are a thousandth of it.
const TEXT_BYTES_MAX: u64 = 64 << 20;

/// Reads what there is, which must be no more than a text may have: what has no end would fill the memory.
fn read_to_limit(from: impl Read, bytes: &mut Vec<u8>) -> io::Result<()> {
    from.take(TEXT_BYTES_MAX + 1).read_to_end(bytes)?;
    match bytes.len() as u64 {
        0..=TEXT_BYTES_MAX => Ok(()),
        _ => Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("it has more than {TEXT_BYTES_MAX} bytes"))),
    }
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
/// The system's reason, or that it is no regular file, no UTF-8, or longer than a text may be.
pub fn read_utf8(path: &Path) -> io::Result<String> {
    utf8(open_regular(path)?)
}

fn utf8(from: impl Read) -> io::Result<String> {
    let mut bytes = Vec::new();
    read_to_limit(from, &mut bytes)?;
    let no_text = |_| io::Error::new(io::ErrorKind::InvalidData, "it is no text in UTF-8");
    String::from_utf8(bytes).map_err(no_text)
}

/// The text of a file, or of standard input.
///
/// # Errors
/// The file's path, and the system's reason or bytes that are not UTF-8.
pub fn read_text(path: &Path) -> anyhow::Result<String> {
    let text = if is_standard(path) { utf8(io::stdin().lock()) } else { File::open(path).and_then(utf8) };
    text.with_context(|| path.display().to_string())
}

/// The text of a file of which nobody says in which encoding it is: bytes that are no UTF-8 are replaced, since nothing that
/// matters in such files is beyond ASCII, and a byte order mark is left out.
///
/// # Errors
/// The system's reason, or that it is no regular file.
pub fn read_any_text(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    read_to_limit(open_regular(path)?, &mut bytes)?;
    Ok(taxel_skin::text::decode(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_end_is_not_read_as_a_text() {
        let endless = read_text(Path::new("/dev/zero")).unwrap_err();
        assert!(format!("{endless:#}").ends_with(&format!("it has more than {TEXT_BYTES_MAX} bytes")), "{endless:#}");
    }
}
