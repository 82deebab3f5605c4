//! Files that the command line names, and text for people. `-` is the standard input or output.

use std::fmt::Arguments;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, ensure};
use flate2::read::MultiGzDecoder;
use taxel_files::is_standard;

/// Prints a line for people. Unlike `println!` it does not panic when nobody reads any more.
macro_rules! say {
    ($($text:tt)*) => { $crate::io::line(format_args!($($text)*)) };
}

/// Standard output carries data: text for people goes to standard error.
static ASIDE: AtomicBool = AtomicBool::new(false);

/// What `say!` prints.
pub fn line(text: Arguments<'_>) {
    if ASIDE.load(Ordering::Relaxed) {
        return error_line(text);
    }
    // A reader that has gone does not end the work: files that were asked for are still written.
    let _ = writeln!(io::stdout().lock(), "{text}");
}

/// A line on standard error.
pub fn error_line(text: Arguments<'_>) {
    let _ = writeln!(io::stderr().lock(), "{text}");
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
    io::read_to_string(open(path)?).with_context(|| path.display().to_string())
}
