//! What keeps a force from being a good one: taxels that cannot be read where something lies, or that read too much.

use taxel_skin::counted;

use super::{Force, ZeroState};
use crate::force::measure::Touch;
use crate::force::reason::{Reason, ReasonCode, positions};
use crate::force::sample::{ForceSample, ForceState};
use crate::scan::Scan;

/// So many uncovered taxels may be anywhere without a force being called degraded: a load on them alone is smaller than a
/// fingertip.
const UNCOVERED_MAX: usize = 2;

/// One active taxel may be noise: of 250 one passes its threshold in every twentieth scan. Two beside the same taxel seldom are.
const CONTACT_TAXELS_MIN: usize = 2;

impl Force {
    /// Completes a force: its state, whether anything bounds it, and the reasons where it is not good or nothing does. Only what touches the total degrades it; the rest
    /// is the health's. A good sample, as nearly all are, asks for no memory here.
    pub(super) fn judge(
        &self,
        scan: &Scan<'_>,
        touch: &Touch,
        in_total: &[u16],
        zero: &ZeroState,
        sample: &mut ForceSample,
    ) {
        let stale = sample.stale as usize;
        let mut reasons = Vec::new();
        if stale > 0 {
            let text = counted(stale, "taxel is silent", "taxels are silent");
            reasons.push(Reason::about(self.silent(scan), ReasonCode::TaxelsSilent, text));
        }
        let beside_unbounded = in_total.len() >= CONTACT_TAXELS_MIN && self.beside(scan, touch, sample, &mut reasons);
        if self.uncovered.len() > UNCOVERED_MAX.max(stale) {
            self.add_uncovered(&mut reasons);
        }
        if sample.out_of_range > 0 {
            let beyond = self.out_of_range(scan, in_total);
            let text =
                counted(beyond.len(), "taxel reads", "taxels read") + " more than was calibrated: no upper bound";
            reasons.push(Reason::about(beyond, ReasonCode::TaxelsOutOfRange, text));
        }
        reasons.extend(zero.load_vanished.iter().chain(&zero.shortcoming).cloned());
        sample.unbounded = beside_unbounded
            || stale > 0
            || !self.uncovered.is_empty()
            || sample.out_of_range > 0
            || zero.load_vanished.is_some();
        sample.state = if reasons.is_empty() { ForceState::Ok } else { ForceState::Degraded };
        if sample.state == ForceState::Ok && sample.unbounded {
            self.add_uncovered(&mut reasons);
        }
        sample.reasons = reasons;
    }

    /// What is said of unread taxels beside a contact, and whether more may lie on them than the contact itself.
    fn beside(&self, scan: &Scan<'_>, touch: &Touch, sample: &ForceSample, reasons: &mut Vec<Reason>) -> bool {
        if touch.missing.is_empty() {
            return false; // nearly always
        }
        let watched = || self.watched.iter().filter(|watched| touch.missing.binary_search(&watched.taxel).is_ok());
        let faulty = positions(watched().filter(|watched| watched.has_fault).map(|watched| watched.taxel));
        let loaded = positions(watched().filter(|watched| watched.reads_a_load(scan)).map(|watched| watched.taxel));
        let more = sample.total.is_none_or(|total| self.model.unread_at_most_n(touch) > total.0);
        if !faulty.is_empty() {
            let text =
                counted(faulty.len(), "taxel beside the contact has a fault", "taxels beside the contact have a fault");
            reasons.push(Reason::about(faulty, ReasonCode::TaxelsFaulty, text));
        }
        if !loaded.is_empty() {
            let text = counted(loaded.len(), "taxel that cannot be used reads", "taxels that cannot be used read")
                + " a load: no upper bound";
            reasons.push(Reason::about(loaded.clone(), ReasonCode::TaxelsExcluded, text));
        } else if more {
            let missing = positions(touch.missing.iter().copied());
            let text = format!(
                "more than the contact itself may lie on {} beside it that cannot be read: no upper bound",
                counted(missing.len(), "taxel", "taxels")
            );
            reasons.push(Reason::about(missing, ReasonCode::TaxelsExcluded, text));
        }
        more || !loaded.is_empty()
    }

    fn add_uncovered(&self, reasons: &mut Vec<Reason>) {
        let text =
            counted(self.uncovered.len(), "taxel", "taxels") + " cannot be read, nor can those beside: no upper bound";
        reasons.push(Reason::about(std::sync::Arc::clone(&self.uncovered), ReasonCode::TaxelsExcluded, text));
        let without_zero = positions(self.without_zero());
        if !without_zero.is_empty() {
            let text = format!(
                "{} no zero, because of a fault or a movement when it was taken: unload the skin and tare",
                counted(without_zero.len(), "taxel has", "taxels have")
            );
            reasons.push(Reason::about(without_zero, ReasonCode::TaxelsWithoutZero, text));
        }
    }

    fn without_zero(&self) -> impl Iterator<Item = usize> + '_ {
        let has_zero = |taxel: usize| self.evaluator.as_ref().is_some_and(|evaluator| evaluator.tables().has(taxel));
        self.watched.iter().map(|watched| watched.taxel).filter(move |&taxel| !has_zero(taxel))
    }

    /// Taxels of modules that are silent, ascending.
    pub(super) fn silent(&self, scan: &Scan<'_>) -> Vec<u16> {
        let modules = self.model.layout().modules.iter().zip(scan.silent).filter(|(_, silent)| **silent);
        let mut taxels = positions(modules.flat_map(|(taxels, _)| taxels.clone()));
        taxels.sort_unstable();
        taxels
    }

    /// Those of `active`, which count in the total, that read more than was calibrated.
    fn out_of_range(&self, scan: &Scan<'_>, active: &[u16]) -> Vec<u16> {
        let Some(evaluator) = &self.evaluator else { return Vec::new() };
        let above = |&taxel: &u16| {
            let taxel = usize::from(taxel);
            let share = scan.counts.raw(taxel).and_then(|count| evaluator.tables().share(taxel, count));
            share.is_some_and(|share| share.is_above)
        };
        active.iter().copied().filter(above).collect()
    }
}
