//! The area that each taxel stands for: its share of a module that tiles the surface.

use crate::layout::{ModuleKind, Patch, TaxelSite};
use crate::units::SquareMillimetre;

/// Shares of an iCub triangle's area, by the distance of the module centres: what its corner, edge and centre taxels
/// have of the Voronoi cells in a tiling without holes, gaps included.
const SHARES: [(f64, [f64; 3]); 3] =
    [(17.32, [0.1085, 0.098, 0.089]), (18.0, [0.115, 0.095, 0.085]), (18.8, [0.122, 0.093, 0.078])];

/// Each taxel's share of the area of its module, which is `mean` per taxel, gaps included; one entry per taxel.
///
/// The pattern of a triangle's ten taxels is rigid, so its shares are known better than any file of positions tells them:
/// those of corner, edge and centre, from a tiling of triangles whose centres lie d apart, of (3 sqrt(3) / 4) d^2 each.
/// Taxels of other modules have equal shares.
#[must_use]
pub fn template(patch: &Patch, mean: SquareMillimetre) -> Vec<SquareMillimetre> {
    let spacing_mm = (10.0 * mean.0 / (0.75 * 3.0_f64.sqrt())).sqrt();
    let [corner, edge, centre] = shares(spacing_mm);
    let area = |site: &TaxelSite| {
        if patch.modules()[usize::from(site.module)].kind != ModuleKind::Triangle {
            return mean;
        }
        let share = match site.slot {
            1 | 5 | 9 => corner,
            3 => centre,
            _ => edge,
        };
        SquareMillimetre(10.0 * mean.0 * share)
    };
    patch.taxels().iter().map(area).collect()
}

/// Shares of corner, edge and centre taxels, between the tabulated distances and beyond them as at the nearest; the ten
/// of a module add up to 1.
fn shares(spacing_mm: f64) -> [f64; 3] {
    let [(first, of_first), .., (last, _)] = SHARES;
    let spacing_mm = spacing_mm.clamp(first, last);
    let mut shares = of_first;
    for pair in SHARES.windows(2) {
        let [(from, a), (to, b)] = [pair[0], pair[1]];
        if spacing_mm >= from {
            let t = ((spacing_mm - from) / (to - from)).min(1.0);
            shares = std::array::from_fn(|i| a[i] + t * (b[i] - a[i]));
        }
    }
    let [corner, edge, centre] = shares;
    let all = 3.0 * corner + 6.0 * edge + centre;
    shares.map(|share| share / all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Board, BoardAddress, BusIndex, Module};

    #[test]
    fn a_template_shares_out_the_whole_module_and_gives_corners_most() {
        let module = |number, kind| (Module::from_nibble(number), kind);
        let modules = vec![module(0, ModuleKind::Triangle), module(1, ModuleKind::PalmPad7)];
        let board = Board { bus: BusIndex(0), address: BoardAddress::new(13).unwrap(), modules };
        let patch = Patch::new("p", vec![board]).unwrap();
        for mean in [30.0, 32.4, 39.0, 42.1, 45.0, 60.0] {
            let areas: Vec<f64> = template(&patch, SquareMillimetre(mean)).iter().map(|a| a.0).collect();
            assert!((areas[..10].iter().sum::<f64>() - 10.0 * mean).abs() < 1e-9, "{areas:?}");
            let (corner, edge, centre) = (areas[1], areas[0], areas[3]);
            assert!(corner > edge && edge > centre, "{areas:?}");
            assert_eq!([areas[5], areas[8]], [corner; 2], "the corners are values 1, 5 and 9");
            assert!(areas[10..].iter().all(|area| (area - mean).abs() < 1e-12), "other modules: equal");
        }
        let [corner, edge, centre] = [1, 0, 3].map(|t| template(&patch, SquareMillimetre(42.1))[t].0);
        assert!((corner - 48.4).abs() < 0.1 && (edge - 40.0).abs() < 0.1 && (centre - 35.8).abs() < 0.1);
    }
}
