//! How much of a contact's tip may lie on a taxel that cannot be read.
//!
//! A fingertip presses on one taxel, and those beside it feel its flanks: they fall off to nothing at the next ones. Where a
//! wider load lies about them, too, it is on the third ring of taxels as well, and is taken off first.
//!
//! How much lies there is at most a multiple of what those beside it read in the mean, and of the least of them: that of round
//! contacts of 4 mm radius and more anywhere nearer to it than to another taxel, under the layer of iCub's skin (2 mm over pads of
//! 2 mm radius, 6.5 mm apart), of which the smallest hides the most. A wider one hides less, and so does each on a finer skin; on a
//! coarser one the flanks are further away. What is not covered: tips of less than 4 mm radius, and contacts whose middle lies beyond a
//! corner of the skin. These hide more.
//!
//! Without positions nobody knows which taxels those beside it are. One of its module at least is, so that it bears no more than a
//! multiple of what the most pressed of these reads; and while nothing of the patch is touched, than that of the mean over those
//! beside it, which is no more than the most pressed of the patch reads.

use super::{Neighbours, Reading};
use crate::statistics::quantile;

/// What a taxel bears, over the mean of what those beside it read: contacts in its middle come up to 25.
const HIDDEN_OVER_MEAN: f64 = 25.0;
/// The same over the least of them: contacts that lie towards another taxel come up to 125.
const HIDDEN_OVER_LEAST: f64 = 125.0;
/// At the rim, where those beside it lie on one side, a contact whose middle is at the edge hides so many times as much.
const AT_RIM: f64 = 1.4;
/// The pitch that these hold at, in metres, and the power of a coarser one by which more is hidden: 1.4 times as much at 7 mm, 2.8
/// times at 8 mm.
const PITCH_M: f64 = 0.0065;
const PITCH_POWER: i32 = 5;
/// So many standard deviations of their noise they may read too little, and a contact is none that reads less.
const NOISE_SIGMAS: f64 = 2.0;
/// Where the taxels beside one at the rim read so many times as much as the next ones together, a contact's tip lies between
/// them.
const TIP_RATIO: f64 = 5.0;
/// A taxel beside one amid the skin reads the flank of a contact whose tip lies there if those beyond it read less than this
/// share of its pressure in the mean, and the tip lies there if such flanks have so much of what is read about it. Those of
/// contacts of up to 10 mm radius have less, also with some load beside; a round mass of 600 mm2 has half.
const FLANK_FALLS_TO: f64 = 0.3;
const FLANKS_SHARE: f64 = 0.5;
/// Beside one taxel another is well touched if it reads more than this share of its pressure.
const WELL_TOUCHED_SHARE: f64 = 0.25;

/// By how much more is hidden on a coarser skin, whose flanks are further away.
fn by_pitch(pitch_m: f64) -> f64 {
    (pitch_m / PITCH_M).max(1.0).powi(PITCH_POWER)
}

impl Reading {
    /// The pressure that noise may have made less of, kPa.
    #[must_use]
    pub fn at_most_kpa(&self) -> f64 {
        self.kpa + NOISE_SIGMAS * self.noise_kpa
    }
}

impl Neighbours {
    /// How much the taxel `missing`, which cannot be read, may bear because a contact's tip lies there, kPa; 0 where its
    /// surroundings show none. Other contacts have no say in it. `reading` is `None` of a taxel that cannot be read.
    #[must_use]
    pub fn hidden_kpa(&self, missing: usize, reading: impl Fn(usize) -> Option<Reading>) -> f64 {
        let about_kpa = self.about_kpa(missing, &reading);
        let kpa = |taxel: u16| reading(usize::from(taxel)).map_or(0.0, |reading| reading.kpa - about_kpa);
        let beside = || self.of[missing].iter().copied();
        let noise_kpa2: f64 = beside().filter_map(|taxel| Some(reading(usize::from(taxel))?.noise_kpa.powi(2))).sum();
        if beside().map(kpa).sum::<f64>() <= NOISE_SIGMAS * noise_kpa2.sqrt() {
            return 0.0; // nothing presses there
        }
        let shows = if self.at_rim[missing] { self.tip_at_rim(missing, kpa) } else { self.tip_amid(missing, kpa) };
        if shows { self.at_most_kpa(missing, about_kpa, &reading) } else { 0.0 }
    }

