//! `service.low_latency`: what is done beside serving on the engine's own runtime, which saves the wake of one thread a
//! sample. A processor that has nothing to do goes to sleep, and takes tens of microseconds to wake; the kernel lets
//! whoever holds a device open forbid that, for the whole machine.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;

/// Linux, Documentation/admin-guide/pm/cpuidle.rst: the longest time in us that a processor may take to wake.
const DEVICE: &str = "/dev/cpu_dma_latency";

/// No processor of the machine sleeps deeply while this lives.
#[derive(Debug)]
pub struct Awake {
    _device: File,
}

/// Keeps the machine's processors awake, or tells why not. The daemon serves all the same.
///
/// # Errors
/// The device and what is wrong with it, in words for the health and the log.
pub fn keep_awake() -> Result<Awake, String> {
    hold(Path::new(DEVICE))
}

fn open(device: &Path) -> Result<File, String> {
    OpenOptions::new().write(true).open(device).map_err(|error| unheld(device, &error))
}

fn hold(device: &Path) -> Result<Awake, String> {
    let mut file = open(device)?;
    // Four bytes are a number in the machine's own order; anything else would be read as text.
    file.write_all(&0_i32.to_ne_bytes()).map_err(|error| unheld(device, &error))?;
    Ok(Awake { _device: file })
}

fn unheld(device: &Path, error: &std::io::Error) -> String {
    format!("service.low_latency: {} cannot be held, so that processors sleep: {error}", device.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wake_of_zero_microseconds_is_asked_for_and_what_cannot_be_had_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path().join("cpu_dma_latency");
        let said = hold(&device).unwrap_err();
        assert!(said.contains("cpu_dma_latency cannot be held") && said.contains("No such file"), "{said}");
        std::fs::write(&device, "").unwrap();
        let _awake = hold(&device).unwrap();
        assert_eq!(std::fs::read(&device).unwrap(), [0; 4]);
    }
}
