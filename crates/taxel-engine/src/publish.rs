//! What readers see of a patch: the force sample, its state and its reasons.

use std::sync::Arc;

use crate::faults::FaultSet;
use crate::io::{Now, Output};
use crate::patch::PatchEngine;
use crate::snapshot::{ForceSample, ForceState, PatchSnapshot, TaxelState};

impl PatchEngine {
    /// Publishes the present state under the next sequence number.
    pub(crate) fn publish(&mut self, now: Now, out: &mut Vec<Output>) {
        self.select_taxels();
        self.sequence += 1;
        self.dirty = false;
        let time = self.live.newest();
        let age_ns = now.time.as_nanos().saturating_sub(time.as_nanos());
        let snapshot = PatchSnapshot {
            sequence: self.sequence,
            time,
            wall_ns: now.wall_ns.saturating_sub(age_ns),
            force: self.force(),
            taxels: self.taxel_states(),
            tare: Some(self.tare.view().clone()),
        };
        out.push(Output::Patch(self.index, Arc::new(snapshot)));
    }

    /// Keeps silent and faulty taxels out of the sum; done anew only when one of them changed.
    fn select_taxels(&mut self) {
        let Some(evaluator) = &mut self.evaluator else {
            self.uncovered_share = 1.0;
            return;
        };
        let (faults, modules) = (&self.faults, self.live.modules());
        let sites = self.plan.patch.taxels();
        let present = || (0..sites.len()).map(|t| (faults.faults(t), modules[sites[t].module as usize].stale));
        if self.selected_with.iter().copied().eq(present()) {
            return;
        }
        self.selected_with = present().collect();
        let sound = &self.selected_with;
        evaluator.select(|taxel| sound[taxel] == (FaultSet::default(), false));
        self.uncovered_share = self.parts.uncovered_share(evaluator);
    }

    fn force(&self) -> ForceSample {
        let taxels = self.plan.patch.taxels().len();
        let stale = self.stale_taxels();
        let model_set = self.model_set.as_ref().map(|set| Arc::from(set.id.as_str()));
        let nothing = |state, reason: String| ForceSample {
            state,
            reasons: vec![reason],
            stale: stale as u32,
            excluded: taxels as u32,
            uncovered_share: 1.0,
            model_set: model_set.clone(),
            ..ForceSample::default()
        };
        if self.model_set.is_none() {
            return nothing(ForceState::Uncalibrated, "no model set is active".to_owned());
        }
        if stale as f64 > self.plan.live.stale_share_max * taxels as f64 {
            return nothing(ForceState::Stale, format!("{stale} of {taxels} taxels are silent"));
        }
        let Some(evaluator) = &self.evaluator else {
            return nothing(ForceState::TareInvalid, self.tare.view().reason.clone());
        };
        let mut sample = self.parts.measure(evaluator, self.live.counts());
        let usable = evaluator.selected().count();
        if usable == 0 {
            return nothing(ForceState::Uncalibrated, "no taxel has a usable model and is free of faults".to_owned());
        }
        sample.stale = stale as u32;
        sample.excluded = (taxels - usable).saturating_sub(stale) as u32;
        sample.uncovered_share = self.uncovered_share;
        self.name_shortcomings(&mut sample);
        sample
    }

    fn name_shortcomings(&self, sample: &mut ForceSample) {
        if sample.stale > 0 {
            sample.reasons.push(format!("{} taxels are silent", sample.stale));
        }
        let faulty = self.selected_with.iter().filter(|(faults, stale)| !faults.is_empty() && !stale).count();
        if faulty > 0 {
            sample.reasons.push(format!("{faulty} taxels have a fault"));
        }
        if sample.out_of_range > 0 {
            let n = sample.out_of_range;
            sample.reasons.push(format!("{n} active taxels read more than was calibrated: the total is a lower bound"));
        }
        if let Some(lift) = &self.lift {
            sample.reasons.push(format!("{lift}: the zero may have been taken under a load; tare again"));
        }
        sample.state = if sample.reasons.is_empty() { ForceState::Ok } else { ForceState::Degraded };
    }

    fn stale_taxels(&self) -> usize {
        let modules = self.live.modules().iter().zip(self.plan.patch.modules());
        modules.filter(|(live, _)| live.stale).map(|(_, site)| site.kind.taxel_slots().len()).sum()
    }

    fn taxel_states(&self) -> Arc<[TaxelState]> {
        let sites = self.plan.patch.taxels();
        let states = sites.iter().zip(self.live.counts()).enumerate().map(|(taxel, (site, &count))| {
            let module = &self.live.modules()[site.module as usize];
            let reading = self.evaluator.as_ref().and_then(|e| e.reading(taxel, count));
            let served = reading.filter(|_| !module.stale);
            TaxelState {
                count,
                time: module.last.unwrap_or_default(),
                seen: module.last.is_some(),
                stale: module.stale,
                active: served.is_some_and(|r| r.active),
                calibrated: self.model_set.as_ref().is_some_and(|s| s.taxels[taxel].is_usable()),
                range: served.map(|r| r.range).unwrap_or_default(),
                faults: self.faults.faults(taxel),
                pressure_kpa: served.map(|r| r.pressure_kpa),
                sigma_kpa: served.map(|r| r.sigma_kpa),
            }
        });
        states.collect()
    }
}
