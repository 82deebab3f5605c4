//! Which taxels lie beside which, from the geometry: two uses, both to lose less force.
//!
//! - Touch at the edge of a contact is too weak for a taxel to be activated by itself. Beside an activated one, the low
//!   of two thresholds suffices ([`Neighbours::grow`]; hysteresis thresholding after Canny 1986).
//! - The area of an excluded taxel is not silently lost: its pressure is taken from its neighbours
//!   ([`Neighbours::fill`]), on request.

use taxel_skin::Geometry;

/// Taxels within this distance are neighbours: a little more than the 6.5 mm pitch of iCub's triangles.
const REACH_M: f64 = 0.008;

/// A filled pressure rests on at least so many neighbours.
const FILL_NEIGHBOURS_MIN: usize = 2;

/// The neighbours of every taxel, ascending.
#[derive(Clone, Debug)]
pub struct Neighbours {
    of: Vec<Vec<u16>>,
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

impl Neighbours {
    /// Taxels without a position have no neighbours.
    #[must_use]
    pub fn new(geometry: &Geometry) -> Self {
        let place = |taxel: usize| geometry.poses[taxel].map(|pose| pose.position);
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>() <= REACH_M * REACH_M;
        let taxels = geometry.poses.len();
        let beside = |taxel: usize| {
            let here = place(taxel);
            let others = (0..taxels).filter(|&other| other != taxel);
            let close = others.filter(|&other| here.zip(place(other)).is_some_and(|(a, b)| near(a, b)));
            close.map(|other| other as u16).collect()
        };
        Self { of: (0..taxels).map(beside).collect() }
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

    /// The neighbours of a taxel, ascending.
    pub fn of(&self, taxel: usize) -> impl Iterator<Item = usize> {
        self.of[taxel].iter().map(|&other| usize::from(other))
    }

    /// Appends pressures for taxels that have none, where at least two neighbours have one and one of these is touched.
    ///
    /// `has_pressure` is whether a taxel has a pressure of its own, `pressure_kpa` is that: zero where nothing touches it.
    pub fn fill(
        &self,
        touched: &[(usize, f64)],
        has_pressure: impl Fn(usize) -> bool,
        pressure_kpa: impl Fn(usize) -> f64,
        filled: &mut Vec<Filled>,
    ) {
        let first = filled.len();
        for &(taxel, _) in touched {
            for &missing in self.of[taxel].iter().filter(|&&other| !has_pressure(usize::from(other))) {
                filled.push(Filled { taxel: usize::from(missing), kpa: 0.0, sigma_kpa: 0.0 });
            }
        }
        filled[first..].sort_unstable_by_key(|f| f.taxel);
        filled.dedup_by_key(|f| f.taxel);
        filled.retain_mut(|f| {
            let known = || self.of(f.taxel).filter(|&other| has_pressure(other)).map(&pressure_kpa);
            let Some((kpa, sigma_kpa)) = mean_and_scatter(known) else { return false };
            (f.kpa, f.sigma_kpa) = (kpa, sigma_kpa);
            true
        });
    }
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
    fn row(taxels: usize) -> Neighbours {
        let pose = |i: usize| TaxelPose { position: [0.006 * i as f64, 0.0, 0.0], normal: [0.0, 0.0, 1.0] };
        Neighbours::new(&Geometry::from_poses((0..taxels).map(|i| Some(pose(i))).collect()))
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
        let mut filled = Vec::new();
        row(5).fill(&[(1, 1.0), (3, 1.0)], has, kpa, &mut filled);
        assert_eq!(filled.len(), 1, "taxel 4 has one neighbour only");
        assert_eq!((filled[0].taxel, filled[0].kpa), (2, 12.0));
        assert!((filled[0].sigma_kpa - 8.0_f64.sqrt()).abs() < 1e-12);
    }
}
