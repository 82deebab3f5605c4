//! From the pressures of one scan to a force: total, its uncertainty, and the parts that the scene asks for.

mod find;
mod uncertainty;

use nalgebra::Vector3;
use std::ops::Range;
use std::sync::Arc;
use taxel_skin::{Geometry, Newton, NormalsVerdict, SquareMillimetre};

use crate::counts::Counts;
use crate::force::contacts::clusters;
use crate::force::evaluator::Evaluator;
use crate::force::neighbours::{Filled, Neighbours};
use crate::force::reason::positions;
use crate::force::remainder::Unseen;
use crate::force::sample::ForceSample;
use crate::force::sampling::{Contact, rim_sigma_n};
use crate::force::touch::Touch;
#[cfg(doc)]
use crate::scan::Scan;

/// A taxel at the corner of a module and those beside it.
const CORNER_TAXELS: usize = 3;

/// Which parts of a force sample are computed beside the total.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Resultant force vector; needs usable normals.
    pub resultant: bool,
    /// Moment about the patch origin and centre of pressure; needs usable normals.
    pub moment: bool,
    /// Clusters of touched taxels; needs positions.
    pub contacts: bool,
    /// The total includes pressures of excluded taxels, taken from their neighbours; needs positions.
    pub fill: bool,
}

/// What the force of a patch is worked out with.
#[derive(Clone, Debug)]
pub struct Layout {
    /// The area that each taxel stands for, one per taxel.
    pub areas: Vec<SquareMillimetre>,
    /// Relative standard uncertainty of the area that all taxels share.
    pub area_uncertainty: f64,
    /// Which parts of a sample are asked for.
    pub outputs: Outputs,
    /// Positions and normals, where the scene has them.
    pub geometry: Option<Geometry>,
    /// Which taxels form each module, ascending.
    pub modules: Vec<Range<usize>>,
    /// Two active taxels closer than this belong to one contact, in metres.
    pub contact_reach_m: f64,
}

/// The fixed part of a patch's force, worked out once from the plan.
#[derive(Clone, Debug)]
pub struct ForceModel {
    outputs: Outputs,
    areas_mm2: Vec<f64>,
    area_uncertainty: f64,
    geometry: Option<Geometry>,
    neighbours: Option<Neighbours>,
    contact_reach_m: f64,
    modules: Vec<Range<usize>>,
}

/// What the selected taxels leave of the patch's area.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Share of the area that no selected taxel covers, 0 to 1.
    pub uncovered_share: f64,
    /// Taxels that are not selected and lie where no selected neighbour would feel a load on them either.
    pub blind: u32,
}

/// What the force of a scan depends on beside its counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Present<'a> {
    /// What [`ForceModel::coverage`] says of the taxels selected now.
    pub coverage: Coverage,
    /// Standard uncertainty of the zero that all taxels share, counts.
    pub zero_sigma_counts: f64,
    /// By how many counts the taxels of each module jump together, see [`Scan::jumps`].
    pub jumps: &'a [f32],
}

impl ForceModel {
    /// Parts that geometry does not allow are left out here, once.
    #[must_use]
    pub fn new(layout: &Layout) -> Self {
        let mut outputs = layout.outputs;
        let geometry = layout.geometry.clone();
        let directed = geometry.as_ref().is_some_and(|g| g.normals == NormalsVerdict::Usable);
        outputs.resultant &= directed;
        outputs.moment &= directed;
        outputs.contacts &= geometry.is_some();
        outputs.fill &= geometry.is_some();
        Self {
            outputs,
            areas_mm2: layout.areas.iter().map(|a| a.0).collect(),
            area_uncertainty: layout.area_uncertainty,
            neighbours: geometry.as_ref().map(Neighbours::new),
            geometry,
            contact_reach_m: layout.contact_reach_m,
            modules: layout.modules.clone(),
        }
    }

