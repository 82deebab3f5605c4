//! Which faults of taxels an operator hears of, and when they are over.
//!
//! A taxel at the end of its range, or with a bad contact, comes and goes for hours. A fault is reported when it comes. That it is
//! over is reported when the taxel's faults have stayed as they are for [`HOLD_OFF_NS`]; what comes and goes faster is one fault.

use std::fmt::Write;
use std::sync::Arc;

use taxel_skin::counted;

use crate::intake::faults::fault::{Fault, FaultSet};

/// Taxels are looked at so often.
const EVERY_NS: i64 = 1_000_000_000;
/// A taxel's faults that have not changed for so long have ended.
const HOLD_OFF_NS: i64 = 60_000_000_000;

/// What was reported of one taxel.
#[derive(Clone, Copy, Debug, Default)]
struct Taxel {
    reported: FaultSet,
    seen: FaultSet,
    /// When what was seen changed last, nanoseconds since 1970.
    changed_ns: i64,
}

/// What was reported of a patch's taxels.
#[derive(Debug)]
pub struct FaultLog {
    taxels: Vec<Taxel>,
    looked_ns: i64,
}

/// What of the faults is news: in words, and the taxels that it is about, ascending.
pub type News = (String, Vec<u16>);

impl FaultLog {
    /// Nothing was reported yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { taxels: Vec::new(), looked_ns: i64::MIN }
    }

    /// Takes the faults of all taxels at a time, nanoseconds since 1970. Returns which came, and which are over.
    pub fn look(&mut self, wall_ns: i64, now: &Arc<[FaultSet]>) -> [Option<News>; 2] {
        if wall_ns.saturating_sub(self.looked_ns) < EVERY_NS && wall_ns >= self.looked_ns {
            return [None, None]; // what is different by then is reported then
        }
        self.looked_ns = wall_ns;
        self.taxels.resize(now.len().max(self.taxels.len()), Taxel::default());
        let (mut came, mut went) = (vec![FaultSet::default(); self.taxels.len()], Vec::new());
        went.clone_from(&came);
        let news = self.taxels.iter_mut().zip(now.iter()).zip(came.iter_mut().zip(&mut went));
        for ((taxel, &now), (came, went)) in news {
            if now != taxel.seen || wall_ns < taxel.changed_ns {
                (taxel.seen, taxel.changed_ns) = (now, wall_ns);
            }
            *came = now.without(taxel.reported);
            taxel.reported = taxel.reported.and(*came);
            if wall_ns.saturating_sub(taxel.changed_ns) >= HOLD_OFF_NS {
                *went = taxel.reported.without(now);
                taxel.reported = now;
            }
        }
        [in_words(&came), in_words(&went)]
    }
}

/// Which faults of how many taxels, and which taxels these are; `None` of none.
fn in_words(changed: &[FaultSet]) -> Option<News> {
    let taxels: Vec<u16> = (0..).zip(changed).filter(|(_, set)| !set.is_empty()).map(|(taxel, _)| taxel).collect();
    let mut text = String::new();
    for fault in Fault::ALL {
        let count = changed.iter().filter(|set| set.contains(fault)).count();
        if count > 0 {
            let comma = if text.is_empty() { "" } else { ", " };
            let _ = write!(text, "{comma}{} ({})", counted(count, "taxel", "taxels"), fault.name()); // a String takes all
        }
    }
    (!taxels.is_empty()).then_some((text, taxels))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAME: usize = 0;
    const OVER: usize = 1;

    /// What is reported second by second of taxel 1 of 3, which has a rail fault in these seconds.
    fn reported(seconds: i64, at_its_rail: impl Fn(i64) -> bool) -> Vec<(i64, usize)> {
        let mut log = FaultLog::new();
        let rail = |on: bool| if on { FaultSet::default().with(Fault::Rail) } else { FaultSet::default() };
        let mut all = Vec::new();
        for second in 0..seconds {
            let faults = Arc::from([FaultSet::default(), rail(at_its_rail(second)), FaultSet::default()]);
            let news = log.look(1_700_000_000_000_000_000 + second * 1_000_000_000, &faults);
            for (sort, (text, taxels)) in news.into_iter().enumerate().filter_map(|(sort, news)| Some((sort, news?))) {
                assert_eq!((text.as_str(), taxels.as_slice()), ("1 taxel (saturated)", &[1][..]));
                all.push((second, sort));
            }
        }
        all
    }

    #[test]
    fn a_taxel_at_its_rail_that_comes_and_goes_is_one_fault_that_ends_after_a_minute_of_rest() {
        let all = reported(3_700, |second| (10..3_600).contains(&second) && second % 3 != 0);
        assert_eq!(all, [(10, CAME), (3_600 + 60, OVER)]);
    }

    #[test]
    fn a_fault_that_comes_again_after_its_end_is_told_again() {
        let all = reported(300, |second| second == 5 || second == 200);
        assert_eq!(all, [(5, CAME), (66, OVER), (200, CAME), (261, OVER)]);
    }
}
