//! The area that each taxel stands for: its share of a module that tiles the surface, or its Voronoi cell on the surface,
//! capped at the edge of its module.
//!
//! A module is a small flexible board and nearly flat, so its cells are cut in the plane that fits its taxels best.
//! Between two modules the bisector lies half way along the straight line between their taxels.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use crate::geometry::Geometry;
use crate::layout::{ModuleKind, Patch, TaxelSite};
use crate::polygon::{Convex, Point, length, minus};
use crate::positions::TaxelPose;
use crate::units::SquareMillimetre;

/// Taxels that are closer than this are at one place: some of iCub's files give several taxels the place of another.
const SAME_PLACE_MM: f64 = 1e-3;

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

/// The Voronoi cells of all taxels. `modules` are the taxels of each module; the answer has one entry per taxel of the
/// geometry, above zero.
///
/// The edge of a module is in no file, but its area is known: `mean` per taxel. So the edge is taken where the convex
/// hull of the module's taxels, grown by the same distance everywhere, has this area; a hull that is larger already is
/// not grown. Where another module is nearer than that, the two share the gap.
///
/// `None` for the taxels of a module that has one without a place of its own, or all of them on a line: what the
/// missing one stands for would be counted to the others. Also for a taxel outside of all modules, and for one whose
/// cell vanishes between taxels of other modules.
#[must_use]
pub fn voronoi(
    geometry: &Geometry,
    modules: impl IntoIterator<Item = Range<usize>>,
    mean: SquareMillimetre,
) -> Vec<Option<SquareMillimetre>> {
    let place = |pose: &TaxelPose| Vector3::from(pose.position) * 1e3;
    let places_mm: Vec<Option<Vector3<f64>>> = geometry.poses.iter().map(|pose| pose.as_ref().map(place)).collect();
    let mut areas = vec![None; places_mm.len()];
    for module in modules {
        let (Some(own), Some(areas)) = (places_mm.get(module.clone()), areas.get_mut(module.clone())) else { continue };
        let Some(own) = own.iter().copied().collect::<Option<Vec<_>>>() else { continue };
        let cells = cells(&own, others(&places_mm, &module), mean).unwrap_or_default();
        for (area, cell) in areas.iter_mut().zip(cells) {
            *area = Some(cell).filter(|cell| cell.0 > 0.0);
        }
    }
    areas
}

/// The places of all taxels outside of a module.
fn others<'a>(
    places_mm: &'a [Option<Vector3<f64>>],
    module: &Range<usize>,
) -> impl Iterator<Item = Vector3<f64>> + Clone + 'a {
    places_mm[..module.start].iter().chain(&places_mm[module.end..]).copied().flatten()
}

/// The cells of one module's taxels; `None` if two are at one place or all on a line.
fn cells(
    own_mm: &[Vector3<f64>],
    others_mm: impl Iterator<Item = Vector3<f64>> + Clone,
    mean: SquareMillimetre,
) -> Option<Vec<SquareMillimetre>> {
    let apart = |i: usize| own_mm[..i].iter().all(|other| (other - own_mm[i]).norm() >= SAME_PLACE_MM);
    if !(0..own_mm.len()).all(apart) {
        return None;
    }
    let plane = Plane::fit(own_mm);
    let flat: Vec<Point> = own_mm.iter().map(|place| plane.project(*place)).collect();
    let outline = Convex::hull(&flat)?.grown_to(mean.0 * own_mm.len() as f64);
    let cell = |(place, &here): (&Vector3<f64>, &Point)| {
        let mut cell = outline.clone();
        for &there in &flat {
            bisect(&mut cell, here, there, length(minus(there, here)));
        }
        let reach_mm = 2.0 * cell.radius_about(here); // from further away nothing can cut it
        for other in others_mm.clone() {
            let distance_mm = (other - place).norm();
            if distance_mm < reach_mm {
                bisect(&mut cell, here, plane.project(other), distance_mm);
            }
        }
        SquareMillimetre(cell.area())
    };
    Some(own_mm.iter().zip(&flat).map(cell).collect())
}

/// Leaves of a cell what is nearer to `here` than to a place in the direction of `there` at this distance.
///
/// Across the bend from one module to the next the distance is that in space, longer than it looks in the plane.
fn bisect(cell: &mut Convex, here: Point, there: Point, distance_mm: f64) {
    let step = minus(there, here);
    let projected_mm = length(step);
    if projected_mm < SAME_PLACE_MM {
        return;
    }
    let direction = step.map(|c| c / projected_mm);
    cell.cut(direction, here[0] * direction[0] + here[1] * direction[1] + 0.5 * distance_mm);
}

/// A plane with its two axes.
struct Plane {
    centre: Vector3<f64>,
    axes: [Vector3<f64>; 2],
}

impl Plane {
    /// The plane with the least sum of squared distances: its normal is the direction of the least spread.
    fn fit(places: &[Vector3<f64>]) -> Self {
        let centre = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
        let spread: Matrix3<f64> = places.iter().map(|place| (place - centre) * (place - centre).transpose()).sum();
        let eigen = spread.symmetric_eigen();
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        let first: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
        Self { centre, axes: [first, normal.cross(&first)] }
    }

    fn project(&self, place: Vector3<f64>) -> Point {
        self.axes.map(|axis| axis.dot(&(place - self.centre)))
    }
}

#[cfg(test)]
mod tests;
