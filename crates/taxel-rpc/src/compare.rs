//! `CompareModelSets`: what changed from one model set to another.

use taxel_engine::comparison::{Comparison, TaxelComparison};
use taxel_engine::known_set::SetSummary;
use taxel_engine::model_set::ModelSet;
use taxel_engine::statistics::median;
use taxel_proto::v1;
use tonic::{Response, Status};

use crate::convert::known;
use crate::model::summary;
use crate::service::{Held, Service, aside};
use crate::status::invalid;

impl Service {
    pub(crate) async fn compare(
        &self,
        held: Held,
        request: &v1::CompareModelSetsRequest,
    ) -> Result<Response<v1::ModelSetComparison>, Status> {
        let earlier = self.model_set(&request.earlier, &request.patch).await?;
        let later = self.model_set(&request.later, &request.patch).await?;
        if earlier.patch != later.patch {
            let (a, b) = (&earlier.patch, &later.patch);
            return Err(invalid(
                "later",
                format_args!("`{}` is for patch `{b}`, `{}` for `{a}`", later.id, earlier.id),
            ));
        }
        let active = self.active(&earlier.patch);
        let mut compared = aside(held, move || comparison(&earlier, &later)).await?;
        for set in [&mut compared.earlier, &mut compared.later].into_iter().flatten() {
            set.active = active.as_ref() == Some(&set.model_set);
        }
        Ok(Response::new(compared))
    }
}

/// What changed from `earlier` to `later`, as `CompareModelSets` tells it; neither is said to be in use.
#[must_use]
pub fn comparison(earlier: &ModelSet, later: &ModelSet) -> v1::ModelSetComparison {
    let compared = Comparison::of(earlier, later);
    let over = |figure: fn(&TaxelComparison) -> Option<f64>| compared.taxels.iter().filter_map(figure);
    let worst = over(|taxel| taxel.worst_kpa).max_by(|a, b| a.abs().total_cmp(&b.abs()));
    v1::ModelSetComparison {
        earlier: Some(summary(&SetSummary::of(earlier), false)),
        later: Some(summary(&SetSummary::of(later), false)),
        median_kpa: median(over(|taxel| taxel.median_kpa)).and_then(known),
        worst_kpa: worst.and_then(known),
        gain_ratio: median(over(|taxel| taxel.gain_ratio)).and_then(known),
        taxels: compared.taxels.iter().map(message).collect(),
        became_usable: compared.became_usable,
        lost: compared.lost,
    }
}

fn message(taxel: &TaxelComparison) -> v1::TaxelComparison {
    v1::TaxelComparison {
        taxel: taxel.taxel,
        rest_counts: taxel.rest_counts.and_then(known),
        count_min: taxel.common_counts.and_then(|[low, _]| known(low)),
        count_max: taxel.common_counts.and_then(|[_, high]| known(high)),
        median_kpa: taxel.median_kpa.and_then(known),
        worst_kpa: taxel.worst_kpa.and_then(known),
        rms_kpa: taxel.rms_kpa.and_then(known),
        gain_ratio: taxel.gain_ratio.and_then(known),
    }
}
