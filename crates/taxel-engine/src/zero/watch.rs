//! A zero on its way: who asked for it, the watch of the skin, and one that was proven and is being written down.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::Time;

use crate::request::RequestId;
use crate::scan::Scan;
use crate::zero::kept::TakenZero;
use crate::zero::rest::limits::SCANS_MIN;
use crate::zero::rest::window::RestWindow;

/// How much longer than planned a watch may take before it is given up.
const GRACE: Duration = Duration::from_secs(2);

/// Who asked for a zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Nobody: after start, against the active model set.
    AtStart,
    /// An operator; `confirmed_by` confirms that nothing touches the skin.
    Operator {
        /// Whom to answer.
        request: RequestId,
        /// Who confirms.
        confirmed_by: Option<String>,
    },
    /// A calibration session, before a ramp.
    Session {
        /// Who confirms.
        confirmed_by: Option<String>,
    },
}

impl Purpose {
    /// Who confirms that nothing touches the skin.
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
    /// Who asked for it.
    pub purpose: Purpose,
    /// What was seen.
    pub window: RestWindow,
    begun: Time,
    duration: Duration,
}

impl Watch {
    /// Begins to watch for so long, with an empty `window`.
    pub const fn new(begun: Time, duration: Duration, window: RestWindow, purpose: Purpose) -> Self {
        Self { purpose, window, begun, duration }
    }

    /// Takes one scan: what its sound taxels read, and what the others do.
    pub fn push(&mut self, now: Time, scan: &Scan<'_>) {
        self.window.push(now.since(self.begun) >= self.duration / 2, scan.sound_counts());
        self.window.push_faulty(scan.faulty_counts());
    }

    /// Whether it has lasted long enough and has seen enough scans.
    pub fn is_over(&self, now: Time) -> bool {
        self.window.all().count() >= SCANS_MIN && now.since(self.begun) >= self.duration
    }

    /// When a watch that gets no scans is given up.
    pub fn give_up_at(&self) -> Time {
        self.begun + self.duration + GRACE
    }
}

/// What was found of the boards, in words: that one is suspect, that a load has just vanished from one at once, and that the counts
/// cannot show an unloaded skin.
pub(super) type Findings = [Option<String>; 3];

/// A zero that was proven for an operator and holds once it is on disk.
#[derive(Clone, Debug)]
pub(super) struct Writing {
    /// For whom it was taken.
    pub(super) request: RequestId,
    /// What was found of the boards when it was taken.
    pub(super) findings: Findings,
    /// Whether somebody confirms it.
    pub(super) confirmed: bool,
    /// The zero, or what has moved it meanwhile.
    pub(super) zero: Result<Arc<TakenZero>, String>,
}

impl Writing {
    /// Something has moved it; the first reason stays.
    pub(super) fn spoil(&mut self, why: &str) {
        if self.zero.is_ok() {
            self.zero = Err(why.to_owned());
        }
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
            let (time, counts, sound) = (Time::default() + scan * SECOND / 10, [240_u16], [true]);
            let counts = (&counts).into();
            let scan =
                Scan { time, whole: true, counts, pads: &[], silent: &[], sound: &sound, soundness: 0, jumps: &[] };
            watch.push(time, &scan);
        });
        watch
    }

    #[test]
    fn a_watch_is_over_when_it_has_lasted_and_has_seen_enough() {
        let almost = Time::from_nanos(999_999_999);
        assert!(!watched(10).is_over(almost) && watched(10).is_over(Time::default() + SECOND));
        assert!(!watched(9).is_over(Time::default() + 2 * SECOND));
        assert_eq!(watched(0).give_up_at(), Time::default() + 3 * SECOND);
    }

    #[test]
    fn half_of_the_time_is_the_later_half_of_the_scans() {
        assert_eq!(watched(7).window.halves().each_ref().map(|half| half.count()), [5, 2]);
    }
}
