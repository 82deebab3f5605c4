//! What readers see of a patch.

use std::sync::Arc;

use taxel_skin::Newton;

use crate::boundary::output::Output;
use crate::boundary::snapshot::PatchSnapshot;
use crate::force::reason::ReasonCode;
use crate::force::taxels::{Basis, ModuleAge, Taxels};
use crate::now::Now;
use crate::patch::owner::{Intent, Patch};
use crate::zero::view::TareView;

impl Patch {
    /// Publishes the present state under the next sequence number.
    pub(super) fn publish(&mut self, now: Now) {
        self.dirty = false;
        self.sequence += 1;
        let scan = self.intake.scan();
        let mut measured = self.force.sample(&scan, self.intake.silent_taxels(), &self.zero.state());
        let is_felt = measured.sample.low().is_some_and(|low| low > Newton(0.0));
        self.felt = measured.sample.total.map(|total| (total, if is_felt { measured.active.len() } else { 0 }));
        let time = self.intake.newest().unwrap_or_default();
        let tare = self.tare_view();
        measured.sample.zero_epoch = tare.epoch;
        if let Some(read) = self.loads.on_sample(time, tare.epoch, &measured) {
            self.intents.push(Intent::Load(read));
        }
        if self.faults.0 != Some(scan.soundness) {
            self.faults = (Some(scan.soundness), (0..self.taxels()).map(|t| self.intake.faults(t)).collect());
        }
        let age_ns = now.time.as_nanos().saturating_sub(time.as_nanos());
        let snapshot = PatchSnapshot {
            sequence: self.sequence,
            time,
            wall_ns: now.wall_ns.saturating_sub(age_ns),
            seen: self.intake.newest().is_some(),
            simulated: self.plan.simulated,
            taxels: self.taxel_states(measured.active),
            force: measured.sample,
            tare: Some(tare),
        };
        self.out.push(Output::Patch(self.index, Arc::new(snapshot)));
    }

    /// Without models a zero is of no use, and a tare cannot be proven: a calibration takes its own.
    fn tare_view(&self) -> TareView {
        let mut view = self.zero.view();
        let not_yet = matches!(view.code, Some(ReasonCode::ZeroNotTaken | ReasonCode::NotUnloaded));
        if let Some(why) = self.force.lacks_models().filter(|_| not_yet) {
            view.reason = why.text().to_owned();
        }
        view
    }

    /// What the states of the taxels can be worked out from later: copies of what changes, and what is shared.
    fn taxel_states(&self, active: Box<[u16]>) -> Taxels {
        let scan = self.intake.scan();
        let ages = self.intake.last_heard().zip(scan.silent).map(|(last, &stale)| ModuleAge { last, stale });
        let (tables, offsets) = self.force.tables().unzip();
        Taxels::of(Basis {
            counts: scan.counts.into(),
            modules: ages.collect(),
            module_of: Arc::clone(self.intake.regions().module_of()),
            faults: Arc::clone(&self.faults.1),
            tables,
            offsets: offsets.flatten(),
            active,
            model_set: self.force.models().cloned(),
        })
    }
}
