//! Logs of a bus, whatever they are: candump's text, plain or gzipped, or the MCAP files of a recording, or a folder of
//! these. A recording is read as the text of a candump log.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use anyhow::Context;
use taxel_can::LogReader;

/// Every MCAP file begins with it.
const MCAP_MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

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
/// A file that cannot be read, or a recording in a build without.
pub fn open_log(path: &Path, wanted: Wanted) -> anyhow::Result<LogReader> {
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
        Ok(LogReader::from_reader(name, whole, wanted.interface)?)
    }
}

fn recording(name: String, file: impl Read + Send + 'static, wanted: Wanted) -> anyhow::Result<LogReader> {
    of_inputs(name.clone(), vec![taxel_mcap::Input::Open(name, Box::new(file))], wanted)
}

/// The files of a folder, in the order in which they were recorded.
fn recordings(folder: &Path, wanted: Wanted) -> anyhow::Result<LogReader> {
    let name = folder.display().to_string();
    let files = taxel_mcap::Folder::list(folder).with_context(|| name.clone())?;
    anyhow::ensure!(!files.is_empty(), "{name}: a folder without recordings (taxeld-NUMBER-TIME.mcap)");
    let inputs = files.iter().map(|(file, _)| taxel_mcap::Input::File(folder.join(file.to_string())));
    of_inputs(name, inputs.collect(), wanted)
}

fn of_inputs(name: String, inputs: Vec<taxel_mcap::Input>, wanted: Wanted) -> anyhow::Result<LogReader> {
    let told = |ending: &taxel_mcap::Ending| {
        ending.words().iter().for_each(|line| crate::say::error_line(format_args!("{line}")));
        if ending.frames == 0 && ending.other_bus > 0 {
            let frames = ending.other_bus;
            crate::say::error_line(format_args!("the recording has {frames} frames, and none of this bus"));
        }
    };
    let text = taxel_mcap::CandumpText::new(inputs, wanted.interface.or(wanted.bus), told);
    Ok(LogReader::from_reader(name, text, None)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mark_of_a_recording_is_that_of_the_format() {
        assert_eq!(MCAP_MAGIC, taxel_mcap::MAGIC_BYTES);
    }
}
