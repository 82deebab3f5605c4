//! Which taxels lie beside which, from the geometry: two uses, both to lose less force.
//!
//! - Touch at the edge of a contact is too weak for a taxel to be activated by itself. Beside an activated one, the low
//!   of two thresholds suffices ([`Neighbours::grow`]; hysteresis thresholding after Canny 1986).
//! - The area of an excluded taxel is not silently lost: its pressure is taken from its neighbours
//!   ([`Neighbours::fill`]), on request.

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

/// A taxel with so much of what all taxels about it read is one of the three that a contact touches at most.
const LARGE_SHARE: f64 = 0.3;
/// Of a contact that reads less than this share of all that is touched, what lies unseen beside it is little, too; and one
/// taxel that noise has touched is no contact.
const SMALL_SHARE: f64 = 0.05;
/// Where the taxels beside one at the rim read so many times as much as the next ones together, a contact's tip lies between
/// them.
const TIP_RATIO: f64 = 2.0;
/// A taxel beside one amid the skin reads the flank of a contact whose tip lies there if those beyond it read less than this
/// share of its pressure in the mean, and the tip lies there if such flanks have so much of what is read about it. Chosen so that
/// a fingertip or a small mass there is told; a wider contact is then told in vain now and then, which is the safe side. The
/// fingertips of the stories in `tests/README.md` hold it.
const FLANK_FALLS_TO: f64 = 0.35;
const FLANKS_SHARE: f64 = 0.5;
/// Flanks that read less than this together, kPa, are those of a tip that bears no more than what any skin may bear unseen: it reads
/// some fifteen times as much as their mean.
const FLANKS_MIN_KPA: f64 = 3.0;
/// Beside one taxel another is well touched if it reads more than this share of its pressure.
const WELL_TOUCHED_SHARE: f64 = 0.25;

/// The neighbours of every taxel, ascending.
#[derive(Clone, Debug)]
pub struct Neighbours {
    of: Vec<Vec<u16>>,
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

/// Where touched taxels lie beside others that have no pressure of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rim {
    /// Taxels without a pressure beside touched ones.
    pub without: usize,
    /// Touched taxels.
    pub touched: usize,
    /// Of those without one, how many may bear most of a contact: its tip lies amid taxels that it hardly reaches, or, at the
    /// rim of the skin, beyond the only one that is well touched.
    pub beyond: usize,
}

impl Rim {
    /// Whether more of a contact may lie on taxels without a pressure than on those that have one.
    #[must_use]
    pub const fn is_mostly_blind(self) -> bool {
        self.without > self.touched || self.beyond > 0
    }
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
        Self { of, at_rim }
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

    /// Appends pressures for taxels that have none, where at least two neighbours have one and one of these is touched.
    /// Returns how a contact lies on taxels without one.
    ///
    /// `has_pressure` is whether a taxel has a pressure of its own, `pressure_kpa` is that: zero where nothing touches it.
    pub fn fill(
        &self,
        touched: &[(usize, f64)],
        has_pressure: impl Fn(usize) -> bool,
        pressure_kpa: impl Fn(usize) -> f64,
        filled: &mut Vec<Filled>,
    ) -> Rim {
        let (first, mut rim) = (filled.len(), Rim::default());
        for &(taxel, _) in touched {
            for missing in self.of(taxel).filter(|&other| !has_pressure(other)) {
                filled.push(Filled { taxel: missing, kpa: pressure_kpa(taxel), sigma_kpa: 0.0 });
            }
        }
        filled[first..].sort_unstable_by_key(|f| f.taxel);
        if filled.len() > first {
            let runs = filled[first..].chunk_by(|a, b| a.taxel == b.taxel);
            let sum_kpa: f64 = touched.iter().map(|&(taxel, _)| pressure_kpa(taxel)).sum();
            let own = |taxel: usize| if has_pressure(taxel) { pressure_kpa(taxel) } else { 0.0 };
            rim.beyond = runs.filter(|run| self.bears_most(run, sum_kpa, own)).count();
        }
        filled.dedup_by_key(|f| f.taxel);
        (rim.without, rim.touched) = (filled.len() - first, touched.len());
        filled.retain_mut(|f| {
            let known = || self.of(f.taxel).filter(|&other| has_pressure(other)).map(&pressure_kpa);
            let Some((kpa, sigma_kpa)) = mean_and_scatter(known) else { return false };
            (f.kpa, f.sigma_kpa) = (kpa, sigma_kpa);
            true
        });
        rim
    }

