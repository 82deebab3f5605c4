//! What `yarpdatadumper` recorded: a folder a port, with `data.log` (a message a line: number, one or two times, values) and
//! `info.log` (which times, which port).
//!
//! It becomes the log that candump would have written on the boards' bus, so that everything that reads logs reads it.

use std::fmt::Write;
use std::fs;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

use taxel_skin::Time;
use taxel_wire::TimedFrame;
use thiserror::Error;

use crate::source::Content;

/// Folders in folders.
const DEPTH_MAX: usize = 6;

/// Why a recording cannot be read.
#[derive(Debug, Error)]
pub enum DumpFault {
    /// This file cannot be read.
    #[error("{}: {}", .0.display(), .1)]
    File(PathBuf, io::Error),
    /// In this folder there is no recording of this port, but of those.
    #[error("{}: no recording of port {}: there are recordings of {}", .0.display(), .1, .2.join(", "))]
    NoPort(PathBuf, String, Vec<String>),
    /// Two folders have recordings of this port.
    #[error("port {} was recorded twice, in {} and {}: give only one of them", .0, .1.display(), .2.display())]
    Twice(String, PathBuf, PathBuf),
    /// This line of this file, from 1, makes no sense.
    #[error("{}, line {}: {}", .0.display(), .1, .2)]
    Line(PathBuf, usize, String),
}

/// A recording of a port.
struct Dump {
    folder: PathBuf,
    /// Of whom, as `info.log` has it.
    ports: Vec<String>,
    /// How many times a line has; the last is that of reception.
    times: usize,
}

/// Whether a folder is such a recording, or has some in it.
#[must_use]
pub fn is_dump(folder: &Path) -> bool {
    dumps(folder, 0).is_ok_and(|dumps| !dumps.is_empty())
}

/// The log of a port, as the boards or the gauge would have sent it.
///
/// # Errors
/// [`DumpFault`].
pub fn candump_of(folder: &Path, port: &str, mut content: Content) -> Result<String, DumpFault> {
    let dumps = dumps(folder, 0)?;
    let of_port: Vec<&Dump> = match &dumps[..] {
        [only] if only.ports.is_empty() => vec![only],
        all => all.iter().filter(|dump| dump.ports.iter().any(|recorded| recorded == port)).collect(),
    };
    let mut frames = Vec::new();
    match of_port[..] {
        [dump] => read(dump, &mut content, &mut frames)?,
        [a, b, ..] => return Err(DumpFault::Twice(port.to_owned(), a.folder.clone(), b.folder.clone())),
        [] => {
            let found = dumps.iter().flat_map(|dump| dump.ports.clone()).collect();
            return Err(DumpFault::NoPort(folder.to_owned(), port.to_owned(), found));
        }
    }
    frames.sort_by_key(|frame| frame.time);
    let mut log = String::with_capacity(frames.len() * 48);
    for TimedFrame { time, frame } in frames {
        let data: String = frame.bytes().iter().map(|byte| format!("{byte:02X}")).collect();
        let _ = writeln!(log, "({:.6}) yarp {}#{data}", time.as_seconds(), frame.id); // writing to a string does not fail
    }
    Ok(log)
}

fn read(dump: &Dump, content: &mut Content, frames: &mut Vec<TimedFrame>) -> Result<(), DumpFault> {
    let path = dump.folder.join("data.log");
    let fault = |error| DumpFault::File(path.clone(), error);
    let file = fs::File::open(&path).map_err(fault)?;
    for (number, line) in BufReader::new(file).split(b'\n').enumerate() {
        let line = line.map_err(fault)?;
        if line.trim_ascii().is_empty() {
            continue;
        }
        let wrong = |why: String| DumpFault::Line(path.clone(), number + 1, why);
        let mut rest = line.as_slice();
        let mut time = None;
        for _ in 0..=dump.times {
            let (word, after) = word(rest);
            (time, rest) = (word.parse::<f64>().ok().filter(|time| time.is_finite()), after);
        }
        let time = time.ok_or_else(|| wrong("expected a number, a time and values".to_owned()))?;
        content.take(Time::from_seconds(time), rest, frames).map_err(wrong)?;
    }
    Ok(())
}

