//! Files that the command line names, and text for people. `-` is the standard input or output.

use std::fmt::Arguments;
use std::fs::{File, Permissions};
use std::io::{self, BufRead, BufReader, BufWriter, ErrorKind, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, ensure};
use flate2::read::MultiGzDecoder;

/// Prints a line for people. Unlike `println!` it does not panic when nobody reads any more.
macro_rules! say {
    ($($text:tt)*) => { $crate::io::line(format_args!($($text)*)) };
}

/// Standard output carries data: text for people goes to standard error.
static ASIDE: AtomicBool = AtomicBool::new(false);

/// What `say!` prints.
pub fn line(text: Arguments<'_>) {
    // A reader that has gone does not end the work: files that were asked for are still written.
    let _ = if ASIDE.load(Ordering::Relaxed) {
        writeln!(io::stderr().lock(), "{text}")
    } else {
        writeln!(io::stdout().lock(), "{text}")
    };
}

/// A line on standard error.
pub fn error_line(text: Arguments<'_>) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Whether the name stands for standard input or output.
#[must_use]
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
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
    ASIDE.store(outputs.iter().any(|output| is_standard(output)), Ordering::Relaxed);
    Ok(())
}

/// Opens a file, plain or gzipped by its first bytes.
///
/// # Errors
/// The file's path and the system's reason.
pub fn open(path: &Path) -> anyhow::Result<Box<dyn Read>> {
    let named = || path.display().to_string();
    let file: Box<dyn Read> = match is_standard(path) {
        true => Box::new(io::stdin().lock()),
        false => Box::new(File::open(path).with_context(named)?),
    };
    let mut file = BufReader::with_capacity(1 << 16, file);
    let gzipped = file.fill_buf().with_context(named)?.starts_with(&[0x1F, 0x8B]);
    Ok(if gzipped { Box::new(MultiGzDecoder::new(file)) } else { Box::new(file) })
}

/// The text of a file, plain or gzipped.
///
/// # Errors
/// The file's path, and the system's reason or that it is not UTF-8.
pub fn read_text(path: &Path) -> anyhow::Result<String> {
    let mut text = String::new();
    open(path)?.read_to_string(&mut text).with_context(|| path.display().to_string())?;
    Ok(text)
}

/// Writes a file as a whole: beside its place, and there once it is complete. A device or a pipe is written as it is.
///
/// # Errors
/// The file's path and the system's reason.
pub fn write(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> anyhow::Result<()> {
    let written = match std::fs::metadata(path) {
        _ if is_standard(path) => finish(io::stdout().lock(), content),
        Ok(there) if !there.is_file() => File::options().write(true).open(path).and_then(|file| finish(file, content)),
        _ => replace(path, content),
    };
    match written {
        // Who reads no more of the standard output had enough.
        Err(error) if is_standard(path) && error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other.with_context(|| path.display().to_string()),
    }
}

fn replace(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let place = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mode = std::fs::metadata(&place).map_or(0o666, |there| there.permissions().mode());
    let part = tempfile::Builder::new().permissions(Permissions::from_mode(mode)).tempfile_in(folder)?;
    finish(part.as_file(), content)?;
    part.persist(&place)?;
    Ok(())
}

fn finish(to: impl Write, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut to = BufWriter::new(to);
    content(&mut to)?;
    to.flush()
}

/// Writes a text, as [`write()`] does.
///
/// # Errors
/// The file's path and the system's reason.
pub fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    write(path, |out| out.write_all(text.as_bytes()))
}