    /// What the taxels selected now leave of the patch's area, and which of the others are blind, ascending.
    #[must_use]
    pub fn coverage(&self, selected: &[bool]) -> (Coverage, Vec<u16>) {
        let all: f64 = self.areas_mm2.iter().sum();
        let covered: f64 = self.areas_mm2.iter().zip(selected).filter(|(_, s)| **s).map(|(area, _)| area).sum();
        let missing = |range: Range<usize>| range.filter(|&t| !selected[t]);
        let mut blind = match &self.neighbours {
            Some(neighbours) => {
                let seen = |taxel: usize| neighbours.cover(taxel, |other| selected[other]);
                positions(missing(0..selected.len()).filter(|&taxel| !seen(taxel)))
            }
            // Without positions one that lies at the corner of a module may be, with the two beside it, and on a small one sooner.
            None => {
                let is_cornered = |range: &&Range<usize>| {
                    let missing = missing((*range).clone()).count();
                    missing >= CORNER_TAXELS || missing > 0 && 2 * missing >= range.len()
                };
                positions(self.modules.iter().filter(is_cornered).flat_map(|range| missing(range.clone())))
            }
        };
        blind.sort_unstable();
        let uncovered_share = if all > 0.0 { (1.0 - covered / all).max(0.0) } else { 0.0 };
        (Coverage { uncovered_share, blind: blind.len() as u32 }, blind)
    }

    /// The neighbours of each taxel, where positions are known.
    #[must_use]
    pub const fn neighbours(&self) -> Option<&Neighbours> {
        self.neighbours.as_ref()
    }

    /// The force of one scan, which is `touch`. State, reasons and the counts of excluded and stale taxels are the
    /// caller's.
    #[must_use]
    pub fn measure(
        &self,
        evaluator: &Evaluator,
        counts: Counts<'_>,
        touch: &mut Touch,
        unseen: Unseen,
        present: Present<'_>,
    ) -> ForceSample {
        let Touch { active, beside, contacts, .. } = touch;
        let uncovered_share = present.coverage.uncovered_share;
        let measured_n = match self.neighbours {
            None => evaluator.sum_n(active),
            Some(_) => active.iter().fold(0.0, |sum, &(_, newton)| sum + newton), // sum() of nothing is -0.0
        };
        let beside_n = |kpa: fn(&Filled) -> f64| {
            beside.iter().fold(0.0, |sum, filled| sum + kpa(filled) * self.newton_per_kpa(filled.taxel))
        };
        let (filled, filled_n, missing_n): (&[Filled], f64, f64) = match &self.neighbours {
            Some(_) if self.outputs.fill => (beside, beside_n(|filled| filled.kpa), 0.0),
            // Anything from nothing to more than any neighbour carries: the tip of the contact may lie there.
            Some(_) => (&[], 0.0, beside_n(|filled| filled.kpa + filled.sigma_kpa)),
            None => (&[], 0.0, self.missing_n(active, evaluator.selection())),
        };
        let total_n = measured_n + filled_n;
        let shares = self.shares(evaluator, counts, active, filled);
        let sampling_n2: f64 = contacts.iter().map(|contact| contact.sigma_n().powi(2)).sum();
        let jumps_n2 = self.jumps_n2(evaluator, counts, (active, filled), present.jumps);
        let variance_n2 =
            self.variance_n2(evaluator, shares, total_n, present.zero_sigma_counts) + sampling_n2 + jumps_n2;
        // What is not there and what the rim loses are both too little, and most of both where a contact lies about a taxel
        // at the rim that cannot be read: they add up.
        let at_rim = |of: &&Filled| self.neighbours.as_ref().is_some_and(|neighbours| neighbours.is_at_rim(of.taxel));
        let filled_at_rim = filled.iter().filter(at_rim).map(|of| of.kpa * self.newton_per_kpa(of.taxel));
        let rim_n = contacts.iter().map(Contact::rim_sigma_n).sum::<f64>() + rim_sigma_n(filled_at_rim.sum());
        let lost_n = missing_n + rim_n;
        let mut sample = ForceSample {
            total: Some(Newton(total_n)),
            total_sigma: Some(Newton((variance_n2 + lost_n.powi(2) + unseen.choice_n.powi(2)).sqrt())),
            detection_floor: Some(unseen.floor),
            active: active.len() as u32,
            out_of_range: shares.above as u32,
            filled: filled.len() as u32,
            filled_share: if total_n > 0.0 { filled_n / total_n } else { 0.0 },
            uncovered_share,
            model_set: Some(Arc::clone(evaluator.tables().id())),
            ..ForceSample::default()
        };
        if let Some(geometry) = &self.geometry {
            active.extend(filled.iter().map(|f| (f.taxel, f.kpa * self.newton_per_kpa(f.taxel))));
            self.add_geometry(&mut sample, geometry, active);
        }
        sample
    }

