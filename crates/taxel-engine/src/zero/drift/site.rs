//! The modules of a patch and their neighbourhood, as the drift needs to know them.

use std::ops::Range;

use taxel_skin::{Geometry, ModuleKind, ModuleSite, Patch};

/// One module of a patch, as the drift needs to know it.
#[derive(Clone, Debug)]
pub struct DriftSite {
    /// Its taxels.
    pub taxels: Range<usize>,
    /// What its values are.
    pub kind: ModuleKind,
    /// The modules beside it, itself not among them.
    pub beside: Vec<usize>,
}

/// The modules of a patch, and which lie beside which: those with taxels closer than `reach_m`. Without
/// positions of both, two modules count as beside each other.
#[must_use]
pub fn drift_sites(patch: &Patch, geometry: Option<&Geometry>, reach_m: f64) -> Vec<DriftSite> {
    let modules = patch.modules();
    let range =
        |site: &ModuleSite| site.first_taxel as usize..site.first_taxel as usize + site.kind.taxel_slots().len();
    let place = |taxel: usize| geometry?.poses.get(taxel).copied().flatten().map(|pose| pose.position);
    let places: Vec<Vec<[f64; 3]>> = modules.iter().map(|site| range(site).filter_map(place).collect()).collect();
    let near = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>() <= reach_m.powi(2);
    let beside = |a: usize, b: usize| {
        let (a, b) = (&places[a], &places[b]);
        a.is_empty() || b.is_empty() || a.iter().any(|a| b.iter().any(|b| near(a, b)))
    };
    let site = |(index, site): (usize, &ModuleSite)| DriftSite {
        taxels: range(site),
        kind: site.kind,
        beside: (0..modules.len()).filter(|&other| other != index && beside(index, other)).collect(),
    };
    modules.iter().enumerate().map(site).collect()
}
