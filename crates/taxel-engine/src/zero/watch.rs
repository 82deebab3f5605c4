//! Watching the skin at rest: who asked for it, what was seen, and when it is enough.

use std::time::Duration;
use taxel_skin::Time;

use crate::request::RequestId;
use crate::zero::rest::window::RestWindow;

/// How much longer than planned a watch may take before it is given up.
const GRACE: Duration = Duration::from_secs(2);

/// Who asked for a zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Nobody: after start, against the active model set.
    AtStart,
    /// An operator; `confirmed_by` vouches that nothing touches the skin.
    Operator {
        /// Whom to answer.
        request: RequestId,
        /// Who vouches.
        confirmed_by: Option<String>,
    },
    /// A calibration session, before a ramp.
    Session {
        /// Who vouches.
        confirmed_by: Option<String>,
    },
}

impl Purpose {
    /// Who vouches that nothing touches the skin.
    #[must_use]
    pub fn confirmed_by(&self) -> Option<&str> {
        match self {
            Self::AtStart => None,
            Self::Operator { confirmed_by, .. } | Self::Session { confirmed_by } => confirmed_by.as_deref(),
        }
    }
}

/// A watch under way.
#[derive(Debug)]
pub struct Watch {
    window: RestWindow,
    begun: Time,
    duration: Duration,
    purpose: Purpose,
}

impl Watch {
    /// Begins to watch for so long, with an empty `window`.
    #[must_use]
    pub const fn new(now: Time, duration: Duration, window: RestWindow, purpose: Purpose) -> Self {
        Self { window, begun: now, duration, purpose }
    }

    /// Who asked for it.
    #[must_use]
    pub const fn purpose(&self) -> &Purpose {
        &self.purpose
    }

    /// Takes one scan: what its sound taxels read, and what the others do.
    pub fn push(
        &mut self,
        now: Time,
        sound: impl Iterator<Item = Option<f64>>,
        faulty: impl Iterator<Item = Option<f64>>,
    ) {
        let late = now.since(self.begun) >= self.duration / 2;
        self.window.push(late, sound);
        self.window.push_faulty(faulty);
    }

    /// Whether it has lasted long enough and has seen at least so many scans.
    #[must_use]
    pub fn is_over(&self, now: Time, scans_min: u64) -> bool {
        self.window.all().count() >= scans_min && now.since(self.begun) >= self.duration
    }

    /// When a watch that gets no scans is given up.
    #[must_use]
    pub fn give_up_at(&self) -> Time {
        self.begun + self.duration + GRACE
    }

    /// Ends the watch.
    #[must_use]
    pub fn end(self) -> (Purpose, RestWindow) {
        (self.purpose, self.window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    /// A watch of a second with so many scans, the first at once and then one every 100 ms.
    fn watched(scans: u32) -> Watch {
        let mut watch = Watch::new(Time::default(), SECOND, RestWindow::new(1, &[]), Purpose::AtStart);
        (0..scans).for_each(|scan| {
            watch.push(Time::default() + scan * SECOND / 10, std::iter::once(Some(240.0)), std::iter::once(None))
        });
        watch
    }

    #[test]
    fn a_watch_is_over_when_it_has_lasted_and_has_seen_enough() {
        let almost = Time::from_nanos(999_999_999);
        assert!(!watched(10).is_over(almost, 10) && watched(10).is_over(Time::default() + SECOND, 10));
        assert!(!watched(9).is_over(Time::default() + 2 * SECOND, 10));
        assert_eq!(watched(0).give_up_at(), Time::default() + 3 * SECOND);
    }

    #[test]
    fn half_of_the_time_is_the_later_half_of_the_scans() {
        let (_, window) = watched(7).end();
        assert_eq!(window.halves().each_ref().map(|half| half.count()), [5, 2]);
    }
}
