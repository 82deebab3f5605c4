//! What the taxels of a total bring to its uncertainty.

use super::ForceModel;
use crate::counts::Counts;
use crate::force::evaluator::Evaluator;
use crate::force::neighbours::Filled;
use crate::force::offsets::Offsets;
use crate::model_set::GAIN_OF_DAY_REL;

/// Sums over the taxels of a total that its uncertainty follows from.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shares {
    /// Variance that each taxel has for itself, N squared.
    own_n2: f64,
    /// What all have in common: hysteresis that is not compensated, and what the calibration leaves open, N.
    common_n: f64,
    /// The same of histories that are not known, N.
    history_n: f64,
    /// Change of the force if all counts change by one, N.
    per_count_n: f64,
    /// N per kPa.
    area: f64,
    /// Taxels beyond the calibrated range.
    pub(super) above: f64,
}

impl ForceModel {
    /// What the taxels of a total bring to its uncertainty, in one walk.
    pub(super) fn shares(
        &self,
        evaluator: &Evaluator,
        counts: Counts<'_>,
        active: &[(usize, f64)],
        filled: &[Filled],
    ) -> Shares {
        let (tables, mut sums) = (evaluator.tables(), Shares::default());
        for &(taxel, _) in active {
            let Some(share) = counts.raw(taxel).and_then(|count| tables.share(taxel, count)) else { continue };
            sums.own_n2 += f64::from(share.own_n2);
            sums.per_count_n += f64::from(share.per_count_n);
            sums.above += f64::from(share.above);
            sums.common_n += f64::from(share.shared_n);
            sums.area += self.newton_per_kpa(taxel);
        }
        for taxel in filled {
            let newton_per_kpa = self.newton_per_kpa(taxel.taxel);
            sums.own_n2 += (newton_per_kpa * taxel.sigma_kpa).powi(2);
            sums.area += newton_per_kpa;
            let [per_count_kpa, shared_kpa, history_kpa] = self.common_beside(evaluator, counts, taxel.taxel);
            sums.per_count_n += newton_per_kpa * per_count_kpa;
            sums.common_n += newton_per_kpa * shared_kpa;
            sums.history_n += newton_per_kpa * history_kpa;
        }
        if let Some(offsets) = unknown_histories(evaluator) {
            let of_one = |&(taxel, _): &(usize, f64)| self.newton_per_kpa(taxel) * offsets.sigma_kpa(taxel);
            sums.history_n += active.iter().map(of_one).sum::<f64>();
        }
        sums
    }

    /// Variance because the taxels of modules jump together, N squared: a reading is on one end of a jump or on the other,
    /// of which the standard deviation is half of the jump at the most.
    pub(super) fn jumps_n2(
        &self,
        evaluator: &Evaluator,
        counts: Counts<'_>,
        (active, filled): (&[(usize, f64)], &[Filled]),
        jumps: &[f32],
    ) -> f64 {
        if jumps.iter().all(|jump| *jump <= 0.0) {
            return 0.0; // nearly always
        }
        let mut by_module = vec![0.0; self.modules.len()];
        let mut add = |taxel: usize, newton: f64| {
            let module = self.modules.partition_point(|range| range.end <= taxel);
            if let (Some(jump), Some(sum)) = (jumps.get(module), by_module.get_mut(module)) {
                *sum += 0.5 * f64::from(*jump) * newton;
            }
        };
        let per_count_n = |taxel: usize| {
            counts.raw(taxel).and_then(|count| evaluator.tables().share(taxel, count)).map(|share| share.per_count_n)
        };
        for &(taxel, _) in active {
            add(taxel, per_count_n(taxel).map_or(0.0, f64::from));
        }
        for filled in filled {
            // As the mean of those that it is filled from, of whatever module they are.
            let beside: Vec<(usize, f64)> =
                self.beside(evaluator, filled.taxel).filter_map(|t| Some((t, f64::from(per_count_n(t)?)))).collect();
            let newton_per_kpa = self.newton_per_kpa(filled.taxel);
            let known = beside.len() as f64;
            beside.iter().for_each(|&(t, newton)| add(t, newton_per_kpa * newton / self.newton_per_kpa(t) / known));
        }
        by_module.iter().map(|newton| newton * newton).sum()
    }

    /// The taxels that one without a pressure is filled from.
    fn beside(&self, evaluator: &Evaluator, taxel: usize) -> impl Iterator<Item = usize> {
        let selected = evaluator.selection();
        self.neighbours.iter().flat_map(move |all| all.of(taxel)).filter(move |&other| selected[other])
    }

    /// What a filled taxel takes over from those it is filled from, in the mean: kPa per count, and hysteresis and unknown
    /// history in kPa. A zero or a hysteresis that is wrong for all of them is wrong for it, too.
    fn common_beside(&self, evaluator: &Evaluator, counts: Counts<'_>, taxel: usize) -> [f64; 3] {
        let (tables, mut sums, mut known) = (evaluator.tables(), [0.0; 3], 0.0);
        let histories = unknown_histories(evaluator);
        for other in self.beside(evaluator, taxel) {
            let Some(share) = counts.raw(other).and_then(|count| tables.share(other, count)) else { continue };
            let newton_per_kpa = self.newton_per_kpa(other);
            sums[0] += f64::from(share.per_count_n) / newton_per_kpa;
            sums[1] += f64::from(share.shared_n) / newton_per_kpa;
            sums[2] += histories.map_or(0.0, |offsets| offsets.sigma_kpa(other));
            known += 1.0;
        }
        if known > 0.0 { sums.map(|sum| sum / known) } else { sums }
    }

    /// Variance of the total, N squared: taxels are independent, while hysteresis, drift, gauge gain, gauge offset and
    /// area are common to all of them and so add up before they are squared.
    ///
    /// `var F = sum A_i^2 (s_i^2 - h_i^2) + (sum A_i h_i)^2 + (sum A_i u_i)^2 + (z sum A_i dP_i/dC)^2 + (g F)^2
    /// + (o sum A_i)^2 + (a F)^2 + (d F)^2`, where s is the uncertainty of a taxel, h what of it is hysteresis, what its
    /// calibration leaves open ([`crate::model_set::ModelSet`], `doubts_kpa`), and how stiff the skin is beyond its range, u that of a history which is not known or lags
    /// behind ([`Offsets::sigma_kpa`]), z the zero's in counts with what the skin may remember of earlier loads, and the s
    /// of a filled taxel is the scatter of its neighbours. d is [`GAIN_OF_DAY_REL`]. What the pads' places add is in [`crate::force::sampling`], and what
    /// modules that jump add in [`ForceModel::jumps_n2`].
    pub(super) fn variance_n2(&self, evaluator: &Evaluator, sums: Shares, total_n: f64, zero_sigma_counts: f64) -> f64 {
        let set = evaluator.tables().set();
        let shared = [
            sums.common_n,
            sums.history_n,
            zero_sigma_counts * sums.per_count_n,
            evaluator.tables().residue_sigma_counts() * sums.per_count_n,
            set.gauge_gain_rel * total_n,
            GAIN_OF_DAY_REL * total_n,
            set.gauge_offset_kpa * sums.area,
            self.area_uncertainty * total_n,
        ];
        shared.iter().fold(sums.own_n2, |variance, sigma| variance + sigma * sigma)
    }
}

/// What the histories add, if some of them are not known.
fn unknown_histories(evaluator: &Evaluator) -> Option<&Offsets> {
    evaluator.hysteresis().filter(|offsets| !offsets.are_known())
}
