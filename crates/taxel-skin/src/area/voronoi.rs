//! Voronoi cells on a surface of modules.
//!
//! The cells of a module are cut in its own plane, into which the modules around are unfolded, so that the border between
//! two modules lies where they meet, also across a bend.

use std::ops::Range;

use nalgebra::Vector3;

use super::flat::Plane;
use crate::geometry::Geometry;
use crate::polygon::{Convex, Point, length, minus};
use crate::positions::TaxelPose;
use crate::units::SquareMillimetre;

/// Taxels that are closer than this are at one place: some of iCub's files give several taxels the place of another.
const SAME_PLACE_MM: f64 = 1e-3;

/// A module lies beside another's side if one of its taxels is so many rims beyond the side of the hull: two where their
/// outlines touch, and a gap of one between them.
const BESIDE_RIMS: f64 = 3.0;

/// What lacks of an area by no more than this share is rounding.
const ROUNDING: f64 = 1e-9;

/// Halvings of the interval in which the width of the refilled rim is looked for: from millimetres to nanometres.
const HALVINGS: usize = 24;

/// The Voronoi cells of all taxels. `modules` are the taxels of each module; the answer has one entry per taxel of the
/// geometry, above zero.
///
/// The edge of a module is in no file, but its area is known: `mean` per taxel. So the edge is taken where the convex
/// hull of the module's taxels, with its sides moved out by the same distance, has this area: for a triangle that tiles
/// the surface this is the triangle itself. A hull that is larger already is not grown. Where another module is nearer
/// than that, the two share what is between them.
///
/// Positions are never exact, so that outlines overlap here and leave gaps there. What is lost in overlaps is refilled:
/// all edges beside other modules move out by one distance, at most by the width of the rim, until the cells have the
/// area of the modules together, or no gap is left. Edges with nothing beside them stay where they are.
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
    let boards = modules.into_iter().filter_map(|taxels| Board::new(taxels, &places_mm, mean)).collect::<Vec<_>>();
    let parts: Vec<Part> = boards.iter().map(|board| Part::new(board, &boards, &places_mm)).collect();
    let refill_mm = refill_mm(&parts);
    let mut areas = vec![None; places_mm.len()];
    for part in &parts {
        for (area, cell) in areas[part.board.taxels.clone()].iter_mut().zip(part.cells(refill_mm)) {
            *area = Some(SquareMillimetre(cell)).filter(|cell| cell.0 > 0.0);
        }
    }
    areas
}

/// How much further out than they are the edges beside other modules must be.
fn refill_mm(parts: &[Part<'_>]) -> f64 {
    let target: f64 = parts.iter().map(|part| part.board.outline(0.0).area()).sum();
    let lacking = |refill_mm: f64| target - parts.iter().flat_map(|part| part.cells(refill_mm)).sum::<f64>();
    if lacking(0.0) <= ROUNDING * target {
        return 0.0;
    }
    let (mut enough, mut little) = (parts.iter().map(|part| part.board.rim_mm).fold(0.0, f64::max), 0.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (little + enough);
        *(if lacking(middle) > 0.0 { &mut little } else { &mut enough }) = middle;
    }
    enough
}

/// A module in its plane.
pub(super) struct Board {
    taxels: Range<usize>,
    plane: Plane,
    /// Its taxels in the plane.
    flat: Vec<Point>,
    hull: Convex,
    /// From the hull to the edge.
    rim_mm: f64,
}

impl Board {
    /// `None` if one of its taxels has no place, two are at one place or all on a line.
    pub(super) fn new(
        taxels: Range<usize>,
        places_mm: &[Option<Vector3<f64>>],
        mean: SquareMillimetre,
    ) -> Option<Self> {
        let own = places_mm.get(taxels.clone())?.iter().copied().collect::<Option<Vec<_>>>()?;
        let apart = |i: usize| own[..i].iter().all(|other| (other - own[i]).norm() >= SAME_PLACE_MM);
        if !(0..own.len()).all(apart) {
            return None;
        }
        let plane = Plane::fit(&own);
        let flat: Vec<Point> = own.iter().map(|place| plane.project(*place)).collect();
        let hull = Convex::hull(&flat)?;
        let rim_mm = hull.rim_to(mean.0 * own.len() as f64);
        Some(Self { taxels, plane, flat, hull, rim_mm })
    }

    /// Its outline with edges so much further out.
    fn outline(&self, further_mm: f64) -> Convex {
        self.hull.grown(self.rim_mm + further_mm)
    }
}

/// A line that cuts off what is beyond `limit` in a direction.
struct Cut {
    direction: Point,
    limit: f64,
}

/// A module among the others: what cuts its outline into cells.
pub(super) struct Part<'a> {
    board: &'a Board,
    /// The edges with nothing beside them.
    free: Vec<Cut>,
    /// By taxel.
    cuts: Vec<Vec<Cut>>,
}

