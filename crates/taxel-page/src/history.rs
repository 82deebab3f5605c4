//! The forces of the last ten minutes, so that a page that opens later has them, too.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use serde_json::{Value, json};
use taxel_proto::judge::{judge, word};
use taxel_proto::v1::{ForceSample, ForceState};
use taxel_rpc::{Handle, PatchFollower};
use taxel_skin::Time;

/// For so long a force is kept.
const KEPT: Duration = Duration::from_secs(600);

/// Of the forces of so long a time the greatest is kept.
const EVERY: Duration = Duration::from_millis(500);

/// More points than this are not kept of a patch whose force comes and goes all the time.
const POINTS_MAX: usize = 4800;

/// What is kept, by the position of the patch in the plan.
pub(crate) struct History {
    handle: Handle,
    patches: Vec<Mutex<VecDeque<Point>>>,
}

struct Point {
    at: Time,
    state: ForceState,
    /// Total, low and high end in N; `None` where the sample was no force that may be acted on.
    newton: Option<[Option<f64>; 3]>,
}

impl History {
    /// Nothing yet.
    pub(crate) fn new(handle: Handle) -> Self {
        let patches = (0..handle.patches()).map(|_| Mutex::default()).collect();
        Self { handle, patches }
    }

    /// Keeps the forces of the patch at this position of the plan until the engine stops.
    pub(crate) async fn keep(&self, patch: usize) {
        let Some(mut forces) = PatchFollower::new(&self.handle, patch) else { return };
        while let Some((sample, _)) = forces.next(false).await {
            self.take(patch, &sample);
        }
    }

    fn take(&self, patch: usize, sample: &ForceSample) {
        let newton = judge(sample, Duration::ZERO, None).ok().map(|_| [sample.total_n, sample.low_n, sample.high_n]);
        let new = Point { at: self.handle.now(), state: sample.state(), newton };
        let mut points = self.patches[patch].lock().unwrap_or_else(PoisonError::into_inner);
        match points.back_mut() {
            // A sample that is no force is never hidden by one that is.
            Some(last) if new.at.since(last.at) < EVERY && last.newton.is_some() == new.newton.is_some() => {
                if new.newton > last.newton {
                    *last = Point { at: last.at, ..new };
                }
            }
            _ => points.push_back(new),
        }
        let old = |point: &Point| self.handle.now().since(point.at) > KEPT;
        while points.len() > POINTS_MAX || points.front().is_some_and(old) {
            points.pop_front();
        }
    }

    /// Oldest first: how many seconds ago, state, total, low and high end in N.
    pub(crate) fn of(&self, patch: &str) -> Option<Value> {
        let points = self.patches.get(self.handle.position(patch)?)?.lock().unwrap_or_else(PoisonError::into_inner);
        let now = self.handle.now();
        let told = |Point { at, state, newton }: &Point| {
            let [total, low, high] = newton.unwrap_or_default();
            json!([now.since(*at).as_secs_f64(), word(*state), total, low, high])
        };
        Some(points.iter().map(told).collect())
    }
}
