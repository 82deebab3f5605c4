//! A pressure on a port as a gauge that sends frames.

use taxel_skin::Time;
use taxel_wire::{CanId, Frame, TimedFrame};

/// A step of the whole number in a gauge's frame, in the unit of the port: below what any gauge can tell.
pub const GAUGE_STEP: f64 = 1e-6;

/// The identifier of the frames of one of several gauges, on a bus where no board uses it. They hold a signed whole number of
/// 64 bits, little endian.
#[must_use]
pub const fn gauge_signal_id(number: usize) -> CanId {
    CanId::Standard((number as u16 & 0x7F) + 1)
}

/// Which value of a port's vector is the pressure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GaugeRow {
    /// The identifier of its frames.
    pub id: CanId,
    /// Its place, from 0.
    pub index: usize,
}

impl GaugeRow {
    /// The frame of a message that was received at `time`.
    ///
    /// # Errors
    /// What it has at that place, if that is no number.
    pub fn take(self, time: Time, line: &[u8]) -> Result<TimedFrame, String> {
        let mut tokens = line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty());
        let token = tokens.nth(self.index).map(|token| String::from_utf8_lossy(&token[..token.len().min(20)]));
        let number = token.as_ref().and_then(|token| token.parse::<f64>().ok()).filter(|number| number.is_finite());
        match number {
            Some(number) => {
                let steps = (number / GAUGE_STEP).round() as i64; // saturates; the engine knows what no pressure can be
                Ok(TimedFrame { time, frame: Frame::of(self.id, steps.to_le_bytes()) })
            }
            None => Err(format!("value {} is \"{}\", expected a pressure", self.index, token.unwrap_or_default())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_at_its_place_is_the_pressure() {
        let at = |index| GaugeRow { id: gauge_signal_id(0), index };
        let row = at(1);
        let frame = row.take(Time::from_nanos(7), b"3 -12.5 nan").unwrap();
        assert_eq!(
            (frame.time, frame.frame.bytes()),
            (Time::from_nanos(7), (-12_500_000_i64).to_le_bytes().as_slice())
        );
        let refuse = |index, line: &[u8]| at(index).take(Time::default(), line).unwrap_err();
        assert_eq!(refuse(2, b"3 -12.5 nan"), "value 2 is \"nan\", expected a pressure");
        assert_eq!(refuse(5, b"3"), "value 5 is \"\", expected a pressure");
    }
}