impl<'a> Part<'a> {
    pub(super) fn new(board: &'a Board, boards: &[Board], places_mm: &[Option<Vector3<f64>>]) -> Self {
        // All other taxels: where they are, and where in this module's plane.
        let others: Vec<(Vector3<f64>, Point)> = (0..places_mm.len())
            .filter(|taxel| !board.taxels.contains(taxel))
            .filter_map(|taxel| {
                let (place, of) = (places_mm[taxel]?, boards.iter().find(|other| other.taxels.contains(&taxel)));
                Some((place, of.map_or(board.plane.project(place), |of| board.plane.unfold(place, &of.plane))))
            })
            .collect();
        let widest = board.outline(board.rim_mm);
        let cuts = |(taxel, &here): (usize, &Point)| {
            let own = board.flat.iter().filter_map(|&there| Cut::between(here, there, length(minus(there, here))));
            let mut cuts: Vec<Cut> = own.collect();
            let reach_mm = 2.0 * widest.cut_by(&cuts).radius_about(here); // from further away nothing can cut it
            let place = places_mm[board.taxels.start + taxel].unwrap_or_default();
            cuts.extend(others.iter().filter_map(|&(other, there)| {
                // Never nearer than in space: across a thin limb another taxel may be right behind this one.
                let distance_mm = length(minus(there, here)).max((other - place).norm());
                if distance_mm < reach_mm { Cut::between(here, there, distance_mm) } else { None }
            }));
            cuts
        };
        let beside = |side: &[Point; 2]| others.iter().any(|(_, there)| is_beside(*there, side, board.rim_mm));
        let sides = board.hull.sides().filter(|side| !beside(side));
        Self {
            board,
            free: sides.map(|side| Cut::along(&side, board.rim_mm)).collect(),
            cuts: board.flat.iter().enumerate().map(cuts).collect(),
        }
    }

    /// The areas of its cells, mm2, with edges beside other modules so much further out, at most by the rim.
    pub(super) fn cells(&self, refill_mm: f64) -> impl Iterator<Item = f64> {
        let outline = self.board.outline(refill_mm.min(self.board.rim_mm)).cut_by(&self.free);
        self.cuts.iter().map(move |cuts| outline.cut_by(cuts).area())
    }
}

/// Whether a place is within [`BESIDE_RIMS`] of a side of a hull, beyond it, and not further along than its ends and a
/// rim: positions that are off make many sides of one.
fn is_beside(place: Point, side: &[Point; 2], rim_mm: f64) -> bool {
    let (along, from) = (minus(side[1], side[0]), minus(place, side[0]));
    let long = length(along);
    let dot = (along[0] * from[0] + along[1] * from[1]) / long;
    let beyond = (along[1] * from[0] - along[0] * from[1]) / long;
    (-rim_mm..=long + rim_mm).contains(&dot) && beyond > 0.0 && beyond <= BESIDE_RIMS * rim_mm
}

impl Cut {
    /// Leaves what is nearer to `here` than to a place in the direction of `there` at this distance; `None` where there
    /// is no direction.
    fn between(here: Point, there: Point, distance_mm: f64) -> Option<Self> {
        let step = minus(there, here);
        let projected_mm = length(step);
        if projected_mm < SAME_PLACE_MM {
            return None;
        }
        let direction = step.map(|c| c / projected_mm);
        Some(Self { direction, limit: here[0] * direction[0] + here[1] * direction[1] + 0.5 * distance_mm })
    }

    /// Leaves what is within `rim_mm` of a side, or behind it.
    fn along(side: &[Point; 2], rim_mm: f64) -> Self {
        let along = minus(side[1], side[0]);
        let long = length(along);
        let direction = [along[1] / long, -along[0] / long];
        Self { direction, limit: side[0][0] * direction[0] + side[0][1] * direction[1] + rim_mm }
    }
}

impl Convex {
    fn cut_by(&self, cuts: &[Cut]) -> Self {
        let mut left = self.clone();
        cuts.iter().for_each(|cut| left.cut(cut.direction, cut.limit));
        left
    }
}
