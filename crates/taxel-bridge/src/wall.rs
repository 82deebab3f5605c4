//! The wall clock of this computer, and messages against it.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use taxel_proto::Timestamp;

/// Nanoseconds since 1970.
pub fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// How long ago a message was sent at `now_ns`: its newest frame is of `time` and was `age_s` old then. Zero if that lies
/// ahead, or if the message has no time. Clocks of two computers are compared here, which NTP or PTP keeps together.
pub fn since_sent(time: Option<&Timestamp>, age_s: Option<f64>, now_ns: i64) -> Duration {
    let Some((time, age_s)) = time.zip(age_s) else { return Duration::ZERO };
    let since_frame_s =
        (now_ns / 1_000_000_000 - time.seconds) as f64 + (now_ns % 1_000_000_000 - i64::from(time.nanos)) as f64 * 1e-9;
    // What is no time at all, a NaN say, is no reason to call a message younger.
    Duration::try_from_secs_f64((since_frame_s - age_s).max(0.0)).unwrap_or(Duration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_that_was_held_up_on_its_way_was_sent_as_long_ago_as_that() {
        let time = Timestamp { seconds: 1_700_000_000, nanos: 900_000_000 };
        let since = |age_s, now_ns| since_sent(Some(&time), age_s, now_ns).as_secs_f64();
        assert!((since(Some(0.02), 1_700_000_001_000_000_000) - 0.08).abs() < 1e-6);
        assert!((since(Some(0.02), 1_700_000_011_000_000_000) - 10.08).abs() < 1e-6);
        assert_eq!(since(Some(0.02), 1_600_000_000_000_000_000), 0.0, "a clock that is behind");
        assert_eq!((since(None, i64::MAX), since_sent(None, Some(0.1), 5)), (0.0, Duration::ZERO));
    }
}
