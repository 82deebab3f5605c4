//! The judge of all that is published: the true force is known, so a force whose interval does not hold it is a lie.

use std::collections::VecDeque;

use taxel_engine::snapshot::{ForceSample, ForceState};

use crate::bench::Bench;

/// A snapshot shows counts that were converted up to two periods and a transmission ago: 16 slots of 10 ms.
const LAG_SLOTS: usize = 16;

/// Standard uncertainties on each side of the total.
const SIGMAS: f64 = 3.0;

/// The least and the greatest true force that each snapshot may have been made of.
#[derive(Default)]
pub struct Truth {
    recent: VecDeque<f64>,
    ranges: Vec<[f64; 2]>,
}

impl Truth {
    /// The true force of a slot, at whose end there are so many snapshots in all.
    pub fn note(&mut self, newton: f64, snapshots: usize) {
        self.recent.truncate(LAG_SLOTS - 1);
        self.recent.push_front(newton);
        let least = self.recent.iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.recent.iter().copied().fold(0.0, f64::max);
        self.ranges.resize(snapshots, [least, most]);
    }
}

/// What is wrong with a force, if the truth lies between these.
fn lie(force: &ForceSample, [least, most]: [f64; 2]) -> Option<String> {
    if !matches!(force.state, ForceState::Ok | ForceState::Degraded) {
        return None;
    }
    let (low, high) = (force.least(SIGMAS).expect("a force").0, force.most(SIGMAS).expect("what bounds it").0);
    let tells = || format!("{:?} {low:.3} to {high:.3} N ({})", force.state, force.why());
    if least > high && !force.unbounded {
        return Some(format!("at least {least:.3} N are told as {}", tells()));
    }
    (most < low).then(|| format!("at most {most:.3} N are told as {}", tells()))
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

#[test]
fn a_force_is_a_lie_when_its_interval_does_not_hold_the_truth() {
    use taxel_skin::Newton;
    let force = ForceSample {
        state: ForceState::Ok,
        total: Some(Newton(2.0)),
        total_sigma: Some(Newton(0.1)),
        undetected: Some(taxel_engine::snapshot::Undetected { newton: 0.5, sigma_n: 0.0 }),
        ..ForceSample::default()
    };
    assert_eq!(lie(&force, [2.0, 2.0]), None);
    assert_eq!(lie(&force, [1.8, 2.7]), None);
    assert!(lie(&force, [2.9, 3.0]).is_some_and(|lie| lie.contains("at least 2.900 N")));
    assert!(lie(&force, [0.0, 1.6]).is_some_and(|lie| lie.contains("at most 1.600 N")));
    assert_eq!(lie(&ForceSample { unbounded: true, ..force.clone() }, [2.9, 3.0]), None);
    assert_eq!(lie(&ForceSample { state: ForceState::Stale, ..force }, [9.0, 9.0]), None);
}