/// The first word, and what comes behind.
fn word(line: &[u8]) -> (&str, &[u8]) {
    let line = line.trim_ascii_start();
    let (word, rest) = line.split_at(line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len()));
    (std::str::from_utf8(word).unwrap_or_default(), rest)
}

fn dumps(folder: &Path, depth: usize) -> Result<Vec<Dump>, DumpFault> {
    let fault = |error| DumpFault::File(folder.to_owned(), error);
    if folder.join("data.log").is_file() {
        let info = fs::read_to_string(folder.join("info.log")).unwrap_or_default();
        let connected = info.lines().filter(|line| line.ends_with("[connected]"));
        let ports = connected.filter_map(|line| line.split_whitespace().find(|word| word.starts_with('/')));
        let times = 1 + usize::from(info.contains("tx+rx"));
        return Ok(vec![Dump { folder: folder.to_owned(), ports: ports.map(str::to_owned).collect(), times }]);
    }
    let entries: io::Result<Vec<_>> = fs::read_dir(folder).and_then(Iterator::collect);
    let mut paths: Vec<_> = entries.map_err(fault)?.into_iter().map(|entry| entry.path()).collect();
    paths.sort();
    let mut found = Vec::new();
    for path in paths {
        if path.is_dir() && depth < DEPTH_MAX {
            found.extend(dumps(&path, depth + 1)?);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::Rows;
    use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};

    #[test]
    fn a_recorded_port_becomes_the_log_of_its_frames() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, info: &str, data: &str| {
            let inner = folder.path().join(name);
            fs::create_dir_all(&inner).unwrap();
            fs::write(inner.join("info.log"), info).unwrap();
            fs::write(inner.join("data.log"), data).unwrap();
        };
        let vector = |first: u8| format!("{first}.0 {} 1.0", "240.0 ".repeat(10));
        let rest = "240.0 ".repeat(180);
        let skin =
            format!("0 10.00 {0} {rest}\n1 10.05 {1} {rest}\n", vector(240), vector(239).replace(" 1.0", " 2.0"));
        let info = "Type: Bottle;\n[9.9] /icub/skin/left_hand [connected]\nStamp: tx;\n";
        put("skin", info, &skin);
        put("bag", "[9.9] /bag/pressure:o [connected]\nStamp: tx+rx;\n", "0 9.0 10.02 -1.5\n1 9.1 10.06 -1.6\n");
        let modules = vec![(Module::from_nibble(0), ModuleKind::Triangle)];
        let board = Board { bus: BusIndex(0), address: BoardAddress::new(14).unwrap(), modules };
        let rows = || Content::Skin(Rows::new(&Patch::new("hand", vec![board.clone()]).unwrap()));
        let log = |port, content| candump_of(folder.path(), port, content).map_err(|fault| fault.to_string());
        let lines =
            |log: String| log.lines().map(|line| line.split('#').next().unwrap().to_owned()).collect::<Vec<_>>();
        assert_eq!(lines(log("/icub/skin/left_hand", rows()).unwrap()), ["(10.050000) yarp 4E0"; 2]);
        let bag = lines(log("/bag/pressure:o", Content::Gauge(vec![0])).unwrap());
        assert_eq!(bag, ["(10.020000) yarp 001", "(10.060000) yarp 001"]);
        assert!(is_dump(folder.path()));
        let refused = log("/other", rows()).unwrap_err();
        assert!(refused.contains("/icub/skin/left_hand") && refused.contains("/bag/pressure:o"), "{refused}");
        let refused = log("/bag/pressure:o", rows()).unwrap_err();
        assert!(refused.contains("data.log, line 1: value 0 is"), "{refused}");
        put("again", info, &skin);
        let refused = log("/icub/skin/left_hand", rows()).unwrap_err();
        let folders = (folder.path().join("again"), folder.path().join("skin"));
        assert!(refused.contains(&format!("in {} and {}", folders.0.display(), folders.1.display())), "{refused}");
    }
}
