//! Which taxels lie beside which, from the geometry: three uses, all to lose less force.
//!
//! - Touch at the edge of a contact is too weak for a taxel to be activated by itself. Beside an activated one, the low
//!   of two thresholds suffices ([`Neighbours::grow`]; hysteresis thresholding after Canny 1986).
//! - The area of an excluded taxel is not silently lost: its pressure is taken from its neighbours
//!   ([`Neighbours::fill`]), on request.
//! - What of a contact may lie on a taxel that cannot be read is told by those about it ([`Neighbours::hidden_kpa`]).

mod tip;

use taxel_skin::Geometry;

use crate::statistics::median;

/// Taxels within this distance are neighbours: a little more than the 6.5 mm pitch of iCub's triangles. What presses on one
/// is felt so far away through two millimetres of layer.
const REACH_MAX_M: f64 = 0.008;

/// On a finer skin those within so many times the distance of the nearest taxel, in the median, are: of a grid the eight
/// around one. Others have taxels between, and would not feel what presses there.
const REACH_PITCHES: f64 = 1.6;

/// A filled pressure rests on at least so many neighbours.
const FILL_NEIGHBOURS_MIN: usize = 2;

/// A taxel at the rim of the skin has its neighbours on one side: the mean of the directions to them is at least so long.
/// Of a straight rim it is 0.43, of a corner 0.87, and 0 where neighbours lie all around.
const ONE_SIDED: f64 = 0.4;

/// The neighbours of every taxel, ascending.
#[derive(Clone, Debug)]
pub struct Neighbours {
    of: Vec<Vec<u16>>,
    /// The neighbours of these that are none of the taxel itself, and theirs beyond them.
    next: Vec<Vec<u16>>,
    third: Vec<Vec<u16>>,
    /// Distance of the nearest taxel, in the median, in metres.
    pitch_m: f64,
    /// Whether the taxel lies at the rim of the skin: what presses on it from beyond reaches no neighbour.
    at_rim: Vec<bool>,
}

/// A pressure taken from neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filled {
    /// The taxel without one of its own.
    pub taxel: usize,
    /// Mean of its neighbours, in kPa.
    pub kpa: f64,
    /// Standard deviation among its neighbours: how far a single taxel is from their mean.
    pub sigma_kpa: f64,
}

/// What a taxel reads without any threshold.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Its pressure, kPa; below zero where noise takes it there.
    pub kpa: f64,
    /// Standard deviation of that, kPa.
    pub noise_kpa: f64,
}

impl Neighbours {
    /// Taxels without a position have no neighbours.
    #[must_use]
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
        let nothing = vec![Vec::new(); taxels];
        let next = rings_around(&of, &of, &nothing);
        let third = rings_around(&of, &next, &of);
        Self { of, next, third, pitch_m, at_rim }
    }

    /// Adds to `active` (taxel, value) what is connected to it through taxels that `low` gives a value above zero, and
    /// numbers the contacts: in `labels`, by taxel, from 1. Returns how many there are. What was in `labels` does not
    /// matter; taxels that are not active end at 0 or [`u16::MAX`].
    pub fn grow(&self, active: &mut Vec<(usize, f64)>, labels: &mut Vec<u16>, low: impl Fn(usize) -> f64) -> usize {
        const TOUCHED: u16 = u16::MAX - 1;
        const NOT: u16 = u16::MAX;
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
                        labels[other] = NOT;
                    }
                }
            }
        }
        usize::from(contacts)
    }

    /// Whether a taxel has enough neighbours with a pressure of their own, so that a load on it would show.
    #[must_use]
    pub fn cover(&self, taxel: usize, has_pressure: impl Fn(usize) -> bool) -> bool {
        let known = self.of[taxel].iter().filter(|&&other| has_pressure(usize::from(other))).count();
        known >= FILL_NEIGHBOURS_MIN
    }

    /// Whether a taxel lies at the rim of the skin.
    #[must_use]
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

    /// Appends pressures for those of `missing` of which at least two neighbours have one. `pressure_kpa` is that of a
    /// neighbour, 0 where nothing touches it.
    pub fn fill(
        &self,
        missing: &[usize],
        has_pressure: impl Fn(usize) -> bool,
        pressure_kpa: impl Fn(usize) -> f64,
        filled: &mut Vec<Filled>,
    ) {
        filled.extend(missing.iter().filter_map(|&taxel| {
            let known = || self.of(taxel).filter(|&other| has_pressure(other)).map(&pressure_kpa);
            mean_and_scatter(known).map(|(kpa, sigma_kpa)| Filled { taxel, kpa, sigma_kpa })
        }));
    }
}

