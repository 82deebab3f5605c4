//! One module: its scans, and what its twelve values did.

use taxel_skin::{ModuleKind, Time, VALUES_PER_MODULE};
use taxel_wire::icub::{Pairer, StatusWord};

/// Head and tail of one scan are closer than this, and boards do not send faster.
const WINDOW: std::time::Duration = std::time::Duration::from_millis(15);
/// A module whose values moved by so much was pressed.
const PRESSED_COUNTS: u8 = 12;
/// Scans below which nothing is said of a value.
const SCANS_MIN: u64 = 8;
/// A module that was not heard for longer at the end has fallen silent: no board sends so slowly.
const SILENT_S: f64 = 1.0;

/// What the kinds are called, and which of the values are pads.
const KINDS: [(&str, ModuleKind); 4] = [
    ("triangle", ModuleKind::Triangle),
    ("fingertip", ModuleKind::Fingertip),
    ("palm-pad11", ModuleKind::PalmPad11),
    ("palm-pad7", ModuleKind::PalmPad7),
];

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
        let taxels = || (0..VALUES_PER_MODULE as u8).filter(|k| !ModuleKind::Triangle.thermal_slots().contains(k));
        let ranges = || taxels().map(|k| self.ranges[usize::from(k)]);
        (ranges().map(|range| range.0).min().unwrap_or(0), ranges().map(|range| range.1).max().unwrap_or(0))
    }

    fn moved(&self, value: usize) -> u8 {
        let (least, most) = self.ranges[value];
        most.saturating_sub(least)
    }

    /// What it can be, if it was pressed, so that its values tell: a kind is left out when one of its thermal pads moved by half
    /// of what most taxels did.
    pub fn kinds(&self) -> Option<Vec<&'static str>> {
        let mut swings: Vec<u8> = (0..VALUES_PER_MODULE).map(|value| self.moved(value)).collect();
        swings.sort_unstable();
        let pressed = self.scans >= SCANS_MIN && swings[VALUES_PER_MODULE - 2] >= PRESSED_COUNTS;
        let limit = swings[VALUES_PER_MODULE / 2].max(PRESSED_COUNTS) / 2;
        let fits = |kind: &ModuleKind| kind.thermal_slots().iter().all(|&slot| self.moved(usize::from(slot)) <= limit);
        pressed.then(|| KINDS.iter().filter(|(_, kind)| fits(kind)).map(|(name, _)| *name).collect())
    }

    /// Values that never changed although others did, or that are at an end of the range. The thermal pads of what can be a
    /// triangle may well do so.
    pub fn stuck(&self) -> Vec<u8> {
        let lives = (0..VALUES_PER_MODULE).any(|value| self.moved(value) > 0);
        let can_be_triangle = self.kinds().is_none_or(|kinds| kinds.contains(&"triangle"));
        let is_pad = |value: &u8| can_be_triangle && ModuleKind::Triangle.thermal_slots().contains(value);
        let is_stuck = |value: &u8| {
            let (least, most) = self.ranges[usize::from(*value)];
            self.scans >= SCANS_MIN && least == most && (lives || matches!(least, 0 | u8::MAX))
        };
        (0..VALUES_PER_MODULE as u8).filter(|value| is_stuck(value) && !is_pad(value)).collect()
    }
}
