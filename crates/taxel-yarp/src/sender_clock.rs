//! When a message was sent, on this machine's clock.
//!
//! Messages wait on their way for longer or shorter; scans that were sent evenly would seem to come too close together. The
//! sender's stamps are even, but of another clock. So the shortest way that was seen lately is taken for all: a message is
//! then as old as it is or a little older, and never younger than when it came.

use taxel_skin::Time;

/// The sender's clock may run so much faster or slower than this one, in s/s; computers hold 1e-4.
const DRIFT: f64 = 3e-4;
/// More than this is no wait but another clock setting.
const WAIT_MAX_S: f64 = 1.0;

/// What is known of a sender's clock.
#[derive(Debug, Default)]
pub(crate) struct SenderClock {
    /// This clock less the sender's by the shortest way, and when that was worked out.
    shortest: Option<(f64, Time)>,
}

impl SenderClock {
    /// The time of a message that was received now and has this stamp in seconds, if it has one; at most `received`.
    pub(crate) fn time_of(&mut self, received: Time, stamp_s: Option<f64>) -> Time {
        let Some(stamp_s) = stamp_s.filter(|stamp_s| stamp_s.is_finite()) else { return received };
        let way_s = received.as_seconds() - stamp_s;
        let shortest_s = match self.shortest {
            Some((shortest_s, at)) if (0.0..WAIT_MAX_S).contains(&(way_s - shortest_s)) => {
                way_s.min(shortest_s + DRIFT * received.seconds_since(at))
            }
            _ => way_s,
        };
        self.shortest = Some((shortest_s, received));
        Time::from_seconds(stamp_s + shortest_s).min(received)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waited_on_its_way_has_the_time_at_which_it_was_sent() {
        let mut clock = SenderClock::default();
        let mut at = |received_s: f64, stamp_s: f64| {
            let time = clock.time_of(Time::from_seconds(received_s), Some(stamp_s));
            (1e3 * time.as_seconds()).round() / 1e3
        };
        assert_eq!(at(10.001, 1e9), 10.001);
        assert_eq!(at(10.050, 1e9 + 0.02), 10.021, "30 ms late");
        assert_eq!(at(10.052, 1e9 + 0.04), 10.041, "and the next one soon after it");
        assert_eq!(at(20.000, 1e9 + 0.06), 20.0, "the sender's clock was set");
        assert_eq!(clock.time_of(Time::from_seconds(30.0), None), Time::from_seconds(30.0));
    }
}
