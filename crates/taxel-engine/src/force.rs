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

/// What the force of a scan depends on beside its counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Present {
    /// What [`ForceParts::uncovered_share`] said of the taxels selected now, 0 to 1.
    pub uncovered_share: f64,
    /// Standard uncertainty of the zero that all taxels share, counts.
    pub zero_sigma_counts: f64,
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
    pub fn measure(&self, evaluator: &Evaluator, counts: &[u8], present: Present) -> ForceSample {
        let uncovered_share = present.uncovered_share;
        let mut active = evaluator.active(counts);
        let mut beside = Vec::new();
        if let Some(neighbours) = &self.neighbours {
            let weak = |taxel: usize| evaluator.weak_n(taxel, counts[taxel]);
            neighbours.grow(&mut active, |taxel| weak(taxel).unwrap_or(0.0));
            if uncovered_share > 0.0 {
                beside = neighbours.fill(&active, |taxel| Some(weak(taxel)? / self.newton_per_kpa(taxel)));
            }
        }
        let measured_n = match self.neighbours {
            None => evaluator.total_n(counts),
            Some(_) => active.iter().fold(0.0, |sum, &(_, newton)| sum + newton), // sum() of nothing is -0.0
        };
        let beside_n = beside.iter().fold(0.0, |sum, f| sum + f.kpa * self.newton_per_kpa(f.taxel));
        let (filled, filled_n, missing_n) = match &self.neighbours {
            Some(_) if self.outputs.fill => (beside, beside_n, 0.0),
            Some(_) => (Vec::new(), 0.0, beside_n),
            // Nobody knows where the uncovered taxels lie: the load is as likely on them as on the others.
            None => (Vec::new(), 0.0, measured_n * uncovered_share / (1.0 - uncovered_share).max(f64::EPSILON)),
        };
        let total_n = measured_n + filled_n;
        let sigma_n = self.sigma_n(evaluator, counts, &active, &filled, total_n, present).hypot(missing_n);
        let mut sample = ForceSample {
            total: Some(Newton(total_n)),
            total_sigma: Some(Newton(sigma_n)),
            active: active.len() as u32,
            filled: filled.len() as u32,
            filled_share: if total_n > 0.0 { filled_n / total_n } else { 0.0 },
            model_set: Some(Arc::clone(evaluator.tables().id())),
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

    /// Standard uncertainty of the total: taxels are independent, while hysteresis, drift, gauge gain, gauge offset and
    /// area are common to all of them and so add up before they are squared.
    ///
    /// `var F = sum A_i^2 (s_i^2 - h_i^2) + (sum A_i h_i)^2 + (z sum A_i dP_i/dC)^2 + (g F)^2 + (o sum A_i)^2 + (a F)^2`,
    /// where s is the uncertainty of a taxel, h what of it is hysteresis, z the zero's in counts, and the s of a filled
    /// taxel is the scatter of its neighbours.
    fn sigma_n(
        &self,
        evaluator: &Evaluator,
        counts: &[u8],
        active: &[(usize, f64)],
        filled: &[Filled],
        total_n: f64,
        present: Present,
    ) -> f64 {
        let (mut own, mut hysteresis, mut per_count, mut area) = (0.0, 0.0, 0.0, 0.0);
        for &(taxel, _) in active {
            let Some(reading) = evaluator.reading(taxel, counts[taxel]) else { continue };
            let newton_per_kpa = self.newton_per_kpa(taxel);
            let (sigma_kpa, shared_kpa) = (f64::from(reading.sigma_kpa), f64::from(reading.shared_kpa));
            own += newton_per_kpa.powi(2) * (sigma_kpa.powi(2) - shared_kpa.powi(2)).max(0.0);
            hysteresis += newton_per_kpa * shared_kpa;
            per_count += newton_per_kpa * f64::from(reading.kpa_per_count);
            area += newton_per_kpa;
        }
        for taxel in filled {
            own += (self.newton_per_kpa(taxel.taxel) * taxel.sigma_kpa).powi(2);
            area += self.newton_per_kpa(taxel.taxel);
        }
        let set = evaluator.tables().set();
        let shared = [
            hysteresis,
            present.zero_sigma_counts * per_count,
            set.gauge_gain_rel * total_n,
            set.gauge_offset_kpa * area,
            self.area_uncertainty * total_n,
        ];
        shared.iter().fold(own, |variance, sigma| variance + sigma * sigma).sqrt()
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
