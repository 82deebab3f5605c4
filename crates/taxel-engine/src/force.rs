//! The force sample: total, its uncertainty, and the parts that the scene asks for.

use nalgebra::Vector3;
use std::sync::Arc;
use taxel_skin::{Geometry, Newton, NormalsVerdict};

use crate::contact::clusters;
use crate::evaluate::Evaluator;
use crate::neighbours::{Filled, Neighbours};
use crate::plan::PatchPlan;
use crate::snapshot::{ForceSample, RangeFlag};

/// The fixed part of a patch's force, worked out once from the plan.
#[derive(Clone, Debug)]
pub struct ForceParts {
    outputs: crate::plan::Outputs,
    areas_mm2: Vec<f64>,
    area_uncertainty: f64,
    geometry: Option<Geometry>,
    neighbours: Option<Neighbours>,
    contact_reach_m: f64,
}

impl ForceParts {
    /// Parts that geometry does not allow are left out here, once.
    #[must_use]
    pub fn new(plan: &PatchPlan) -> Self {
        let mut outputs = plan.outputs;
        let geometry = plan.geometry.clone();
        let directed = geometry.as_ref().is_some_and(|g| g.normals == NormalsVerdict::Usable);
        outputs.resultant &= directed;
        outputs.moment &= directed;
        outputs.contacts &= geometry.is_some();
        outputs.fill &= geometry.is_some();
        Self {
            outputs,
            areas_mm2: plan.areas.iter().map(|a| a.0).collect(),
            area_uncertainty: plan.area_uncertainty,
            neighbours: geometry.as_ref().map(Neighbours::new),
            geometry,
            contact_reach_m: plan.live.contact_reach_m,
        }
    }

    /// Share of the patch's area that no selected taxel covers, 0 to 1.
    #[must_use]
    pub fn uncovered_share(&self, evaluator: &Evaluator) -> f64 {
        let all: f64 = self.areas_mm2.iter().sum();
        let covered: f64 = evaluator.selected().map(|taxel| self.areas_mm2[taxel]).sum();
        if all > 0.0 { (1.0 - covered / all).max(0.0) } else { 0.0 }
    }

    /// The force of one scan. State, reasons and the counts of excluded and stale taxels are the caller's.
    #[must_use]
    pub fn measure(&self, evaluator: &Evaluator, counts: &[u8]) -> ForceSample {
        let mut active: Vec<(usize, f64)> = evaluator.active(counts).collect();
        let mut filled = Vec::new();
        if let Some(neighbours) = &self.neighbours {
            let weak = |taxel: usize| evaluator.weak_n(taxel, counts[taxel]);
            neighbours.grow(&mut active, |taxel| weak(taxel).unwrap_or(0.0));
            if self.outputs.fill {
                filled = neighbours.fill(&active, |taxel| Some(weak(taxel)? / self.newton_per_kpa(taxel)));
            }
        }
        let measured_n = match self.neighbours {
            None => evaluator.total_n(counts),
            Some(_) => active.iter().fold(0.0, |sum, &(_, newton)| sum + newton), // sum() of nothing is -0.0
        };
        let filled_n = filled.iter().fold(0.0, |sum, f| sum + f.kpa * self.newton_per_kpa(f.taxel));
        let total_n = measured_n + filled_n;
        let mut sample = ForceSample {
            total: Some(Newton(total_n)),
            total_sigma: Some(Newton(self.sigma_n(evaluator, counts, &active, &filled, total_n))),
            active: active.len() as u32,
            filled: filled.len() as u32,
            filled_share: if total_n > 0.0 { filled_n / total_n } else { 0.0 },
            model_set: Some(Arc::from(evaluator.set().id.as_str())),
            ..ForceSample::default()
        };
        let beyond =
            |taxel: usize| evaluator.reading(taxel, counts[taxel]).is_some_and(|r| r.range == RangeFlag::Above);
        sample.out_of_range = active.iter().filter(|&&(taxel, _)| beyond(taxel)).count() as u32;
        if let Some(geometry) = &self.geometry {
            active.extend(filled.iter().map(|f| (f.taxel, f.kpa * self.newton_per_kpa(f.taxel))));
            self.add_geometry(&mut sample, geometry, &active);
        }
        sample
    }

    /// 1 kPa on 1 mm2 is 1e-3 N.
    fn newton_per_kpa(&self, taxel: usize) -> f64 {
        self.areas_mm2[taxel] * 1e-3
    }

    /// Standard uncertainty of the total: taxels are independent, while gauge gain, gauge offset and area are common
    /// to all of them and so add up before they are squared.
    ///
    /// `var F = sum (A_i s_i)^2 + (g F)^2 + (o sum A_i)^2 + (a F)^2`, where the s of a filled taxel is the scatter of
    /// its neighbours.
    fn sigma_n(
        &self,
        evaluator: &Evaluator,
        counts: &[u8],
        active: &[(usize, f64)],
        filled: &[Filled],
        total_n: f64,
    ) -> f64 {
        let set = evaluator.set();
        let (mut own, mut area) = (0.0, 0.0);
        let measured = active.iter().map(|&(taxel, _)| {
            (taxel, evaluator.reading(taxel, counts[taxel]).map_or(0.0, |r| f64::from(r.sigma_kpa)))
        });
        for (taxel, sigma_kpa) in measured.chain(filled.iter().map(|f| (f.taxel, f.sigma_kpa))) {
            own += (self.newton_per_kpa(taxel) * sigma_kpa).powi(2);
            area += self.newton_per_kpa(taxel);
        }
        let gain = set.gauge_gain_rel * total_n;
        let offset = set.gauge_offset_kpa * area;
        let shape = self.area_uncertainty * total_n;
        (own + gain * gain + offset * offset + shape * shape).sqrt()
    }

    fn add_geometry(&self, sample: &mut ForceSample, geometry: &Geometry, active: &[(usize, f64)]) {
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
            let placed = active.iter().filter_map(|&(taxel, newton)| Some((poses(taxel)?.position, newton)));
            sample.contacts = clusters(&placed.collect::<Vec<_>>(), self.contact_reach_m);
        }
    }
}
