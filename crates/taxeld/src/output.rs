//! What a command writes: a file is whole, or what was there before stays. Standard output, a device or a pipe is written as it is.

use std::fs::{File, Metadata};
use std::io::{self, BufWriter, Stdout, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, fchown};
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::files;

/// Bytes that are gathered for a write.
const BUFFER_BYTES: usize = 1 << 16;

/// An output, empty at first. A file is written beside its place, and [`finish`](Self::finish) puts it there; without that, what
/// was written goes with this.
pub struct Output {
    to: BufWriter<To>,
    /// Where a file is until it is whole, and its place.
    part: Option<(PathBuf, PathBuf)>,
}

enum To {
    Standard(Stdout),
    File(File),
}

impl Output {
    /// Begins it.
    ///
    /// # Errors
    /// The system's reason.
    pub fn create(path: &Path) -> io::Result<Self> {
        let (to, part) = if files::is_standard(path) {
            (To::Standard(io::stdout()), None)
        } else if is_replaced(path) {
            let place = taxel_store::real(path); // through a link its target is replaced
            let (file, part) = begin(&place)?;
            (To::File(file), Some((part, place)))
        } else {
            (To::File(File::create(path)?), None)
        };
        Ok(Self { to: BufWriter::with_capacity(BUFFER_BYTES, to), part })
    }

    /// The file itself, for a format that writes it on its own.
    ///
    /// # Errors
    /// The system's reason, or that it is the standard output.
    pub fn file(&self) -> io::Result<File> {
        match self.to.get_ref() {
            To::Standard(_) => Err(io::Error::other("the standard output is no file of its own")),
            To::File(file) => file.try_clone(),
        }
    }

    /// It is whole: puts a file in its place, once it is on the disk.
    ///
    /// # Errors
    /// The system's reason; what was there before is there still.
    pub fn finish(mut self) -> io::Result<()> {
        self.to.flush()?;
        if let (To::File(file), Some((part, place))) = (self.to.get_ref(), &self.part) {
            file.sync_all()?;
            std::fs::rename(part, place)?;
            self.part = None;
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

impl Drop for Output {
    fn drop(&mut self) {
        if let Some((part, _)) = &self.part {
            let _ = std::fs::remove_file(part); // it is not whole, and nobody waits for it
        }
    }
}

impl Write for To {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Standard(to) => to.write(bytes),
            Self::File(to) => to.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Standard(to) => to.flush(),
            Self::File(to) => to.flush(),
        }
    }
}

/// Whether it is a file, or will be one, that another can take the place of. What a name of an open descriptor stands for is written
/// by others, too.
fn is_replaced(path: &Path) -> bool {
    let is_descriptor = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"].iter().any(|of| path.starts_with(of));
    !is_descriptor && std::fs::metadata(path).map_or(true, |found| found.is_file())
}

/// Makes a file beside `place` by a name that no other has, with owner and mode of what is there. Gives its path, too.
fn begin(place: &Path) -> io::Result<(File, PathBuf)> {
    // What may not be written may not be replaced.
    let there = match File::options().write(true).open(place) {
        Ok(there) => Some(there.metadata()?),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    let mode = if there.is_some() { 0o600 } else { 0o666 };
    let mut number = 0_u32;
    loop {
        let part = place.with_file_name(format!(".taxeld-{}-{number}.part", std::process::id()));
        match File::options().write(true).create_new(true).mode(mode).open(&part) {
            Ok(file) => {
                let same = there.map_or(Ok(()), |there| make_like(&file, &there));
                return same.map(|()| (file, part.clone())).inspect_err(|_| drop(std::fs::remove_file(&part)));
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            Err(error) => {
                return Err(io::Error::new(error.kind(), format!("no file can be made beside it: {error}")));
            }
        }
    }
}

fn make_like(file: &File, there: &Metadata) -> io::Result<()> {
    let _ = fchown(file, Some(there.uid()), Some(there.gid())); // root alone may give it to another account
    file.set_permissions(there.permissions())
}

/// Writes an output as a whole. Who stops to read standard output is no failure.
///
/// # Errors
/// The path and the system's reason.
pub fn write(path: &Path, content: impl FnOnce(&mut Output) -> io::Result<()>) -> anyhow::Result<()> {
    let write = || {
        let mut output = Output::create(path)?;
        content(&mut output)?;
        output.finish()
    };
    quiet_end(path, write())
}

/// Writes a text, as [`write()`] does.
///
/// # Errors
/// The path and the system's reason.
pub fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    write(path, |output| output.write_all(text.as_bytes()))
}

/// A reader of standard output that has gone is no failure; everything else stays one, with the path.
///
/// # Errors
/// The path and the system's reason.
pub fn quiet_end(path: &Path, result: io::Result<()>) -> anyhow::Result<()> {
    match result {
        Err(error) if files::is_standard(path) && error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.with_context(|| path.display().to_string()),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn what_is_not_whole_leaves_the_folder_as_it_was_and_what_is_takes_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        symlink(at("force.csv"), at("link.csv")).unwrap();
        for name in ["force.csv", "force.csv.new", "force.csv.part"] {
            std::fs::write(at(name), name).unwrap();
        }
        let names = || {
            let entries = std::fs::read_dir(folder.path()).unwrap();
            let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let before = names();
        let begun = |path: &str| {
            let mut output = Output::create(&at(path)).unwrap();
            output.write_all(b"new").unwrap();
            output
        };
        drop(begun("force.csv"));
        assert_eq!((names(), std::fs::read(at("force.csv")).unwrap()), (before.clone(), b"force.csv".to_vec()));
        begun("link.csv").finish().unwrap();
        assert_eq!((names(), std::fs::read(at("force.csv")).unwrap()), (before, b"new".to_vec()));
        assert_eq!(std::fs::read(at("force.csv.new")).unwrap(), b"force.csv.new");
        assert!(std::fs::symlink_metadata(at("link.csv")).unwrap().is_symlink());
    }

    #[test]
    fn a_file_keeps_its_mode_and_a_link_to_what_is_not_there_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mode = |name: &str| std::fs::metadata(at(name)).unwrap().permissions().mode() & 0o777;
        write_text(&at("new"), "first").unwrap();
        std::fs::write(at("usual"), "").unwrap();
        assert_eq!(mode("new"), mode("usual"));
        std::fs::set_permissions(at("new"), std::fs::Permissions::from_mode(0o640)).unwrap();
        write_text(&at("new"), "second").unwrap();
        assert_eq!((mode("new"), std::fs::read(at("new")).unwrap()), (0o640, b"second".to_vec()));
        symlink("target", at("link")).unwrap();
        write_text(&at("link"), "through it").unwrap();
        assert!(std::fs::symlink_metadata(at("link")).unwrap().is_symlink());
        assert_eq!(std::fs::read(at("target")).unwrap(), b"through it");
    }

    #[test]
    fn outputs_of_one_folder_are_written_side_by_side_and_what_is_no_file_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
        let outputs = [&one, &other].map(|path| Output::create(path).unwrap());
        outputs.into_iter().for_each(|output| output.finish().unwrap());
        assert!(one.exists() && other.exists());
        write_text(Path::new("/dev/null"), "gone").unwrap();
        let full = write_text(Path::new("/dev/full"), "too much").unwrap_err();
        assert!(format!("{full:#}").starts_with("/dev/full: "), "{full:#}");
        let nowhere = write_text(&one.join("file"), "").unwrap_err();
        assert!(format!("{nowhere:#}").starts_with(&one.join("file").display().to_string()), "{nowhere:#}");
    }
}
