//! What makes a total a lower bound while a contact lies there, held for a second.
//!
//! A contact that lies at a limit is moved over it and back by noise, from scan to scan. What makes its force a lower bound is
//! true of it all the while, also in the scans that do not show it.

use std::sync::Arc;
use taxel_skin::Time;

/// So long it holds after the scan that showed it last, seconds.
const HELD_S: f64 = 1.0;

/// What a scan shows, or has shown last.
#[derive(Clone, Debug, Default)]
pub(super) struct Bound {
    /// How many taxels that cannot be read lie beside a contact of which they may bear more than the force says.
    pub(super) beside: Option<usize>,
    /// A taxel with a fault reads a load: one that another node sends for, too, reads it in every other scan.
    pub(super) faulty_is_pressed: Option<()>,
    /// Taxels without a zero that may bear a load, ascending.
    pub(super) loaded: Option<Arc<[u16]>>,
    /// Those of the total that read more than was calibrated, ascending.
    pub(super) beyond_range: Option<Arc<[u16]>>,
}

impl Bound {
    pub(super) const fn is_any(&self) -> bool {
        let Self { beside, faulty_is_pressed, loaded, beyond_range } = self;
        beside.is_some() || faulty_is_pressed.is_some() || loaded.is_some() || beyond_range.is_some()
    }
}

/// The newest of each, and when it was shown.
#[derive(Clone, Debug, Default)]
pub(super) struct HeldBound {
    beside: Held<usize>,
    faulty_is_pressed: Held<()>,
    loaded: Held<Arc<[u16]>>,
    beyond_range: Held<Arc<[u16]>>,
}

impl HeldBound {
    /// What the scan at `time` shows, and what was shown last within the second before.
    pub(super) fn with(&mut self, time: Time, shown: Bound) -> Bound {
        Bound {
            beside: self.beside.or_before(time, shown.beside),
            faulty_is_pressed: self.faulty_is_pressed.or_before(time, shown.faulty_is_pressed),
            loaded: self.loaded.or_before(time, shown.loaded),
            beyond_range: self.beyond_range.or_before(time, shown.beyond_range),
        }
    }
}

#[derive(Clone, Debug)]
struct Held<T>(Option<(Time, T)>);

impl<T> Default for Held<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Clone> Held<T> {
    fn or_before(&mut self, time: Time, shown: Option<T>) -> Option<T> {
        self.0 = match shown {
            Some(shown) => Some((time, shown)),
            None => self.0.take().filter(|(last, _)| time.seconds_since(*last).abs() <= HELD_S),
        };
        self.0.as_ref().map(|(_, shown)| shown.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_shown_last_holds_for_a_second() {
        let at = |ms: i64| Time::from_nanos(ms * 1_000_000);
        let mut held = Held::default();
        assert_eq!(held.or_before(at(0), None), None);
        assert_eq!(held.or_before(at(50), Some(3)), Some(3));
        assert_eq!(held.or_before(at(100), Some(4)), Some(4));
        for (ms, expected) in [(100, Some(4)), (150, Some(4)), (1100, Some(4)), (1101, None), (1101, None)] {
            assert_eq!(held.or_before(at(ms), None), expected, "{ms} ms");
        }
    }
}
