//! Files that the command line names. `-` is the standard input or output.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use anyhow::{Context, ensure};
use flate2::read::MultiGzDecoder;
use taxel_files::{is_standard, say};

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
