//! What is known of a board beside its counts, and when its zero can no longer be trusted.

use std::time::Duration;
use taxel_skin::Time;
use taxel_wire::icub::{FirmwareVersion, StatusWord};

/// MTB3 and MTB4 take their zero anew, without a word, after this many lost acknowledgements (icub-firmware).
const NO_ACKS_TO_SILENT_TARE: u32 = 5;

/// One board.
#[derive(Clone, Debug, Default)]
pub struct BoardLive {
    last: Option<Time>,
    status_errors: u64,
    no_acks: u32,
    overflows: u64,
    celsius: Option<f64>,
    firmware: Option<FirmwareVersion>,
}

impl BoardLive {
    /// A module of the board came whole. Returns why the board's zero is in doubt, if it is.
    pub fn on_module(&mut self, time: Time, status: StatusWord, power_cycle_after: Duration) -> Option<String> {
        let silence = self.last.map(|last| time.since(last));
        self.last = Some(time);
        self.status_errors += u64::from(!status.is_ok());
        if status.no_ack() {
            self.no_acks += 1;
            if self.no_acks >= NO_ACKS_TO_SILENT_TARE {
                self.no_acks = 0;
                return Some(format!(
                    "reported {NO_ACKS_TO_SILENT_TARE} lost acknowledgements and then takes a new zero by itself"
                ));
            }
        }
        let silence = silence.filter(|&s| s > power_cycle_after)?;
        Some(format!("was silent for {:.1} s and may have lost its power", silence.as_secs_f64()))
    }

    /// It discarded its send queue.
    pub fn on_overflow(&mut self) {
        self.overflows += 1;
    }

    /// Its thermometer, in tenths of a degree Celsius.
    pub fn on_temperature(&mut self, deci_celsius: i16) {
        self.celsius = Some(f64::from(deci_celsius) / 10.0);
    }

    /// It told its firmware.
    pub fn on_firmware(&mut self, firmware: FirmwareVersion) {
        self.firmware = Some(firmware);
    }

    /// Tails whose status word named a trouble.
    #[must_use]
    pub const fn status_errors(&self) -> u64 {
        self.status_errors
    }

    /// Temperature in Celsius, where the board sends it.
    #[must_use]
    pub const fn celsius(&self) -> Option<f64> {
        self.celsius
    }

    /// Firmware in words.
    #[must_use]
    pub fn firmware(&self) -> Option<String> {
        self.firmware.map(|f| {
            let ((major, minor, build), protocol) = (f.app, f.protocol);
            format!("type {}, {major}.{minor}.{build}, protocol {}.{}", f.board_type, protocol.0, protocol.1)
        })
    }

    /// What an operator should know of it.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(f) = self.firmware.filter(FirmwareVersion::loses_arbitrated_frames) {
            let (major, minor, _) = f.app;
            warnings
                .push(format!("firmware {major}.{minor} does not retransmit: lost frames are normal; update to 1.25"));
        }
        if self.overflows > 0 {
            warnings.push(format!("discarded its send queue {} times", self.overflows));
        }
        warnings
    }
}