    /// Whether most of a contact may lie on the taxel without a pressure that these touched ones are beside, of `sum_kpa` over
    /// all that is touched. Other contacts have no say in it, so it is held against what its own surroundings read.
    fn bears_most(&self, run: &[Filled], sum_kpa: f64, kpa: impl Fn(usize) -> f64) -> bool {
        let missing = run[0].taxel;
        let beside_kpa: f64 = self.of(missing).map(&kpa).sum();
        if beside_kpa < SMALL_SHARE * sum_kpa {
            return false;
        }
        let is_next = |other: &usize| *other != missing && !self.of[missing].contains(&(*other as u16));
        if !self.at_rim[missing] {
            let is_flank = |beside: &usize| {
                let (count, sum) =
                    self.of(*beside).filter(is_next).fold((0.0, 0.0), |(n, sum), t| (n + 1.0, sum + kpa(t)));
                sum < FLANK_FALLS_TO * count * kpa(*beside) || (count == 0.0 && kpa(*beside) > 0.0)
            };
            let flanks_kpa: f64 = self.of(missing).filter(is_flank).map(&kpa).sum();
            return flanks_kpa >= (FLANKS_SHARE * beside_kpa).max(FLANKS_MIN_KPA);
        }
        let mut next: Vec<usize> = self.of(missing).flat_map(|other| self.of(other)).filter(is_next).collect();
        next.sort_unstable();
        next.dedup();
        let next_kpa: f64 = next.into_iter().map(&kpa).sum();
        let (first, second) = greatest_two(run);
        // Nobody has seen the tip of the contact, or it lies beyond the one taxel that has most of it.
        let has_most = second <= WELL_TOUCHED_SHARE * first && first >= LARGE_SHARE * (beside_kpa + next_kpa);
        has_most || beside_kpa >= TIP_RATIO * next_kpa
    }
}

