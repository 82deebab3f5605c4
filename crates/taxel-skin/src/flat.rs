//! The skin laid flat, for pictures of it: a limb is unrolled about its axis, any other skin is seen from its broad side.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

type Vector = Vector3<f64>;

/// Normals whose mean is longer are those of a flat skin.
const FLAT: f64 = 0.93;
/// Taxels in a row where there are no positions: of three modules of iCub.
const ROW: usize = 30;

/// Where each of so many taxels lies, x to the right and y down, seen from outside, in the unit of the positions. Positions and
/// outward normals are those that are known.
#[must_use]
pub fn flat(taxels: usize, positions: &[[f64; 3]], normals: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let [places, normals] = [positions, normals].map(|all| all.iter().copied().map(Vector::from).collect::<Vec<_>>());
    if places.is_empty() || places.len() < taxels {
        // Nobody says where they are: in rows, by their numbers.
        return (0..taxels).map(|taxel| [(taxel % ROW) as f64, (taxel / ROW) as f64]).collect();
    }
    let (middle, outward) = (mean(&places), mean(&normals));
    if normals.len() < places.len() || outward.norm() > FLAT {
        let [_, short, long] = axes(places.iter().map(|place| place - middle));
        let down = long.cross(&outward).try_normalize(1e-9).unwrap_or(short);
        return places.iter().map(|place| [(place - middle).dot(&long), (place - middle).dot(&down)]).collect();
    }
    let [axis, side, _] = axes(normals.iter().copied());
    let around = axis.cross(&side);
    let across = |v: Vector| v - axis * v.dot(&axis);
    // Along the normal from the middle, as far as places change with their normals, is the centre of the limb.
    let pairs = normals.iter().zip(&places).map(|(normal, place)| (across(normal - outward), across(place - middle)));
    let (both, square) =
        pairs.fold((0.0, 1e-9), |(both, square), (n, p)| (both + n.dot(&p), square + n.norm_squared()));
    let radius = (both / square).abs();
    let centre = middle - across(outward) * radius;
    let angle = |place: &Vector| (place - centre).dot(&around).atan2((place - centre).dot(&side));
    let cut = after_widest_gap(places.iter().map(angle).collect());
    places.iter().map(|place| [(place - centre).dot(&axis), radius * (angle(place) - cut).rem_euclid(TAU)]).collect()
}

fn mean(all: &[Vector]) -> Vector {
    all.iter().sum::<Vector>() / (all.len() as f64).max(1.0)
}

/// The directions in which vectors extend, the least first.
fn axes(all: impl Iterator<Item = Vector>) -> [Vector; 3] {
    let found = all.map(|v| v * v.transpose()).sum::<Matrix3<f64>>().symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| found.eigenvalues[*a].total_cmp(&found.eigenvalues[*b]));
    order.map(|column| found.eigenvectors.column(column).into_owned())
}

/// The angle that follows the widest gap between angles.
fn after_widest_gap(mut angles: Vec<f64>) -> f64 {
    angles.sort_by(f64::total_cmp);
    let gap = |at: &usize| (angles[*at] - angles[at.checked_sub(1).unwrap_or(angles.len() - 1)]).rem_euclid(TAU);
    let widest = (0..angles.len()).max_by(|a, b| gap(a).total_cmp(&gap(b)));
    widest.map_or(0.0, |at| angles[at])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limb_is_unrolled_at_its_gap_and_neighbours_stay_neighbours() {
        // Three quarters of a tube of 50 mm radius about the z axis.
        let taxel = |(ring, step): (u32, u32)| {
            let (sin, cos) = (0.3 + f64::from(step) * 0.1).sin_cos();
            ([0.2 + 0.05 * cos, 0.05 * sin, 0.006 * f64::from(ring)], [cos, sin, 0.0])
        };
        let all = (0..5).flat_map(|ring| (0..48).map(move |step| (ring, step)));
        let (positions, normals): (Vec<_>, Vec<_>) = all.map(taxel).unzip();
        let places = flat(positions.len(), &positions, &normals);
        for pair in places.chunks(48).flat_map(|ring| ring.windows(2)) {
            let apart = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            assert!((apart - 0.005).abs() < 1e-6, "{pair:?}");
        }
    }
}
