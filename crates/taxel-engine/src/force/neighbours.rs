//! Which taxels lie beside which, from the geometry.
//!
//! Touch at the edge of a contact is too weak for a taxel to be activated by itself. Beside an activated one, the low of two
//! thresholds suffices ([`Neighbours::grow`]; hysteresis thresholding after Canny 1986). What lies on a taxel that cannot be read
//! follows from those beside it (`coverage.rs`).

use taxel_skin::Geometry;

use crate::statistics::median;

/// Taxels within this distance are neighbours: a little more than the 6.5 mm pitch of iCub's triangles. What presses on one
/// is felt so far away through two millimetres of layer.
const REACH_MAX_M: f64 = 0.008;

/// On a finer skin those within so many times the distance of the nearest taxel, in the median, are: of a grid the eight
/// around one. Others have taxels between, and would not feel what presses there.
const REACH_PITCHES: f64 = 1.6;

/// A taxel at the rim of the skin has its neighbours on one side: the mean of the directions to them is at least so long.
/// Of a straight rim it is 0.43, of a corner 0.87, and 0 where neighbours lie all around.
const ONE_SIDED: f64 = 0.4;

/// The neighbours of every taxel, ascending.
#[derive(Clone, Debug)]
pub struct Neighbours {
    of: Vec<Vec<u16>>,
    /// Whether the taxel lies at the rim of the skin: what presses on it from beyond reaches no neighbour.
    at_rim: Vec<bool>,
}

impl Neighbours {
    /// The label of a taxel beside touched ones that is not touched itself.
    pub const BESIDE: u16 = u16::MAX;

    /// Taxels without a position have no neighbours.
    pub fn new(geometry: &Geometry) -> Self {
        let place = |taxel: usize| geometry.poses[taxel].map(|pose| pose.position);
        let taxels = geometry.poses.len();
        let apart2 = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>();
        let nearest2 = |taxel: usize| {
            let here = place(taxel)?;
            let others = (0..taxels).filter(|&other| other != taxel).filter_map(place);
            // Two at one place are an error of the file, and no pitch.
            others.map(|other| apart2(here, other)).filter(|d| *d > 0.0).min_by(f64::total_cmp)
        };
        let pitch_m = median((0..taxels).filter_map(nearest2).map(f64::sqrt)).unwrap_or(REACH_MAX_M);
        let reach_m = (REACH_PITCHES * pitch_m).min(REACH_MAX_M);
        let near = |a: [f64; 3], b: [f64; 3]| apart2(a, b) <= reach_m * reach_m;
        let beside = |taxel: usize| {
            let here = place(taxel);
            let others = (0..taxels).filter(|&other| other != taxel);
            let close = others.filter(|&other| here.zip(place(other)).is_some_and(|(a, b)| near(a, b)));
            close.map(|other| other as u16).collect()
        };
        let of: Vec<Vec<u16>> = (0..taxels).map(beside).collect();
        let at_rim = (0..taxels).map(|taxel| is_one_sided(taxel, &of[taxel], place)).collect();
        Self { of, at_rim }
    }

    /// Adds to `active` (taxel, value) what is connected to it through taxels that `low` gives a value above zero, and
    /// numbers the contacts: in `labels`, by taxel, from 1. Returns how many there are. What was in `labels` does not
    /// matter; taxels that are not active end at 0, those beside active ones at [`Neighbours::BESIDE`], and in `ring` with one that
    /// they lie beside.
    pub fn grow(
        &self,
        active: &mut Vec<(usize, f64)>,
        labels: &mut Vec<u16>,
        ring: &mut Vec<(usize, usize)>,
        low: impl Fn(usize) -> f64,
    ) -> usize {
        const TOUCHED: u16 = u16::MAX - 1;
        labels.clear();
        labels.resize(self.of.len(), 0);
        for &(taxel, _) in active.iter() {
            labels[taxel] = TOUCHED;
        }
        let (seeds, mut contacts) = (active.len(), 0);
        let mut frontier = Vec::new();
        for seed in 0..seeds {
            let (taxel, _) = active[seed];
            if labels[taxel] != TOUCHED {
                continue;
            }
            contacts += 1;
            labels[taxel] = contacts;
            frontier.push(taxel);
            while let Some(taxel) = frontier.pop() {
                for &other in &self.of[taxel] {
                    let other = usize::from(other);
                    let value = if labels[other] == 0 { low(other) } else { 0.0 };
                    if value > 0.0 {
                        active.push((other, value));
                    }
                    if value > 0.0 || labels[other] == TOUCHED {
                        labels[other] = contacts;
                        frontier.push(other);
                    } else if labels[other] == 0 {
                        labels[other] = Self::BESIDE;
                        ring.push((other, taxel));
                    }
                }
            }
        }
        usize::from(contacts)
    }