/// The two greatest of these pressures, 0 where there are none.
fn greatest_two(touched: &[Filled]) -> (f64, f64) {
    touched
        .iter()
        .fold((0.0_f64, 0.0_f64), |(first, second), filled| (first.max(filled.kpa), second.max(filled.kpa.min(first))))
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
    fn row(taxels: usize) -> Neighbours {
        let pose = |i: usize| TaxelPose { position: [0.006 * i as f64, 0.0, 0.0], normal: [0.0, 0.0, 1.0] };
        Neighbours::new(&Geometry::from_poses((0..taxels).map(|i| Some(pose(i))).collect()))
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
        let mut filled = Vec::new();
        let rim = row(5).fill(&[(1, 1.0), (3, 1.0)], has, kpa, &mut filled);
        assert_eq!(
            rim,
            Rim { without: 2, touched: 2, beyond: 2 },
            "the tip may lie on 2, or beyond the end of the row"
        );
        assert_eq!(filled.len(), 1, "taxel 4 has one neighbour only");
        assert_eq!((filled[0].taxel, filled[0].kpa), (2, 12.0));
        assert!((filled[0].sigma_kpa - 8.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_contact_that_touches_one_taxel_between_two_without_a_pressure_may_lie_on_these() {
        let has = |taxel: usize| taxel.is_multiple_of(2);
        let rim = |touched: &[(usize, f64)]| {
            let kpa = |taxel: usize| touched.iter().find(|(other, _)| *other == taxel).map_or(0.0, |(_, kpa)| *kpa);
            row(7).fill(touched, has, kpa, &mut Vec::new())
        };
        assert_eq!(rim(&[]), Rim::default());
        assert_eq!(rim(&[(2, 9.0)]), Rim { without: 2, touched: 1, beyond: 2 });
        assert_eq!(rim(&[(0, 9.0)]), Rim { without: 1, touched: 1, beyond: 1 });
        assert!(rim(&[(0, 9.0)]).is_mostly_blind());
        assert_eq!(rim(&[(0, 1.0)]), Rim { without: 1, touched: 1, beyond: 0 }, "of a tip that is not worth a word");
    }

    /// A hexagonal patch of 19 taxels, a centre, six about it, twelve at the rim, and the ring that each lies on.
    fn hexagon() -> (Neighbours, Vec<i32>) {
        let pitch = 0.0065;
        let at =
            |q: i32, r: i32| [pitch * (f64::from(q) + 0.5 * f64::from(r)), pitch * 0.75_f64.sqrt() * f64::from(r), 0.0];
        let all = (-2_i32..=2).flat_map(|q| (-2_i32..=2).map(move |r| (q, r))).filter(|(q, r)| (q + r).abs() <= 2);
        let ring = |(q, r): (i32, i32)| q.abs().max(r.abs()).max((q + r).abs());
        let (places, rings): (Vec<_>, Vec<_>) = all.map(|place| (at(place.0, place.1), ring(place))).unzip();
        let poses = places.into_iter().map(|position| Some(TaxelPose { position, normal: [0.0, 0.0, 1.0] })).collect();
        (Neighbours::new(&Geometry::from_poses(poses)), rings)
    }

    #[test]
    fn taxels_at_the_rim_have_their_neighbours_on_one_side() {
        let (neighbours, rings) = hexagon();
        assert_eq!(rings.len(), 19);
        for (taxel, ring) in rings.iter().enumerate() {
            assert_eq!(neighbours.at_rim[taxel], *ring == 2, "{taxel}");
        }
    }

    /// Both neighbours of a corner that has no pressure read the same, so that their scatter says nothing of the tip there.
    #[test]
    fn a_contact_about_a_corner_without_a_pressure_may_lie_on_it() {
        let (neighbours, rings) = hexagon();
        let corner = (0..19).find(|&taxel| neighbours.of(taxel).count() == 3).unwrap();
        let amid = neighbours.of(corner).find(|&taxel| rings[taxel] == 1).unwrap();
        let rim = |kpa: &dyn Fn(usize) -> f64| {
            let touched: Vec<_> = (0..19).filter(|&t| t != corner && kpa(t) > 0.0).map(|t| (t, kpa(t))).collect();
            neighbours.fill(&touched, |taxel| taxel != corner, kpa, &mut Vec::new())
        };
        let about = |place: usize| {
            let neighbours = &neighbours;
            move |taxel: usize| if neighbours.of(place).any(|other| other == taxel) { 50.0 } else { 2.0 }
        };
        assert_eq!(rim(&about(corner)), Rim { without: 1, touched: 18, beyond: 1 });
        let within = |taxel: usize| if taxel == amid { 100.0 } else { about(amid)(taxel) };
        assert!(!rim(&within).is_mostly_blind(), "its tip is seen");
    }

    /// Of a fingertip on it the six about it feel little and alike, and no scatter says what is missing.
    #[test]
    fn the_tip_of_a_small_contact_amid_the_skin_may_lie_on_a_taxel_without_a_pressure() {
        let (neighbours, rings) = hexagon();
        let centre = rings.iter().position(|ring| *ring == 0).unwrap();
        let one = rings.iter().position(|ring| *ring == 1).unwrap();
        let beyond = |kpa: &dyn Fn(usize) -> f64| {
            let touched: Vec<_> = (0..19).filter(|&t| t != centre && kpa(t) > 0.0).map(|t| (t, kpa(t))).collect();
            neighbours.fill(&touched, |taxel| taxel != centre, kpa, &mut Vec::new()).beyond
        };
        assert_eq!(beyond(&|taxel| [0.0, 20.0, 0.5][rings[taxel] as usize]), 1);
        assert_eq!(beyond(&|taxel| [0.0, 50.0, 20.0][rings[taxel] as usize]), 0, "a wide contact");
        let about_one = |taxel: usize| match neighbours.of(one).any(|other| other == taxel) {
            _ if taxel == one => 50.0,
            true => 40.0,
            false => 10.0,
        };
        assert_eq!(beyond(&about_one), 0, "the tip is on a taxel that feels it");
    }

    #[test]
    fn what_lies_elsewhere_has_no_say_in_what_a_taxel_without_a_pressure_may_bear() {
        let (neighbours, corner) = (grid(8, 0.0065), 0);
        let rim = |at_corner: f64| {
            let kpa = |taxel: usize| match taxel {
                1 | 8 => at_corner,
                40.. => 50.0,
                _ => 0.0,
            };
            let touched: Vec<_> = (1..64).filter(|&taxel| kpa(taxel) > 0.0).map(|taxel| (taxel, kpa(taxel))).collect();
            neighbours.fill(&touched, |taxel| taxel != corner, kpa, &mut Vec::new())
        };
        assert_eq!(rim(0.0).beyond, 0);
        assert_eq!(rim(50.0), Rim { without: 1, touched: 26, beyond: 1 }, "a contact whose tip nobody has seen");
        assert_eq!(rim(2.0).beyond, 0, "noise");
    }
}
