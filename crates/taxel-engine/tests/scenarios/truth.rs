//! The judge of all that is published: the true force is known, so a force whose interval does not hold it is a lie.

use std::collections::VecDeque;

use taxel_engine::snapshot::ForceSample;

use crate::bench::Bench;
use crate::judge::{LIE_SIGMAS, Stated, judge};

/// A snapshot shows counts that were converted up to two periods and a transmission ago: 16 slots of 10 ms.
const LAG_SLOTS: usize = 16;

/// The least and the greatest true force that each snapshot may have been made of.
#[derive(Default)]
pub struct Truth {
    recent: VecDeque<f64>,
    ranges: Vec<(f64, f64)>,
}

impl Truth {
    /// The true force of a slot, at whose end there are so many snapshots in all.
    pub fn note(&mut self, newton: f64, snapshots: usize) {
        self.recent.truncate(LAG_SLOTS - 1);
        self.recent.push_front(newton);
        let least = self.recent.iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.recent.iter().copied().fold(0.0, f64::max);
        self.ranges.resize(snapshots, (least, most));
    }
}

/// What is wrong with a force, if the truth lies between these.
fn lie(force: &ForceSample, truth: (f64, f64)) -> Option<String> {
    let stated = Stated::of(force)?.interval(LIE_SIGMAS);
    judge(stated, truth)
        .map(|_| format!("{truth:.3?} N are told as {:?} {stated:.3?} N ({})", force.state, force.why()))
}

impl Bench {
    /// A place in what is published, to judge from.
    pub fn mark(&self) -> usize {
        self.host.snapshots.len()
    }

    /// Everything that was published since `mark` and is not true.
    pub fn lies_since(&self, mark: usize) -> Vec<String> {
        let judged = self.host.snapshots.iter().zip(&self.truth.ranges).enumerate().skip(mark);
        judged
            .filter_map(|(n, (s, truth))| Some(format!("snapshot {}: {}", n - mark, lie(&s.force, *truth)?)))
            .collect()
    }

    /// Nothing that was published since `mark` is a lie.
    pub fn is_truthful_since(&self, mark: usize, story: &str) {
        let lies = self.lies_since(mark);
        let judged = self.host.snapshots.len() - mark;
        assert!(lies.is_empty(), "{story}: {} lies of {judged} snapshots, the first: {}", lies.len(), lies[0]);
    }

    /// Whether some snapshot since `mark` has a force.
    pub fn has_force_since(&self, mark: usize) -> bool {
        self.host.snapshots[mark..].iter().any(|s| s.force.total.is_some())
    }
}
