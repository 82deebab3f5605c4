//! One module: its scans, and the range of its values.

use taxel_skin::Time;
use taxel_wire::icub::{Pairer, StatusWord};

/// Head and tail of one scan are closer than this, and boards do not send faster.
const WINDOW: std::time::Duration = std::time::Duration::from_millis(15);

/// A module while somebody listens.
#[derive(Debug)]
pub struct ModuleWatch {
    pairer: Pairer,
    /// Whole scans.
    pub scans: u64,
    last: Option<Time>,
    /// Least and most of its values.
    pub range: (u8, u8),
}

impl Default for ModuleWatch {
    fn default() -> Self {
        Self { pairer: Pairer::new(WINDOW), scans: 0, last: None, range: (u8::MAX, 0) }
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
        self.range = scan.values.iter().fold(self.range, |(least, most), value| (least.min(*value), most.max(*value)));
        self.last.replace(scan.time).map(|last| scan.time.seconds_since(last))
    }

    /// Halves without a partner.
    pub fn orphans(&self) -> u64 {
        self.pairer.orphans().heads + self.pairer.orphans().tails
    }
}
