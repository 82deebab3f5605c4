//! What keeps a force from being a good one: taxels that cannot be read where something may lie, or that read too much.

use std::sync::Arc;

use super::{Bound, Force, ZeroState};
use crate::force::reason::{Reason, ReasonCode, positions};
use crate::force::touch::Touch;
use crate::scan::Scan;

/// So many blind taxels may be anywhere without a force being called degraded: a load on them alone is smaller than a
/// fingertip.
const BLIND_TAXELS_BORNE: u32 = 2;

/// A taxel without a zero that lies so far towards load from where it was calibrated may bear one, counts: from day to day a
/// taxel moves by less (see [`crate::zero::rest::RestLimits::moved_second_max`]).
const LOADED_COUNTS: f64 = 16.0;

impl Force {
    /// Taxels with a fault under the contact or at its rim. Without positions nobody knows, and all count.
    pub(super) fn faulty_beside(&self, touch: &Touch) -> Vec<u16> {
        let Some(neighbours) = self.model.neighbours() else { return positions(self.faulty.iter().copied()) };
        if self.faulty.is_empty() || touch.active.is_empty() {
            return Vec::new();
        }
        let touched = |taxel: usize| touch.active.iter().any(|&(active, _)| active == taxel);
        positions(self.faulty.iter().copied().filter(|&taxel| neighbours.of(taxel).any(touched)))
    }

    /// Whether a taxel with a fault reads a load: one at the end of its range stands as still under a load as a broken one,
    /// and bears more of it than those beside it tell.
    pub(super) fn is_pressed(&self, scan: &Scan<'_>, taxel: usize) -> bool {
        let (Some(evaluator), Some(zero)) = (&self.evaluator, &self.zero) else { return false };
        let rest = zero[taxel];
        let pressed = scan.counts.units(taxel).map(|count| evaluator.tables().sign(taxel) * (count - rest.mean));
        pressed.is_some_and(|counts| counts > self.plan.activation.distance_counts(rest.noise))
    }

    /// Whether any taxel with a fault reads a load.
    pub(super) fn is_a_faulty_one_pressed(&self, scan: &Scan<'_>) -> bool {
        self.faulty.iter().any(|&taxel| self.is_pressed(scan, taxel))
            || self.faulty_without_zero.iter().any(|taxel| is_loaded(scan, taxel))
    }

    /// Taxels of modules that are silent, ascending.
    pub(super) fn silent(&self, scan: &Scan<'_>) -> Vec<u16> {
        let modules = self.plan.layout.modules.iter().zip(scan.silent).filter(|(_, silent)| **silent);
        let mut taxels = positions(modules.flat_map(|(taxels, _)| taxels.clone()));
        taxels.sort_unstable();
        taxels
    }

    /// Taxels without a fault and without a zero that read so much more than when they were calibrated that a load may lie on
    /// them: what came while the zero was taken and lies on one taxel alone.
    pub(super) fn loaded_without_zero(&self, scan: &Scan<'_>) -> Option<Arc<[u16]>> {
        let mut loaded = self.live_without_zero.iter().filter(|taxel| is_loaded(scan, taxel)).peekable();
        loaded.peek()?;
        Some(loaded.map(|&(taxel, ..)| taxel).collect())
    }

    /// Those of `active`, which count in the total, that read more than was calibrated.
    pub(super) fn out_of_range(&self, scan: &Scan<'_>, active: &[u16]) -> Arc<[u16]> {
        let Some(evaluator) = &self.evaluator else { return Arc::default() };
        let above = |&taxel: &u16| {
            let taxel = usize::from(taxel);
            let share = scan.counts.raw(taxel).and_then(|count| evaluator.tables().share(taxel, count));
            share.is_some_and(|share| share.above > 0.0)
        };
        active.iter().copied().filter(above).collect()
    }

    /// Only what touches the total degrades it; the rest is the health's. A good sample, as nearly all are, asks for no
    /// memory here. `stale` is how many taxels are silent, `faulty` those with a fault under the contact or at its rim.
    pub(super) fn shortcomings(
        &self,
        scan: &Scan<'_>,
        stale: u32,
        faulty: Vec<u16>,
        bound: Bound,
        zero: &ZeroState,
    ) -> Vec<Reason> {
        use ReasonCode::{TaxelsBlind, TaxelsFaulty, TaxelsOutOfRange, TaxelsSilent, TaxelsWithoutZero};
        let mut reasons = Vec::new();
        if stale > 0 {
            let text = format!("{stale} taxels are silent");
            reasons.push(Reason::about(self.silent(scan), TaxelsSilent, text));
        }
        if !faulty.is_empty() {
            let pressed = faulty.iter().any(|&taxel| self.is_pressed(scan, usize::from(taxel)));
            let bound = if pressed { " and may bear more than is read: the total is a lower bound" } else { "" };
            let text = format!("{} taxels have a fault{bound}", faulty.len());
            reasons.push(Reason::about(faulty, TaxelsFaulty, text));
        }
        if self.coverage.blind > BLIND_TAXELS_BORNE && self.coverage.blind > stale {
            let blind = self.coverage.blind;
            let beside = if self.model.neighbours().is_some() {
                "and so are those beside them"
            } else {
                "or may be, as no positions tell whether those beside them are out of use, too"
            };
            let text = format!("{blind} taxels are blind, {beside}: the total is a lower bound");
            reasons.push(Reason::about(Arc::clone(&self.blind), TaxelsBlind, text));
            if !self.without_zero.is_empty() {
                let n = self.without_zero.len();
                let why =
                    "had a fault or moved when the zero was taken and have none: a new one at rest brings them back";
                let text = format!("{n} taxels with a model {why}");
                reasons.push(Reason::about(Arc::clone(&self.without_zero), TaxelsWithoutZero, text));
            }
        } else if let Some(n) = bound.beside {
            let text =
                format!("more of a contact than the uncertainty holds may lie on {n} taxels that cannot be read");
            reasons.push(Reason::new(TaxelsBlind, format!("{text}: the total is a lower bound")));
        }
        if let Some(loaded) = bound.loaded {
            let n = loaded.len();
            let text = format!(
                "{n} taxels without a zero read more than {LOADED_COUNTS} counts towards load since the calibration"
            );
            reasons.push(Reason::about(loaded, TaxelsWithoutZero, format!("{text}: the total is a lower bound")));
        }
        if let Some(beyond) = bound.beyond_range {
            let text =
                format!("{} taxels have read more than was calibrated: the total is a lower bound", beyond.len());
            reasons.push(Reason::about(beyond, TaxelsOutOfRange, text));
        }
        reasons.extend(zero.load_vanished.iter().chain(&zero.shortcoming).cloned());
        reasons
    }
}

/// Whether a taxel without a zero, with that of the models and the way that load moves it, lies far towards load.
fn is_loaded(scan: &Scan<'_>, &(taxel, zero, sign): &(u16, f64, f64)) -> bool {
    scan.counts.units(usize::from(taxel)).is_some_and(|count| sign * (count - zero) > LOADED_COUNTS)
}
