//! What is said of a log's lines: which were refused, where its clock stepped back, and why there is no frame.

use std::path::Path;

use anyhow::bail;
use taxel_can::{LogReport, RecordedFrames};
use taxel_wire::TimedFrame;

use crate::say::error_line;

/// Reads up to `max` frames into `frames`; `false` at the end of the log. One that cannot be read on ends there, and that is
/// said: what was read is as good as ever.
pub fn read_on(reader: &mut dyn RecordedFrames, frames: &mut Vec<TimedFrame>, max: usize) -> bool {
    reader.next_batch(frames, max).unwrap_or_else(|fault| {
        error_line(format_args!("{fault}; everything before it was read"));
        false
    })
}

/// Says on standard error what a user should know of the lines.
pub fn tell(report: &LogReport) {
    report.words().iter().for_each(|line| error_line(format_args!("{line}")));
}

/// Refuses a log whose times tell nothing: no pace, no gauge and no pair could be judged by them.
///
/// # Errors
/// The file, what its times are, and how to record it.
pub fn expect_times(log: &Path, report: &LogReport) -> anyhow::Result<()> {
    report.time_fault().map_or(Ok(()), |fault| bail!("{}: {fault}", log.display()))
}

/// Refuses a log that has no frame of `interface`, or of any interface without one.
///
/// # Errors
/// The file with its first line that is no frame, or the interfaces that it has.
pub fn expect_frames(log: &Path, interface: Option<&str>, report: &LogReport) -> anyhow::Result<()> {
    let (log, lines) = (log.display(), report.lines);
    match report.first_bad.first() {
        _ if report.frames > report.errors => Ok(()),
        _ if report.errors > 0 => {
            let of = interface.map(|interface| format!(" of {interface}")).unwrap_or_default();
            bail!("{log}: there is no frame{of} in it, only error frames: {}", report.errors)
        }
        _ if report.other_interface > 0 => {
            let (others, interface) = (report.interfaces.join(", "), interface.unwrap_or_default());
            bail!(
                "{log}: none of its {} frames is of {interface}: they are of {others}. Name one: `--interface {}` of scan, \
                 or `interface` of the bus in the configuration",
                report.other_interface,
                report.interfaces.first().map_or("can0", String::as_str)
            )
        }
        Some(bad) => bail!("{log}: not one of its {lines} lines is a frame: line {}: {}", bad.line, bad.fault),
        None => bail!("{log}: there is no frame in it"),
    }
}