    /// The same where nothing is touched, so that what those beside it read is noise, or too little of a tip to be told.
    #[must_use]
    pub fn untouched_kpa(&self, missing: usize, reading: impl Fn(usize) -> Option<Reading>) -> f64 {
        self.at_most_kpa(missing, self.about_kpa(missing, &reading), &reading)
    }

    /// No less than [`Neighbours::untouched_kpa`], without a look at the outer rings.
    #[must_use]
    pub fn untouched_at_most_kpa(&self, missing: usize, reading: impl Fn(usize) -> Option<Reading>) -> f64 {
        self.at_most_kpa(missing, 0.0, &reading)
    }

    /// What a taxel that cannot be read may bear without positions, kPa; it may lie at the rim. `of_module` is the most that another
    /// taxel of its module reads, [`Reading::at_most_kpa`], and `of_patch` of the patch, if nothing of that is touched. The taxels
    /// lie as far apart as `area_mm2` leaves them in a hexagonal lattice.
    #[must_use]
    pub fn untouched_anywhere_kpa(of_module: f64, of_patch: Option<f64>, area_mm2: f64) -> f64 {
        let pitch_m = 1e-3 * (area_mm2 * 2.0 / 3.0_f64.sqrt()).sqrt();
        let by_mean = of_patch.map_or(f64::INFINITY, |kpa| HIDDEN_OVER_MEAN * kpa);
        by_pitch(pitch_m) * AT_RIM * (HIDDEN_OVER_LEAST * of_module).min(by_mean).max(0.0)
    }

    /// What a wider load has on most of both outer rings, so that another contact on a part of one takes nothing off; 0 on a skin
    /// that is too small for a third ring, where a round contact of its size has as much on the second.
    fn about_kpa(&self, missing: usize, reading: impl Fn(usize) -> Option<Reading>) -> f64 {
        let at = |ring: &[u16], share: f64| {
            quantile(ring.iter().filter_map(|&taxel| Some(reading(usize::from(taxel))?.kpa)).collect(), share)
        };
        let (third, next) = (at(&self.third[missing], 0.5), at(&self.next[missing], 0.25));
        third.zip(next).map_or(0.0, |(third, next)| third.min(next).max(0.0))
    }

    /// What it bears at most by what its neighbours read, less `about_kpa`; 0 where none of them can be read.
    fn at_most_kpa(&self, missing: usize, about_kpa: f64, reading: impl Fn(usize) -> Option<Reading>) -> f64 {
        let (mut known, mut sum_kpa, mut noise_kpa2, mut least_kpa) = (0.0, 0.0, 0.0, f64::INFINITY);
        for Reading { kpa, noise_kpa } in self.of(missing).filter_map(reading) {
            known += 1.0;
            sum_kpa += kpa - about_kpa;
            noise_kpa2 += noise_kpa * noise_kpa;
            least_kpa = least_kpa.min(kpa - about_kpa + NOISE_SIGMAS * noise_kpa);
        }
        if known == 0.0 {
            return 0.0;
        }
        let mean_kpa = (sum_kpa + NOISE_SIGMAS * noise_kpa2.sqrt()) / known;
        let times = by_pitch(self.pitch_m) * if self.at_rim[missing] { AT_RIM } else { 1.0 };
        times * (HIDDEN_OVER_MEAN * mean_kpa).min(HIDDEN_OVER_LEAST * least_kpa).max(0.0)
    }

    /// Whether the taxels beside one amid the skin show the flanks of a contact whose tip lies there.
    fn tip_amid(&self, missing: usize, kpa: impl Fn(u16) -> f64) -> bool {
        let is_next = |other: &u16| usize::from(*other) != missing && !self.of[missing].contains(other);
        let is_flank = |beside: &u16| {
            let next = self.of[usize::from(*beside)].iter().copied().filter(is_next);
            let (count, sum) = next.fold((0.0, 0.0), |(n, sum), taxel| (n + 1.0, sum + kpa(taxel)));
            kpa(*beside) > 0.0 && (count == 0.0 || sum < FLANK_FALLS_TO * count * kpa(*beside))
        };
        let beside = || self.of[missing].iter().copied();
        let (all_kpa, flanks_kpa) = (beside().map(&kpa).sum::<f64>(), beside().filter(is_flank).map(&kpa).sum::<f64>());
        flanks_kpa > 0.0 && flanks_kpa >= FLANKS_SHARE * all_kpa
    }

