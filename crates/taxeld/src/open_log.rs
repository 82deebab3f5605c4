//! Logs of a bus, whatever they are: candump's text, plain or gzipped, or the MCAP files of a recording, or a folder of
//! these.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use anyhow::Context;
use taxel_can::{LogReader, RecordedFrames};

/// Which bus of a log is read.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// By the network interface; without it all frames of a candump log are.
    pub interface: Option<String>,
    /// By its name where it has no interface, which only recordings know; without either all frames are.
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
/// A file that cannot be read.
pub fn open_log(path: &Path, wanted: Wanted) -> anyhow::Result<Box<dyn RecordedFrames>> {
    if path.is_dir() {
        return recordings(path, wanted);
    }
    let mut file = File::open(path).with_context(|| path.display().to_string())?;
    let mut begin = Vec::with_capacity(taxel_mcap::MAGIC_BYTES.len());
    file.by_ref()
        .take(taxel_mcap::MAGIC_BYTES.len() as u64)
        .read_to_end(&mut begin)
        .with_context(|| path.display().to_string())?;
    let is_recording = begin == taxel_mcap::MAGIC_BYTES;
    let whole = Cursor::new(begin).chain(file);
    let name = path.display().to_string();
    if is_recording {
        Ok(recording(name, whole, wanted))
    } else {
        Ok(Box::new(LogReader::new(name, whole, wanted.interface)?))
    }
}

fn recording(name: String, file: impl Read + Send + 'static, wanted: Wanted) -> Box<dyn RecordedFrames> {
    Box::new(taxel_mcap::Recording::of_reader(name, file, wanted.interface.or(wanted.bus)))
}

/// The files of a folder, in the order in which they were recorded.
fn recordings(folder: &Path, wanted: Wanted) -> anyhow::Result<Box<dyn RecordedFrames>> {
    let name = folder.display().to_string();
    let files = taxel_mcap::Folder::list(folder).with_context(|| name.clone())?;
    anyhow::ensure!(!files.is_empty(), "{name}: a folder without recordings (taxeld-NUMBER-TIME.mcap)");
    let files = files.iter().map(|(file, _)| folder.join(file.to_string()));
    Ok(Box::new(taxel_mcap::Recording::of_files(files, wanted.interface.or(wanted.bus))))
}
