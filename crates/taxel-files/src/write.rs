//! What a command writes: a file is whole, or what was there before stays. Standard output, a device or a pipe is written as it is.

use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use tempfile::NamedTempFile;

use crate::say;

/// Bytes that are gathered for a write.
const BUFFER_BYTES: usize = 1 << 16;

/// Whether the name stands for standard input or output.
#[must_use]
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// An output, empty at first. A file is written beside its place, and [`finish`](Self::finish) puts it there; without that, what
/// was written goes with this.
pub struct Output {
    to: BufWriter<Box<dyn Write>>,
    /// A file that is not whole yet, and its place; neither of standard output, a device or a pipe.
    part: Option<(NamedTempFile, PathBuf)>,
}

impl Output {
    /// Begins it.
    ///
    /// # Errors
    /// The system's reason.
    pub fn create(path: &Path) -> io::Result<Self> {
        let (to, part): (Box<dyn Write>, _) = if is_standard(path) {
            (Box::new(io::stdout()), None)
        } else if is_replaced(path) {
            // Through a link its target is replaced.
            let place = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
            let part = begin(&place)?;
            (Box::new(part.as_file().try_clone()?), Some((part, place)))
        } else {
            (Box::new(File::create(path)?), None)
        };
        Ok(Self { to: BufWriter::with_capacity(BUFFER_BYTES, to), part })
    }

    /// It is whole: puts a file in its place, once it is on the disk.
    ///
    /// # Errors
    /// The system's reason; what was there before is there still.
    pub fn finish(mut self) -> io::Result<()> {
        self.to.flush()?;
        if let Some((part, place)) = self.part {
            part.as_file().sync_all()?;
            part.persist(place).map_err(|failed| failed.error)?;
        }
        Ok(())
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.to.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

/// Whether it is a file, or will be one, that another can take the place of. What stands for an open descriptor is written by
/// others, too.
fn is_replaced(path: &Path) -> bool {
    let is_special = path.starts_with("/dev") || path.starts_with("/proc");
    !is_special && std::fs::metadata(path).map_or(true, |found| found.is_file())
}

/// Makes a file beside `place`, with the mode of what is there.
fn begin(place: &Path) -> io::Result<NamedTempFile> {
    let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let new = Permissions::from_mode(0o666); // less what the process keeps from others
    let part = tempfile::Builder::new().prefix(".taxeld-").permissions(new).tempfile_in(folder)?;
    if let Ok(there) = std::fs::metadata(place) {
        part.as_file().set_permissions(there.permissions())?;
    }
    Ok(part)
}

/// Writes a text as a whole. Who stops to read standard output is no failure.
///
/// # Errors
/// The path and the system's reason.
pub fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    let write = || {
        let mut output = Output::create(path)?;
        output.write_all(text.as_bytes())?;
        output.finish()
    };
    quiet_end(path, write())
}

/// A reader of standard output that has gone is no failure; everything else stays one, with the path.
///
/// # Errors
/// The path and the system's reason.
pub fn quiet_end(path: &Path, result: io::Result<()>) -> anyhow::Result<()> {
    match result {
        Err(error) if is_standard(path) && error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.with_context(|| path.display().to_string()),
    }
}

/// Prepares for these outputs: none may be an input, and text for people makes way for data on standard output.
///
/// # Errors
/// An output that is an input.
pub fn announce(outputs: &[&Path], inputs: &[&Path]) -> anyhow::Result<()> {
    for output in outputs {
        let there = std::fs::canonicalize(output).ok();
        let is_input = inputs.iter().any(|input| there.is_some() && std::fs::canonicalize(input).ok() == there);
        ensure!(!is_input, "the output {} is an input: name another file", output.display());
    }
    if outputs.iter().any(|output| is_standard(output)) {
        say::step_aside();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_file_is_whole_or_as_it_was_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("force.csv"), folder.path().join("link.csv"));
        std::fs::write(&path, "before").unwrap();
        std::fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        symlink(&path, &link).unwrap();
        let mut begun = Output::create(&path).unwrap();
        begun.write_all(b"half").unwrap();
        drop(begun);
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        write_text(&link, "new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
        assert!(link.is_symlink() && std::fs::read_dir(folder.path()).unwrap().count() == 2);
    }

    #[test]
    fn a_new_file_has_the_usual_mode_and_what_is_no_file_is_written_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mode = |name: &str| std::fs::metadata(at(name)).unwrap().permissions().mode() & 0o777;
        write_text(&at("new"), "text").unwrap();
        std::fs::write(at("usual"), "").unwrap();
        assert_eq!(mode("new"), mode("usual"));
        write_text(Path::new("/dev/null"), "gone").unwrap();
        let full = write_text(Path::new("/dev/full"), "too much").unwrap_err();
        assert!(format!("{full:#}").starts_with("/dev/full: "), "{full:#}");
        let nowhere = write_text(&at("new").join("file"), "").unwrap_err();
        assert!(format!("{nowhere:#}").contains("new/file: "), "{nowhere:#}");
    }
}
