//! One module: its scans, and what its twelve values did.

use taxel_skin::{Time, VALUES_PER_MODULE};
use taxel_wire::icub::{Pairer, StatusWord};

/// Head and tail of one scan are closer than this, and boards do not send faster.
const WINDOW: std::time::Duration = std::time::Duration::from_millis(15);
/// Scans below which nothing is said of a value.
const SCANS_MIN: u64 = 8;
/// A module that was not heard for longer at the end has fallen silent: no board sends so slowly.
const SILENT_S: f64 = 1.0;

/// The thermal pads of a triangle, as most modules are; they may well stand still.
const PADS: [u8; 2] = [6, 10];

/// A module while somebody listens.
#[derive(Debug)]
pub struct ModuleWatch {
    pairer: Pairer,
    /// Whole scans.
    pub scans: u64,
    last: Option<Time>,
    /// Least and most of each value.
    ranges: [(u8, u8); VALUES_PER_MODULE],
    /// Scans whose status word named a trouble.
    pub status_errors: u64,
}

impl Default for ModuleWatch {
    fn default() -> Self {
        let ranges = [(u8::MAX, 0); VALUES_PER_MODULE];
        Self { pairer: Pairer::new(WINDOW), scans: 0, last: None, ranges, status_errors: 0 }
    }
}

impl ModuleWatch {
    /// A head frame.
    pub fn head(&mut self, time: Time, values: [u8; 7]) {
        self.pairer.head(time, values);
    }

    /// A tail frame. If it makes a scan whole: the seconds since the scan before.
    pub fn tail(&mut self, time: Time, values: [u8; 5], status: StatusWord) -> Option<f64> {
        let scan = self.pairer.tail(time, values, status)?;
        self.scans += 1;
        self.status_errors += u64::from(!scan.status.is_ok());
        for ((least, most), value) in self.ranges.iter_mut().zip(scan.values) {
            (*least, *most) = ((*least).min(value), (*most).max(value));
        }
        self.last.replace(scan.time).map(|last| scan.time.seconds_since(last))
    }

    /// Halves without a partner.
    pub fn orphans(&self) -> u64 {
        self.pairer.orphans().heads + self.pairer.orphans().tails
    }

    /// For how long it had been silent at the end, if it was, s.
    pub fn silent_s(&self, end: Time) -> Option<f64> {
        self.last.map(|last| end.seconds_since(last)).filter(|silence| *silence > SILENT_S)
    }

    /// Least and most count of the values that are taxels of most modules.
    pub fn range(&self) -> (u8, u8) {
        let ranges = || (0..).zip(self.ranges).filter(|(value, _)| !PADS.contains(value)).map(|(_, range)| range);
        (ranges().map(|range| range.0).min().unwrap_or(0), ranges().map(|range| range.1).max().unwrap_or(0))
    }

    /// Values that never changed although others did, or that are at an end of the range.
    pub fn stuck(&self) -> Vec<u8> {
        let lives = self.ranges.iter().any(|(least, most)| least < most);
        let stands = |(least, most): (u8, u8)| least == most && (lives || matches!(least, 0 | u8::MAX));
        let stuck = (0..).zip(self.ranges).filter(|(value, range)| stands(*range) && !PADS.contains(value));
        if self.scans >= SCANS_MIN { stuck.map(|(value, _)| value).collect() } else { Vec::new() }
    }
}