    /// Whether a taxel lies at the rim of the skin.
    pub fn is_at_rim(&self, taxel: usize) -> bool {
        self.at_rim[taxel]
    }

    /// The neighbours of a taxel, ascending.
    pub fn of(&self, taxel: usize) -> impl Iterator<Item = usize> {
        self.of[taxel].iter().map(|&other| usize::from(other))
    }

    /// The taxels without a pressure beside touched ones, ascending. `touched` are taxels and what they bear.
    pub fn missing_beside(
        &self,
        touched: &[(usize, f64)],
        has_pressure: impl Fn(usize) -> bool,
        missing: &mut Vec<usize>,
    ) {
        missing.clear();
        missing.extend(touched.iter().flat_map(|&(taxel, _)| self.of(taxel)).filter(|&other| !has_pressure(other)));
        missing.sort_unstable();
        missing.dedup();
    }
}

/// Whether the neighbours of a taxel lie on one side of it.
fn is_one_sided(taxel: usize, neighbours: &[u16], place: impl Fn(usize) -> Option<[f64; 3]>) -> bool {
    let Some(here) = place(taxel) else { return true }; // it may lie anywhere
    let mut sum = [0.0; 3];
    for there in neighbours.iter().filter_map(|&other| place(usize::from(other))) {
        let way = [0, 1, 2].map(|axis| there[axis] - here[axis]);
        let length = way.iter().map(|part| part * part).sum::<f64>().sqrt();
        sum.iter_mut().zip(way).for_each(|(sum, part)| *sum += part / length);
    }
    let length = sum.iter().map(|part| part * part).sum::<f64>().sqrt();
    length >= ONE_SIDED * neighbours.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::TaxelPose;

    /// A row of taxels 6 mm apart.
    fn row(taxels: usize) -> Neighbours {
        Neighbours::new(&crate::force::tests::row(taxels))
    }

    /// A grid of so many taxels a side, this pitch apart.
    fn grid(side: usize, pitch_m: f64) -> Neighbours {
        let place = |i: usize| [pitch_m * (i % side) as f64, pitch_m * (i / side) as f64, 0.0];
        let pose = |i: usize| Some(TaxelPose { position: place(i), normal: [0.0, 0.0, 1.0] });
        Neighbours::new(&Geometry::from_poses((0..side * side).map(pose).collect()))
    }

    #[test]
    fn on_a_fine_grid_only_the_taxels_around_one_are_its_neighbours() {
        for pitch_m in [0.001, 0.002, 0.004] {
            let fine = grid(16, pitch_m);
            let amid: usize = 8 * 16 + 8;
            let around = [-17_isize, -16, -15, -1, 1, 15, 16, 17].map(|step| amid.checked_add_signed(step).unwrap());
            assert_eq!(fine.of(amid).collect::<Vec<_>>(), around, "{pitch_m} m");
        }
        assert_eq!(grid(8, 0.007).of(27).collect::<Vec<_>>(), [19, 26, 28, 35], "no further than 8 mm");
        assert_eq!(grid(8, 0.009).of(27).count(), 0);
    }

    #[test]
    fn weak_touch_counts_only_where_it_is_connected_to_a_strong_one() {
        let weak = [0.0, 1.0, 1.0, 0.0, 1.0, 1.0];
        let mut active = vec![(0, 5.0)];
        let (mut labels, mut ring) = (Vec::new(), Vec::new());
        let contacts = row(6).grow(&mut active, &mut labels, &mut ring, |taxel| weak[taxel]);
        assert_eq!(active, [(0, 5.0), (1, 1.0), (2, 1.0)]);
        assert_eq!((contacts, &labels[..3], &ring[..]), (1, [1, 1, 1].as_slice(), [(3, 2)].as_slice()));
    }

    #[test]
    fn contacts_that_nothing_connects_have_numbers_of_their_own() {
        let weak = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let (mut active, mut labels) = (vec![(0, 5.0), (2, 1.0), (4, 5.0), (6, 2.0)], Vec::new());
        assert_eq!(row(7).grow(&mut active, &mut labels, &mut Vec::new(), |taxel| weak[taxel]), 3);
        assert_eq!([0, 2, 3, 4, 6].map(|taxel| labels[taxel]), [1, 2, 2, 2, 3]);
    }

    #[test]
    fn taxels_at_the_rim_have_their_neighbours_on_one_side() {
        let grid = grid(5, 0.004);
        let inside = |taxel: usize| [taxel % 5, taxel / 5].iter().all(|at| (1..4).contains(at));
        for taxel in 0..25 {
            assert_eq!(grid.at_rim[taxel], !inside(taxel), "{taxel}");
        }
    }
}