/// For each taxel the neighbours of its `ring` that are neither in it nor in the ring `within` it, nor the taxel itself.
fn rings_around(of: &[Vec<u16>], ring: &[Vec<u16>], within: &[Vec<u16>]) -> Vec<Vec<u16>> {
    let around = |taxel: usize| {
        let is_inside =
            |other: &u16| usize::from(*other) == taxel || ring[taxel].contains(other) || within[taxel].contains(other);
        let beyond = ring[taxel].iter().flat_map(|&other| &of[usize::from(other)]).copied();
        let mut beyond: Vec<u16> = beyond.filter(|other| !is_inside(other)).collect();
        beyond.sort_unstable();
        beyond.dedup();
        beyond
    };
    (0..of.len()).map(around).collect()
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

/// Mean and standard deviation of `values`, which gives the same ones twice; `None` of fewer than
/// [`FILL_NEIGHBOURS_MIN`].
fn mean_and_scatter<I: Iterator<Item = f64>>(values: impl Fn() -> I) -> Option<(f64, f64)> {
    let (count, sum) = values().fold((0, 0.0), |(count, sum), value| (count + 1, sum + value));
    if count < FILL_NEIGHBOURS_MIN {
        return None;
    }
    let mean = sum / count as f64;
    let squares: f64 = values().map(|value| (value - mean).powi(2)).sum();
    Some((mean, (squares / (count - 1) as f64).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::TaxelPose;

    /// A row of taxels 6 mm apart.
    pub(super) fn row(taxels: usize) -> Neighbours {
        let pose = |i: usize| TaxelPose { position: [0.006 * i as f64, 0.0, 0.0], normal: [0.0, 0.0, 1.0] };
        Neighbours::new(&Geometry::from_poses((0..taxels).map(|i| Some(pose(i))).collect()))
    }

    /// A grid of so many taxels a side, this pitch apart.
    pub(super) fn grid(side: usize, pitch_m: f64) -> Neighbours {
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
            // Five rows without a pressure: what presses amid them, nobody feels.
            let has_pressure = |taxel: usize| !(6..11).contains(&(taxel / 16));
            assert!(fine.cover(6 * 16 + 8, has_pressure) && !fine.cover(amid, has_pressure), "{pitch_m} m");
        }
        assert_eq!(grid(8, 0.007).of(27).collect::<Vec<_>>(), [19, 26, 28, 35], "no further than 8 mm");
        assert_eq!(grid(8, 0.009).of(27).count(), 0);
    }

    #[test]
    fn weak_touch_counts_only_where_it_is_connected_to_a_strong_one() {
        let weak = [0.0, 1.0, 1.0, 0.0, 1.0, 1.0];
        let mut active = vec![(0, 5.0)];
        let mut labels = Vec::new();
        let contacts = row(6).grow(&mut active, &mut labels, |taxel| weak[taxel]);
        assert_eq!(active, [(0, 5.0), (1, 1.0), (2, 1.0)]);
        assert_eq!((contacts, &labels[..3]), (1, [1, 1, 1].as_slice()));
    }

    #[test]
    fn contacts_that_nothing_connects_have_numbers_of_their_own() {
        let weak = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let (mut active, mut labels) = (vec![(0, 5.0), (2, 1.0), (4, 5.0), (6, 2.0)], Vec::new());
        assert_eq!(row(7).grow(&mut active, &mut labels, |taxel| weak[taxel]), 3);
        assert_eq!([0, 2, 3, 4, 6].map(|taxel| labels[taxel]), [1, 2, 2, 2, 3]);
    }

    #[test]
    fn an_excluded_taxel_takes_the_mean_of_its_neighbours() {
        let pressures = [Some(0.0), Some(10.0), None, Some(14.0), None];
        let (has, kpa) = (|t: usize| pressures[t].is_some(), |t: usize| pressures[t].unwrap());
        let (mut missing, mut filled) = (vec![0], Vec::new());
        row(5).missing_beside(&[(3, 1.0), (1, 1.0)], has, &mut missing);
        assert_eq!(missing, [2, 4]);
        row(5).fill(&missing, has, kpa, &mut filled);
        assert_eq!(filled.len(), 1, "taxel 4 has one neighbour only");
        assert_eq!((filled[0].taxel, filled[0].kpa), (2, 12.0));
        assert!((filled[0].sigma_kpa - 8.0_f64.sqrt()).abs() < 1e-12);
    }

    /// A hexagonal patch of so many rings about a centre, and the ring that each taxel lies on.
    pub(super) fn hexagon(rings: i32) -> (Neighbours, Vec<usize>) {
        let pitch = 0.0065;
        let at =
            |q: i32, r: i32| [pitch * (f64::from(q) + 0.5 * f64::from(r)), pitch * 0.75_f64.sqrt() * f64::from(r), 0.0];
        let all = (-rings..=rings).flat_map(|q| (-rings..=rings).map(move |r| (q, r)));
        let ring = |(q, r): (i32, i32)| q.abs().max(r.abs()).max((q + r).abs());
        let all = all.filter(|&place| ring(place) <= rings);
        let (places, on): (Vec<_>, Vec<_>) = all.map(|place| (at(place.0, place.1), ring(place) as usize)).unzip();
        let poses = places.into_iter().map(|position| Some(TaxelPose { position, normal: [0.0, 0.0, 1.0] })).collect();
        (Neighbours::new(&Geometry::from_poses(poses)), on)
    }

    #[test]
    fn taxels_at_the_rim_have_their_neighbours_on_one_side() {
        let (neighbours, rings) = hexagon(2);
        assert_eq!(rings.len(), 19);
        for (taxel, ring) in rings.iter().enumerate() {
            assert_eq!(neighbours.at_rim[taxel], *ring == 2, "{taxel}");
        }
    }

    #[test]
    fn rings_lie_about_a_taxel_as_far_as_the_skin_goes() {
        let (neighbours, rings) = hexagon(4);
        let centre = rings.iter().position(|ring| *ring == 0).unwrap();
        for (ring, around) in [(1, &neighbours.of), (2, &neighbours.next), (3, &neighbours.third)] {
            let expected: Vec<u16> = (0..61).filter(|&taxel| rings[usize::from(taxel)] == ring).collect();
            assert_eq!((around[centre].len(), &around[centre]), (6 * ring, &expected));
        }
        let row = row(3);
        assert_eq!((&row.next[0], row.third[0].len(), row.next[1].len()), (&vec![2], 0, 0));
    }
}
