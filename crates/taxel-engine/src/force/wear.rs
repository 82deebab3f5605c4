//! How what may press unseen has grown since the zero was taken.
//!
//! What all taxels together have moved towards load since then may be drift or a load that lies everywhere, and nothing
//! tells the two apart. So it counts as what may press unseen, and no force becomes wrong by it; but after some minutes of
//! drift that may be more than what the skin is to measure. Then the operator has to unload the skin and take a new zero.

use taxel_skin::{Newton, Time};

use crate::statistics::exponential_share;

/// How long the first value is averaged, seconds.
const FIRST_S: f64 = 10.0;
/// Time constant of the present value, seconds: a contact that comes and goes is no wear.
const PRESENT_S: f64 = 10.0;
/// A zero is worn when this many times as much may press unseen as at first.
const WORN: f64 = 2.0;

/// What may press unseen, when the zero was new and now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wear {
    /// Mean of the ten seconds from the first force on.
    pub at_first: Newton,
    /// Mean of about the last ten seconds.
    pub present: Newton,
}

impl Wear {
    /// Whether it has doubled.
    #[must_use]
    pub fn is_worn(self) -> bool {
        self.present.0 > WORN * self.at_first.0
    }
}

/// Follows the wear of one patch's zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct WearMeter {
    epoch: u64,
    begun: Option<Time>,
    last: Time,
    sum_n: f64,
    samples: u32,
    present_n: f64,
}

impl WearMeter {
    /// A sample at `time`, at the zero number `epoch`, with what may press unseen; `None` where there is no force. A sample
    /// that is read again changes nothing. Gives the wear once the first ten seconds are over.
    pub fn on_sample(&mut self, time: Time, epoch: u64, floor: Option<Newton>) -> Option<Wear> {
        if self.epoch != epoch {
            *self = Self { epoch, ..Self::default() };
        }
        match (floor, self.begun) {
            (Some(floor), None) => {
                let Newton(sum_n) = floor;
                *self = Self { epoch, begun: Some(time), last: time, sum_n, samples: 1, present_n: sum_n };
            }
            (Some(floor), Some(begun)) if time > self.last => self.add(time, begun, floor),
            _ => {}
        }
        let over = self.begun.is_some_and(|begun| self.last.seconds_since(begun) >= FIRST_S);
        let at_first = Newton(self.sum_n / f64::from(self.samples.max(1)));
        over.then_some(Wear { at_first, present: Newton(self.present_n) })
    }

    fn add(&mut self, time: Time, begun: Time, floor: Newton) {
        if time.seconds_since(begun) <= FIRST_S {
            self.sum_n += floor.0;
            self.samples += 1;
        }
        let share = exponential_share(time.seconds_since(self.last), PRESENT_S);
        self.present_n += share * (floor.0 - self.present_n);
        self.last = time;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Time {
        Time::from_nanos((seconds * 1e9) as i64)
    }

    /// Feeds a floor that is worked out from the time, 20 scans a second from `from_s` on, and gives the last answer.
    fn feed(meter: &mut WearMeter, [from_s, to_s]: [u32; 2], floor_n: impl Fn(f64) -> f64) -> Option<Wear> {
        let times = (from_s * 20..=to_s * 20).map(|scan| f64::from(scan) / 20.0);
        times.fold(None, |_, time_s| meter.on_sample(at(time_s), 1, Some(Newton(floor_n(time_s)))))
    }

    #[test]
    fn nothing_is_said_before_the_first_ten_seconds_are_over() {
        let mut meter = WearMeter::default();
        assert_eq!(meter.on_sample(at(0.0), 0, None), None, "no zero yet");
        assert_eq!(meter.on_sample(at(5.0), 1, Some(Newton(2.0))), None);
        assert_eq!(meter.on_sample(at(14.99), 1, Some(Newton(4.0))), None);
        let wear = meter.on_sample(at(15.0), 1, Some(Newton(3.0))).unwrap();
        assert_eq!(wear.at_first, Newton(3.0));
        assert!(!wear.is_worn());
        assert!(!Wear { at_first: Newton(2.0), present: Newton(4.0) }.is_worn(), "twice as much is the limit");
    }

    #[test]
    fn a_zero_is_worn_when_twice_as_much_may_press_unseen_and_a_new_one_begins_anew() {
        let mut meter = WearMeter::default();
        assert!(!feed(&mut meter, [0, 60], |_| 2.0).unwrap().is_worn());
        // From 2 N by 1 N a minute: the mean lags by its time constant, and passes 4 N after 130 s.
        let drifting = |time_s: f64| 2.0 + (time_s - 60.0) / 60.0;
        assert!(!feed(&mut meter, [60, 189], drifting).unwrap().is_worn());
        let worn = feed(&mut meter, [190, 192], drifting).unwrap();
        assert!(worn.is_worn(), "{worn:?}");
        assert_eq!(worn.at_first, Newton(2.0));
        assert_eq!(meter.on_sample(at(193.0), 2, Some(Newton(2.5))), None);
        let anew = meter.on_sample(at(203.0), 2, Some(Newton(2.5))).unwrap();
        assert_eq!(anew, Wear { at_first: Newton(2.5), present: Newton(2.5) });
    }

    #[test]
    fn a_short_contact_wears_nothing_and_time_without_force_says_nothing() {
        let mut meter = WearMeter::default();
        let touched = |time_s: f64| if (11.0..14.0).contains(&time_s) { 8.0 } else { 2.0 };
        let after = feed(&mut meter, [0, 14], touched).unwrap();
        assert!(!after.is_worn(), "{after:?}");
        assert_eq!(meter.on_sample(at(15.0), 1, None), Some(after));
        assert_eq!(meter.on_sample(at(13.0), 1, Some(Newton(50.0))), Some(after), "the same scan once more");
        assert_eq!(meter.on_sample(at(14.0), 1, Some(Newton(50.0))), Some(after), "the newest once more");
    }
}