    /// Without positions nobody knows which excluded taxels lie under a contact. Those of a module that it touches may
    /// carry what the touched ones carry in the mean. In N.
    fn missing_n(&self, active: &[(usize, f64)], selected: &[bool]) -> f64 {
        let of_module = |range: &Range<usize>| {
            let touched = active.iter().filter(|(taxel, _)| range.contains(taxel));
            let (sum_n, n) = touched.fold((0.0, 0), |(sum, n), &(_, newton)| (sum + newton, n + 1));
            let missing = range.clone().filter(|&taxel| !selected[taxel]).count();
            if n == 0 { 0.0 } else { missing as f64 * sum_n / f64::from(n) }
        };
        self.modules.iter().map(of_module).sum()
    }

    /// 1 kPa on 1 mm2 is 1e-3 N.
    fn newton_per_kpa(&self, taxel: usize) -> f64 {
        self.areas_mm2[taxel] * 1e-3
    }

    fn add_geometry(&self, sample: &mut ForceSample, geometry: &Geometry, active: &[(usize, f64)]) {
        if self.outputs == (Outputs { fill: self.outputs.fill, ..Outputs::default() }) {
            return; // nobody asks for any of it
        }
        let poses = |taxel: usize| geometry.poses.get(taxel).copied().flatten();
        let (mut resultant, mut moment, mut weighted) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        let mut weight = 0.0;
        for &(taxel, newton) in active {
            let Some(pose) = poses(taxel) else { continue };
            let position = Vector3::from(pose.position);
            let force = -newton * Vector3::from(pose.normal); // a pressure pushes against the outward normal
            resultant += force;
            moment += position.cross(&force);
            weighted += newton * position;
            weight += newton;
        }
        sample.resultant = self.outputs.resultant.then_some(resultant.into());
        sample.moment = self.outputs.moment.then_some(moment.into());
        sample.centre_of_pressure = (self.outputs.moment && weight > 0.0).then(|| (weighted / weight).into());
        if self.outputs.contacts {
            let placed = active.iter().filter_map(|&(taxel, newton)| Some((taxel as u16, poses(taxel)?, newton)));
            sample.contacts = clusters(&placed.collect::<Vec<_>>(), self.contact_reach_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::tests::{layout, row};

    fn coverage(geometry: Option<Geometry>, missing: impl Fn(usize) -> bool) -> Coverage {
        let selected: Vec<bool> = (0..20).map(|taxel| !missing(taxel)).collect();
        let (coverage, blind) = ForceModel::new(&layout(20, geometry)).coverage(&selected);
        assert_eq!(blind.len(), coverage.blind as usize);
        assert!(blind.iter().all(|&taxel| missing(usize::from(taxel))) && blind.is_sorted(), "{blind:?}");
        coverage
    }

    #[test]
    fn an_excluded_taxel_among_sound_ones_is_uncovered_but_not_blind() {
        let one = coverage(Some(row(20)), |taxel| taxel == 5);
        assert!((one.uncovered_share - 0.05).abs() < 1e-12);
        assert_eq!(one.blind, 0);
    }

    #[test]
    fn a_module_that_is_excluded_as_a_whole_is_blind() {
        let module = coverage(Some(row(20)), |taxel| taxel >= 10);
        assert_eq!((module.uncovered_share, module.blind), (0.5, 10));
        let all = coverage(Some(row(20)), |_| true);
        assert_eq!((all.uncovered_share, all.blind), (1.0, 20));
    }

    #[test]
    fn without_positions_a_corner_of_a_module_may_be_missing() {
        assert_eq!(coverage(None, |taxel| taxel % 10 < 2).blind, 0, "one beside each of them at least can be read");
        assert_eq!(coverage(None, |taxel| taxel < 3).blind, 3);
        assert_eq!(coverage(None, |taxel| taxel % 10 == 0).blind, 0, "one of each module");
        let small = |lengths: &[usize], missing: &[usize]| {
            let starts = lengths.iter().scan(0, |end, length| Some(std::mem::replace(end, *end + length)));
            let modules = starts.zip(lengths).map(|(start, length)| start..start + length).collect();
            let selected: Vec<bool> = (0..lengths.iter().sum()).map(|taxel| !missing.contains(&taxel)).collect();
            ForceModel::new(&Layout { modules, ..layout(selected.len(), None) }).coverage(&selected).0.blind
        };
        assert_eq!([small(&[12, 3], &[13, 14]), small(&[12, 3], &[13]), small(&[12, 2], &[13])], [2, 0, 1]);
        assert_eq!([small(&[12, 1], &[12]), small(&[12, 1], &[])], [1, 0]);
        assert_eq!(coverage(None, |taxel| taxel >= 10).blind, 10);
    }
}
