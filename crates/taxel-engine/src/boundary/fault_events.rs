//! Which faults of taxels an operator is told of, and when they are over.
//!
//! A taxel at the end of its range, or with a bad contact, comes and goes for hours. A fault is told when it comes. That it is
//! over is told when the taxel's faults have stayed as they are for [`HOLD_OFF_NS`]; what comes and goes faster is one fault.

use std::fmt::Write;
use std::sync::Arc;

use crate::boundary::events::EventKind;
use crate::intake::faults::fault::{Fault, FaultSet};

/// Taxels are looked at so often.
const EVERY_NS: i64 = 1_000_000_000;
/// A taxel's faults that have not changed for so long have ended.
const HOLD_OFF_NS: i64 = 60_000_000_000;

/// What was told of one taxel.
#[derive(Clone, Copy, Debug, Default)]
struct Taxel {
    told: FaultSet,
    seen: FaultSet,
    /// When what was seen changed last, nanoseconds since 1970.
    changed_ns: i64,
}

/// What was told of a patch's taxels.
#[derive(Debug)]
pub struct FaultLog {
    taxels: Vec<Taxel>,
    looked_ns: i64,
}

/// A sort of event, what it says, and the taxels that it is about, ascending.
pub type Told = (EventKind, String, Vec<u16>);

impl FaultLog {
    /// Nothing was told yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { taxels: Vec::new(), looked_ns: i64::MIN }
    }

    /// Takes the faults of all taxels at a time, nanoseconds since 1970. Returns what is news.
    pub fn look(&mut self, wall_ns: i64, now: &Arc<[FaultSet]>) -> Vec<Told> {
        if wall_ns.saturating_sub(self.looked_ns) < EVERY_NS && wall_ns >= self.looked_ns {
            return Vec::new(); // what is different by then is told then
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
            *came = now.without(taxel.told);
            taxel.told = taxel.told.and(*came);
            if wall_ns.saturating_sub(taxel.changed_ns) >= HOLD_OFF_NS {
                *went = taxel.told.without(now);
                taxel.told = now;
            }
        }
        let told = [(EventKind::FaultsCame, came), (EventKind::FaultsWent, went)].into_iter();
        told.filter_map(|(kind, changed)| in_words(&changed).map(|(text, taxels)| (kind, text, taxels))).collect()
    }
}

/// Which faults of how many taxels, and which taxels these are; `None` of none.
fn in_words(changed: &[FaultSet]) -> Option<(String, Vec<u16>)> {
    let taxels: Vec<u16> = (0..).zip(changed).filter(|(_, set)| !set.is_empty()).map(|(taxel, _)| taxel).collect();
    let mut text = String::new();
    for fault in Fault::ALL {
        let count = changed.iter().filter(|set| set.contains(fault)).count();
        if count > 0 {
            let comma = if text.is_empty() { "" } else { ", " };
            let _ = write!(text, "{comma}{} of {count} taxels", fault.name()); // a String takes all
        }
    }
    (!taxels.is_empty()).then_some((text, taxels))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is told second by second of taxel 1 of 3, which has a rail fault in these seconds.
    fn told(seconds: i64, at_its_rail: impl Fn(i64) -> bool) -> Vec<(i64, EventKind, String, Vec<u16>)> {
        let mut log = FaultLog::new();
        let rail = |on: bool| if on { FaultSet::default().with(Fault::Rail) } else { FaultSet::default() };
        let mut all = Vec::new();
        for second in 0..seconds {
            let faults = Arc::from([FaultSet::default(), rail(at_its_rail(second)), FaultSet::default()]);
            let news = log.look(1_700_000_000_000_000_000 + second * 1_000_000_000, &faults);
            all.extend(news.into_iter().map(|(kind, text, taxels)| (second, kind, text, taxels)));
        }
        all
    }

    #[test]
    fn a_taxel_at_its_rail_that_comes_and_goes_is_one_fault_that_ends_after_a_minute_of_rest() {
        let (rail, taxels) = ("rail of 1 taxels".to_owned(), vec![1]);
        let all = told(3_700, |second| (10..3_600).contains(&second) && second % 3 != 0);
        let expected = [
            (10, EventKind::FaultsCame, rail.clone(), taxels.clone()),
            (3_600 + 60, EventKind::FaultsWent, rail, taxels),
        ];
        assert_eq!(all, expected);
    }

    #[test]
    fn a_fault_that_comes_again_after_its_end_is_told_again() {
        let kinds =
            told(300, |second| second == 5 || second == 200).into_iter().map(|(second, kind, ..)| (second, kind));
        let came = EventKind::FaultsCame;
        assert_eq!(
            kinds.collect::<Vec<_>>(),
            [(5, came), (66, EventKind::FaultsWent), (200, came), (261, EventKind::FaultsWent)]
        );
    }
}
