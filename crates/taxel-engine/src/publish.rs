//! What readers see of a patch: the force sample, its state and its reasons.

use std::sync::Arc;

use crate::force::Present;
use crate::io::{Now, Output};
use crate::live::ModuleLive;
use crate::patch::PatchEngine;
use crate::snapshot::{ForceSample, ForceState, PatchSnapshot};
use crate::taxels::{ModuleMoment, Moment, Taxels};

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
            seen: self.live.modules().iter().any(|module| module.last.is_some()),
            taxels: self.taxels(),
            tare: Some(self.tare.view().clone()),
        };
        out.push(Output::Patch(self.index, Arc::new(snapshot)));
    }

    /// Notes faults and silence, and keeps such taxels out of the sum; done anew only when one of them changed.
    fn select_taxels(&mut self) {
        let (faults, modules, module_of) = (&self.faults, self.live.modules(), &self.module_of);
        let silent = |taxel: usize| modules[usize::from(module_of[taxel])].stale;
        let taxels = 0..module_of.len();
        let same_faults = self.faults_seen.iter().copied().eq(taxels.clone().map(|t| faults.faults(t)));
        if !same_faults {
            self.faults_seen = taxels.clone().map(|t| faults.faults(t)).collect();
        }
        let Some(evaluator) = &mut self.evaluator else {
            self.uncovered_share = 1.0;
            return;
        };
        if same_faults && self.selected_with.iter().copied().eq(taxels.clone().map(silent)) {
            return;
        }
        self.selected_with = taxels.map(silent).collect();
        let (silent, faults) = (&self.selected_with, &self.faults_seen);
        evaluator.select(|taxel| !silent[taxel] && faults[taxel].is_empty());
        self.uncovered_share = self.parts.uncovered_share(evaluator);
    }

    fn force(&self) -> ForceSample {
        let taxels = self.plan.patch.taxels().len();
        let stale = self.stale_taxels();
        let model_set = || self.model_set.as_ref().map(|set| Arc::from(set.id.as_str()));
        let nothing = |state, reason: String| ForceSample {
            state,
            reasons: vec![reason],
            stale: stale as u32,
            excluded: taxels as u32,
            uncovered_share: 1.0,
            model_set: model_set(),
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
        let (uncovered_share, zero_sigma_counts) = (self.uncovered_share, self.drift_sigma_counts());
        let present = Present { uncovered_share, zero_sigma_counts };
        let mut sample = self.parts.measure(evaluator, self.live.counts(), present);
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
        let faulty = self.faults_seen.iter().zip(&self.selected_with);
        let faulty = faulty.filter(|(faults, silent)| !faults.is_empty() && !**silent).count();
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
        sample.reasons.extend(self.zero_shortcomings());
        sample.state = if sample.reasons.is_empty() { ForceState::Ok } else { ForceState::Degraded };
    }

    /// What the states of the taxels can be worked out from later: copies of what changes, and what is shared.
    fn taxels(&self) -> Taxels {
        let moment = |module: &ModuleLive| ModuleMoment { last: module.last, stale: module.stale };
        Taxels::of(Moment {
            counts: self.live.counts().into(),
            modules: self.live.modules().iter().map(moment).collect(),
            module_of: Arc::clone(&self.module_of),
            faults: Arc::clone(&self.faults_seen),
            tables: self.evaluator.as_ref().map(|e| Arc::clone(e.tables())),
            bend_kpa: self.evaluator.as_ref().and_then(|e| e.bent().cloned()),
            model_set: self.model_set.clone(),
        })
    }

    fn stale_taxels(&self) -> usize {
        let modules = self.live.modules().iter().zip(self.plan.patch.modules());
        modules.filter(|(live, _)| live.stale).map(|(_, site)| site.kind.taxel_slots().len()).sum()
    }
}
