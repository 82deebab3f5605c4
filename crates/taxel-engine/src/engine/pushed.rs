//! Scans that a program hands over: they enter a patch as those of described devices do.

use crate::boundary::command::{Done, Reply};
use crate::boundary::pushed::PushedScan;
use crate::engine::step::Engine;
use crate::intake::health::{BusNotice, BusState};
use crate::now::Now;
use crate::request::ErrorReason;

impl Engine {
    pub(super) fn begin_push(&mut self, now: Now, patch: &str) -> Reply {
        let index = self.patch_named(patch)?;
        let plan = &self.plan.patches[index];
        if let Some(gauge) = plan.gauge.as_ref().filter(|gauge| gauge.pushed) {
            let bus = usize::from(gauge.bus.0);
            self.buses.get_mut(bus).into_iter().for_each(|line| drop(line.on_notice(now.time, BusNotice::Up)));
            self.health_dirty.0 = true;
            return Ok(Done::PushBegun);
        }
        ErrorReason::NotPushed.unless(plan.pushed.is_some(), || {
            let name = self.patches[index].name();
            format!("the scans of patch `{name}` come over its bus, and its gauge's readings too: nobody can push any")
        })?;
        if let Some(line) = self.line_of(index) {
            line.on_notice(now.time, BusNotice::Up);
        }
        self.health_dirty.0 = true;
        self.with_patch(now, index, |patch| patch.begin_push(now));
        Ok(Done::PushBegun)
    }

    /// The service has seen to it that the patch takes pushed scans, and that this is one of it.
    pub(super) fn on_pushed(&mut self, now: Now, scan: &PushedScan) {
        self.health_dirty.1 = true;
        let news = self.line_of(scan.patch).is_some_and(|line| {
            line.health.frames += 1;
            line.on_frames(now.time)
        });
        self.health_dirty.0 |= news;
        // As with frames: what it brings about happens at its own time.
        let now = now.at(scan.time);
        self.with_patch(now, scan.patch, |patch| patch.on_pushed(now, scan));
    }

    /// The state of what the scans of a patch come over.
    fn line_of(&mut self, patch: usize) -> Option<&mut BusState> {
        let bus = self.plan.patches.get(patch)?.patch.boards().first()?.bus;
        self.buses.get_mut(usize::from(bus.0))
    }
}
