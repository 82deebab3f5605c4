//! Logs of a bus, whatever they are: candump's text, plain or gzipped, or the MCAP files of a recording, or a folder of
//! these.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use anyhow::Context;
use taxel_can::{LogReader, RecordedFrames};

/// Every MCAP file begins with it.
const MCAP_MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

/// Which bus of a log is read.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// By the network interface; without it all frames of a candump log are.
    pub interface: Option<String>,
    /// By its name where it has no interface, which only recordings know; without either all frames are.
    #[cfg_attr(not(feature = "record"), allow(dead_code))]
    pub bus: Option<String>,
}

impl Wanted {
    /// Of this interface, or of every one.
    pub fn interface(interface: Option<String>) -> Self {
        Self { interface, bus: None }
    }
}

/// Opens a log.
///
/// # Errors
/// A file that cannot be read, or a recording in a build without.
pub fn open_log(path: &Path, wanted: Wanted) -> anyhow::Result<Box<dyn RecordedFrames>> {
    if path.is_dir() {
        return recordings(path, wanted);
    }
    let mut file = File::open(path).with_context(|| path.display().to_string())?;
    let mut begin = Vec::with_capacity(MCAP_MAGIC.len());
    file.by_ref().take(MCAP_MAGIC.len() as u64).read_to_end(&mut begin).with_context(|| path.display().to_string())?;
    let is_recording = begin == MCAP_MAGIC;
    let whole = Cursor::new(begin).chain(file);
    let name = path.display().to_string();
    if is_recording {
        recording(name, whole, wanted)
    } else {
        Ok(Box::new(LogReader::from_reader(name, whole, wanted.interface)?))
    }
}

/// The files of a log: itself, or the recordings of a folder.
pub fn files_of(log: &Path) -> Vec<PathBuf> {
    if log.is_dir() { files_of_folder(log) } else { vec![log.to_owned()] }
}

#[cfg(feature = "record")]
fn files_of_folder(folder: &Path) -> Vec<PathBuf> {
    let files = taxel_mcap::Folder::list(folder).unwrap_or_default();
    files.iter().map(|(file, _)| folder.join(file.to_string())).collect()
}

#[cfg(not(feature = "record"))]
fn files_of_folder(_: &Path) -> Vec<PathBuf> {
    Vec::new()
}

#[cfg(feature = "record")]
#[allow(clippy::unnecessary_wraps)] // in other builds it can fail
fn recording(
    name: String,
    file: impl Read + Send + 'static,
    wanted: Wanted,
) -> anyhow::Result<Box<dyn RecordedFrames>> {
    Ok(Box::new(taxel_mcap::Recording::of_reader(name, file, wanted.interface.or(wanted.bus))))
}

/// The files of a folder, in the order in which they were recorded.
#[cfg(feature = "record")]
fn recordings(folder: &Path, wanted: Wanted) -> anyhow::Result<Box<dyn RecordedFrames>> {
    let name = folder.display().to_string();
    let files = taxel_mcap::Folder::list(folder).with_context(|| name.clone())?;
    anyhow::ensure!(!files.is_empty(), "{name}: a folder without recordings (taxeld-NUMBER-TIME.mcap)");
    let files = files.iter().map(|(file, _)| folder.join(file.to_string()));
    Ok(Box::new(taxel_mcap::Recording::of_files(files, wanted.interface.or(wanted.bus))))
}

#[cfg(not(feature = "record"))]
fn recording(name: String, _: impl Read, _: Wanted) -> anyhow::Result<Box<dyn RecordedFrames>> {
    anyhow::bail!("{name}: this build reads no recordings (cargo feature `record`)")
}

#[cfg(not(feature = "record"))]
fn recordings(folder: &Path, _: Wanted) -> anyhow::Result<Box<dyn RecordedFrames>> {
    anyhow::bail!("{}: a folder; this build reads no recordings (cargo feature `record`)", folder.display())
}

#[cfg(all(test, feature = "record"))]
mod tests {
    use super::*;

    #[test]
    fn the_mark_of_a_recording_is_that_of_the_format() {
        assert_eq!(MCAP_MAGIC, taxel_mcap::MAGIC_BYTES);
    }
}