    /// Whether nobody has seen the tip of a contact at the rim, or it lies beyond the one taxel that has most of it.
    fn tip_at_rim(&self, missing: usize, kpa: impl Fn(u16) -> f64) -> bool {
        let beside_kpa: f64 = self.of[missing].iter().copied().map(&kpa).sum();
        let next = || self.next[missing].iter().copied().map(&kpa);
        let (first, second) = greatest_two(self.of[missing].iter().copied().map(&kpa));
        let has_most = second <= WELL_TOUCHED_SHARE * first && first > next().fold(0.0, f64::max);
        beside_kpa > 0.0 && (has_most || beside_kpa >= TIP_RATIO * next().sum::<f64>())
    }
}

/// The two greatest of these pressures, 0 where there are none.
fn greatest_two(kpa: impl Iterator<Item = f64>) -> (f64, f64) {
    kpa.fold((0.0_f64, 0.0_f64), |(first, second), kpa| (first.max(kpa), second.max(kpa.min(first))))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{grid, hexagon, row};
    use super::*;

    /// What `missing` hides where the others read `kpa`, without noise.
    fn hidden(neighbours: &Neighbours, missing: usize, kpa: impl Fn(usize) -> f64) -> f64 {
        neighbours.hidden_kpa(missing, |taxel| (taxel != missing).then(|| Reading { kpa: kpa(taxel), noise_kpa: 0.0 }))
    }

    #[test]
    fn a_contact_that_touches_one_taxel_beside_one_without_a_pressure_may_lie_on_it() {
        let row = row(7);
        let one = |touched: usize| move |taxel: usize| if taxel == touched { 9.0 } else { 0.0 };
        assert_eq!(hidden(&row, 0, one(1)), AT_RIM * HIDDEN_OVER_MEAN * 9.0, "at the end, and nobody else beside it");
        assert_eq!(hidden(&row, 3, one(2)), 0.0, "amid the row the other neighbour would feel a tip there");
        assert_eq!(hidden(&row, 3, |taxel| [0.0, 0.0, 9.0, 0.0, 8.0, 0.0, 0.0][taxel]), HIDDEN_OVER_MEAN * 8.5);
        assert_eq!(hidden(&row, 0, |_| 0.0), 0.0);
    }

    /// Both neighbours of a corner that has no pressure read the same, so that their scatter says nothing of the tip there.
    #[test]
    fn a_contact_about_a_corner_without_a_pressure_may_lie_on_it() {
        let (neighbours, rings) = hexagon(2);
        let corner = (0..19).find(|&taxel| neighbours.of(taxel).count() == 3).unwrap();
        let amid = neighbours.of(corner).find(|&taxel| rings[taxel] == 1).unwrap();
        let about = |place: usize| {
            let neighbours = &neighbours;
            move |taxel: usize| if neighbours.of(place).any(|other| other == taxel) { 50.0 } else { 1.0 }
        };
        assert!(hidden(&neighbours, corner, about(corner)) > 1_000.0);
        let within = |taxel: usize| if taxel == amid { 100.0 } else { about(amid)(taxel) };
        assert_eq!(hidden(&neighbours, corner, within), 0.0, "its tip is seen");
    }

    /// Of a fingertip on it the six about it feel little and alike, and no scatter says what is missing.
    #[test]
    fn the_tip_of_a_small_contact_amid_the_skin_may_lie_on_a_taxel_without_a_pressure() {
        let (neighbours, rings) = hexagon(2);
        let centre = rings.iter().position(|ring| *ring == 0).unwrap();
        let one = rings.iter().position(|ring| *ring == 1).unwrap();
        let of = |kpa: &dyn Fn(usize) -> f64| hidden(&neighbours, centre, kpa);
        assert!((of(&|taxel| [0.0, 20.0, 0.5][rings[taxel]]) - HIDDEN_OVER_MEAN * 20.0).abs() < 1e-9);
        assert_eq!(of(&|taxel| [0.0, 50.0, 20.0][rings[taxel]]), 0.0, "a wide contact");
        let about_one = |taxel: usize| match neighbours.of(one).any(|other| other == taxel) {
            _ if taxel == one => 50.0,
            true => 40.0,
            false => 10.0,
        };
        assert_eq!(of(&about_one), 0.0, "the tip is on a taxel that feels it");
        let least = neighbours.of(centre).next().unwrap();
        let towards_others = |taxel: usize| if taxel == least { 0.5 } else { [0.0, 20.0, 0.5][rings[taxel]] };
        assert!((of(&towards_others) - HIDDEN_OVER_LEAST * 0.5).abs() < 1e-9, "it feels hardly any of it");
    }

    #[test]
    fn what_lies_elsewhere_has_no_say_in_what_a_taxel_without_a_pressure_may_bear() {
        let neighbours = grid(8, 0.0065);
        let at_corner = |at_corner: f64| {
            let kpa = |taxel: usize| {
                if [1, 8].contains(&taxel) {
                    at_corner
                } else if taxel >= 40 {
                    50.0
                } else {
                    0.0
                }
            };
            hidden(&neighbours, 0, kpa)
        };
        assert_eq!(at_corner(0.0), 0.0);
        assert_eq!(at_corner(50.0), AT_RIM * HIDDEN_OVER_MEAN * 50.0, "a contact whose tip nobody has seen");
    }

    /// What it spreads over the third ring lies beneath the tip, too.
    #[test]
    fn the_tip_of_a_small_contact_may_lie_there_under_a_wider_load_too() {
        let (neighbours, rings) = hexagon(4);
        let centre = rings.iter().position(|ring| *ring == 0).unwrap();
        let of = |about: [f64; 5]| hidden(&neighbours, centre, |taxel| about[rings[taxel]]);
        for wide_kpa in [0.0, 5.0, 15.0, 20.0] {
            let hidden = of([0.0, 20.0 + wide_kpa, 0.5 + wide_kpa, wide_kpa, wide_kpa]);
            assert!((hidden - HIDDEN_OVER_MEAN * 20.0).abs() < 1e-9, "under {wide_kpa} kPa: {hidden}");
        }
        assert_eq!(of([0.0, 50.0, 40.0, 20.0, 0.0]), 0.0, "a round one");
        assert_eq!(of([0.0, 20.0, 20.0, 20.0, 10.0]), 0.0, "a flat one");
        let least = neighbours.of(centre).next().unwrap();
        let towards_others =
            |taxel: usize| if taxel == least { 10.5 } else { [0.0, 30.0, 10.0, 10.0, 10.0][rings[taxel]] };
        let found = hidden(&neighbours, centre, towards_others);
        assert!((found - HIDDEN_OVER_LEAST * 0.5).abs() < 1e-9, "the least of them, under 10 kPa: {found}");
        // Another contact on a third of the ring.
        let third: Vec<usize> = (0..61).filter(|&taxel| rings[taxel] == 3).take(6).collect();
        let kpa = |taxel: usize| if third.contains(&taxel) { 60.0 } else { [0.0, 20.0, 0.5, 0.0, 0.0][rings[taxel]] };
        assert_eq!(hidden(&neighbours, centre, kpa), HIDDEN_OVER_MEAN * 20.0);
    }

    /// Two standard deviations of the mean of six, and of one, beside what they read.
    #[test]
    fn noise_may_hide_as_much_as_it_takes_from_those_beside() {
        let (neighbours, rings) = hexagon(4);
        let centre = rings.iter().position(|ring| *ring == 0).unwrap();
        let one = neighbours.of(centre).next().unwrap();
        let of = |beside: f64, least: f64, noise_kpa: f64| {
            let kpa = |taxel: usize| if taxel == one { least } else { [0.0, beside, 0.0, 0.0, 0.0][rings[taxel]] };
            neighbours.hidden_kpa(centre, |taxel| (taxel != centre).then(|| Reading { kpa: kpa(taxel), noise_kpa }))
        };
        let near = |is: f64, expected: f64| assert!((is - expected).abs() < 1e-9, "{is} kPa, expected {expected}");
        near(of(2.0, 2.0, 0.6), 25.0 * (2.0 + 2.0 * 0.6 / 6.0_f64.sqrt()));
        near(of(8.0, 0.0, 0.2), 125.0 * 2.0 * 0.2);
        near(of(2.0, 2.0, 2.4), 25.0 * (2.0 + 2.0 * 2.4 / 6.0_f64.sqrt()));
        near(of(2.0, 2.0, 2.5), 0.0); // 12 kPa in all, and two standard deviations are 12.2
    }

    #[test]
    fn of_a_coarser_skin_the_flanks_are_further_away() {
        let hidden_at = |pitch_m: f64| {
            let neighbours = grid(8, pitch_m);
            let beside: Vec<usize> = neighbours.of(27).collect();
            hidden(&neighbours, 27, |taxel| if beside.contains(&taxel) { 10.0 } else { 0.0 })
        };
        assert_eq!((hidden_at(0.003), hidden_at(0.0065)), (250.0, 250.0));
        let coarse = hidden_at(0.0075) / 250.0;
        assert!((2.0..2.1).contains(&coarse), "{coarse}");
    }

    #[test]
    fn without_positions_one_of_the_module_and_any_of_the_patch_may_be_beside_it() {
        let of = |of_module: f64, of_patch: Option<f64>, pitch_mm: f64| {
            Neighbours::untouched_anywhere_kpa(of_module, of_patch, 0.75_f64.sqrt() * pitch_mm * pitch_mm)
        };
        let near = |is: f64, expected: f64| assert!((is - expected).abs() < 1e-9, "{is} kPa, expected {expected}");
        near(of(1.0, Some(8.0), 6.5), AT_RIM * HIDDEN_OVER_LEAST);
        near(of(4.0, Some(8.0), 6.5), AT_RIM * HIDDEN_OVER_MEAN * 8.0);
        near(of(4.0, None, 6.5), AT_RIM * HIDDEN_OVER_LEAST * 4.0);
        near(of(4.0, None, 13.0), 32.0 * AT_RIM * HIDDEN_OVER_LEAST * 4.0);
        near(of(-1.0, None, 6.5), 0.0);
        near(Reading { kpa: 3.0, noise_kpa: 0.5 }.at_most_kpa(), 4.0);
    }

    /// A row at the rim of a hexagon: what those beside one read, and the next ones.
    #[test]
    fn at_the_rim_a_tip_is_where_those_beside_read_most_of_it_or_one_of_them_does() {
        let (neighbours, _) = hexagon(4);
        let corner = (0..61).find(|&taxel| neighbours.of(taxel).count() == 3).unwrap();
        let (beside, next): (Vec<usize>, Vec<u16>) = (neighbours.of(corner).collect(), neighbours.next[corner].clone());
        let of = |beside_kpa: [f64; 3], next_kpa: &dyn Fn(usize) -> f64| {
            hidden(&neighbours, corner, |taxel| match beside.iter().position(|&other| other == taxel) {
                Some(place) => beside_kpa[place],
                None => next.iter().position(|&other| usize::from(other) == taxel).map_or(0.0, next_kpa),
            }) > 0.0
        };
        // 60 kPa beside it, and 12 or less on the next ones together.
        assert!(of([20.0; 3], &|_| 11.9 / next.len() as f64) && !of([20.0; 3], &|_| 12.1 / next.len() as f64));
        // One has most of it, and none of the next ones more: the tip lies beyond it.
        let other = |kpa: f64| move |place: usize| if place == 0 { kpa } else { 6.0 };
        assert!(of([40.0, 10.0, 4.0], &other(39.0)) && !of([40.0, 10.0, 4.0], &other(41.0)));
        assert!(!of([40.0, 11.0, 4.0], &other(39.0)), "two of them are well touched");
    }

    #[test]
    fn flanks_fall_off_to_less_than_a_third_and_are_half_of_what_is_read_about_it() {
        let (neighbours, rings) = hexagon(4);
        let centre = rings.iter().position(|ring| *ring == 0).unwrap();
        let of = |about: [f64; 5]| hidden(&neighbours, centre, |taxel| about[rings[taxel]]) > 0.0;
        assert!(of([0.0, 20.0, 5.9, 0.0, 0.0]) && !of([0.0, 20.0, 6.1, 0.0, 0.0]));
        // What lies on both outer rings lies under the tip, too, and is taken off; on one of them it may be another contact's.
        assert!(of([0.0, 20.0, 10.0, 10.0, 0.0]) && !of([0.0, 20.0, 10.0, 0.0, 0.0]));
        assert!(of([0.0, 20.0, 0.0, 60.0, 0.0]), "another contact all about");
        let half: Vec<usize> = neighbours.of(centre).take(3).collect();
        let one_sided = |own: f64| {
            let beyond = |taxel: usize| neighbours.of(taxel).any(|other| half.contains(&other)) && rings[taxel] == 2;
            hidden(&neighbours, centre, |taxel| match rings[taxel] {
                1 if half.contains(&taxel) => 20.0,
                1 => own,
                2 if beyond(taxel) => 30.0,
                _ => 0.0,
            }) > 0.0
        };
        assert!(!one_sided(10.0), "the contact lies beyond three of them");
    }
}
