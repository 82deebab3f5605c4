//! Logs of a bus, whatever they are: candump's text, plain or gzipped, or the MCAP files of a recording, or a folder of
//! these, or what yarpdatadumper recorded of YARP's ports.

use std::fs::File;
use std::io::Cursor;
use std::path::Path;

use anyhow::Context;
use taxel_can::{LogReader, RecordedFrames};
use taxel_yarp::Content;

/// Which bus of a log is read.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// By the network interface; without it all frames of a candump log are.
    pub interface: Option<String>,
    /// By its name where it has no interface, which only recordings know; without either all frames are.
    pub bus: Option<String>,
    /// The port of YARP that is recorded, of a folder of `yarpdatadumper`.
    pub port: Option<(String, Content)>,
}

/// Opens a log.
///
/// # Errors
/// A file that cannot be read.
pub fn open_log(path: &Path, wanted: Wanted) -> anyhow::Result<Box<dyn RecordedFrames>> {
    let (name, bus) = (path.display().to_string(), wanted.interface.clone().or(wanted.bus));
    if path.is_dir() && taxel_yarp::is_dump(path) {
        let (port, content) = wanted.port.with_context(|| {
            format!("{name}: recordings of YARP's ports: `taxeld replay` reads them, by buses with source = \"yarp\"")
        })?;
        let log = taxel_yarp::candump_of(path, &port, content)?;
        return Ok(Box::new(LogReader::new(name, Cursor::new(log), None)));
    }
    if path.is_dir() {
        // In the order in which they were recorded.
        let files = taxel_mcap::Folder::list(path).with_context(|| name.clone())?;
        anyhow::ensure!(!files.is_empty(), "{name}: a folder without recordings (taxeld-NUMBER-TIME.mcap)");
        let files = files.iter().map(|(file, _)| path.join(file.to_string()));
        return Ok(Box::new(taxel_mcap::Recording::of_files(files, bus)));
    }
    let file = File::open(path).with_context(|| name.clone())?;
    Ok(match path.extension() {
        Some(ending) if ending == "mcap" => Box::new(taxel_mcap::Recording::of_reader(name, file, bus)),
        _ => Box::new(LogReader::new(name, file, wanted.interface)),
    })
}
