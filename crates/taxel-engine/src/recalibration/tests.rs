//! What a recalibration promises, tried on loads that are drawn at random: the seed of each trial is printed.

use crate::recalibration::estimate::{POINTS_MIN, Recalibration};
use crate::recalibration::points::{Assumptions, LoadPoint};

/// What these points say, each of which lies at a place of its own.
fn of(points: &[LoadPoint], assumptions: Assumptions) -> Result<Recalibration, String> {
    let places: Vec<usize> = (0..points.len()).collect();
    Recalibration::of(points, &places, assumptions)
}

const TRIALS: u64 = 4_000;

/// SplitMix64 (Steele et al. 2014) and the normal deviates of Box and Muller.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A skin whose gain is off and which scatters from place to place.
struct Skin {
    gain: f64,
    assumptions: Assumptions,
}

impl Skin {
    fn new(random: &mut Random, place_rel: f64) -> Self {
        let assumptions = Assumptions { place_rel, floor: 0.0 };
        Self { gain: random.between(0.7, 1.4), assumptions }
    }

    /// What it reads under a load at another place, and the load's own uncertainty of 0.5 %.
    fn read(&self, random: &mut Random, number: u64, load: f64) -> LoadPoint {
        let Assumptions { place_rel, floor, .. } = self.assumptions;
        let known = load * (1.0 + 0.005 * random.normal());
        // known = gain read + scatter, the scatter being that of the reading at this place.
        let ideal = load / self.gain;
        let read = ideal * (1.0 + place_rel * random.normal()) + floor / self.gain * random.normal();
        LoadPoint { number, read, read_sigma: 0.0, known, known_sigma: 0.005 * load }
    }

    fn points(&self, random: &mut Random, count: usize, loads: (f64, f64)) -> Vec<LoadPoint> {
        (1..=count as u64)
            .map(|number| {
                let load = random.between(loads.0, loads.1);
                self.read(random, number, load)
            })
            .collect()
    }
}

/// Share of the trials in which `holds`, in percent; each trial has a seed of its own.
fn percent(what: &str, mut holds: impl FnMut(&mut Random) -> bool) -> f64 {
    let held = (0..TRIALS).filter(|seed| holds(&mut Random(0xA11CE ^ (seed << 20)))).count();
    let percent = 100.0 * held as f64 / TRIALS as f64;
    eprintln!("{what}: {percent:.2} % of {TRIALS} trials, seeds 0xA11CE ^ (n << 20), n = 0 to {}", TRIALS - 1);
    percent
}

#[test]
fn a_wrong_load_among_five_is_refused_and_named_in_99_percent_of_trials() {
    // The scatter of a point beforehand is that of its place with the 0.5 % of the load. In each case the wrongness is at
    // least seven times that: a mass that is a tenth off on a skin that scatters by 1.25 %, a quarter or a third off at 3
    // and 4.5 %, a mass that was forgotten (half of what was noted lay there) or counted twice at 7 %.
    let cases =
        [(0.0125, 1.1), (0.0125, 0.9), (0.03, 1.25), (0.03, 0.75), (0.045, 1.0 / 1.5), (0.07, 2.0), (0.07, 0.5)];
    for (place_rel, factor) in cases {
        let found = percent(&format!("scatter {place_rel}, noted {factor} times as heavy"), |random| {
            let skin = Skin::new(random, place_rel);
            let mut points = skin.points(random, POINTS_MIN, (2.0, 20.0));
            let wrong = (random.uniform() * POINTS_MIN as f64) as usize;
            points[wrong].known *= factor;
            points[wrong].known_sigma *= factor;
            let found = of(&points, skin.assumptions).unwrap();
            !found.is_sound() && found.contradicts == Some(points[wrong].number)
        });
        assert!(found >= 99.0, "scatter {place_rel}, factor {factor}: {found} %");
    }
}

#[test]
fn sound_loads_are_refused_in_one_percent_of_trials_as_stated() {
    for count in [5, 8, 20] {
        let refused = percent(&format!("{count} sound loads refused"), |random| {
            let skin = Skin::new(random, 0.03);
            let points = skin.points(random, count, (2.0, 20.0));
            !of(&points, skin.assumptions).unwrap().is_sound()
        });
        assert!((0.4..=1.6).contains(&refused), "{count} loads: {refused} %");
    }
}

#[test]
fn the_predicted_interval_of_a_new_place_holds_its_load_in_95_percent_of_trials() {
    for (count, place_rel) in [(5, 0.02), (5, 0.05), (10, 0.03)] {
        let (mut sound, mut held) = (0_u64, 0_u64);
        percent(&format!("{count} loads, scatter {place_rel}, accepted"), |random| {
            let skin = Skin::new(random, place_rel);
            let points = skin.points(random, count, (2.0, 20.0));
            let found = of(&points, skin.assumptions).unwrap();
            if found.is_sound() {
                let truth = random.between(2.0, 20.0);
                let read = skin.read(random, 99, truth).read;
                sound += 1;
                let corrected = found.line.gain * read;
                held += u64::from((corrected - truth).abs() <= 1.96 * found.relative_sigma() * corrected);
            }
            found.is_sound()
        });
        let coverage = 100.0 * held as f64 / sound as f64;
        eprintln!("{count} loads, scatter {place_rel}: {coverage:.2} % of {sound} new places within 1.96 sigma");
        assert!((93.0..=97.0).contains(&coverage), "{coverage} %");
    }
}

#[test]
fn what_all_loads_may_be_off_by_together_stays_however_many_there_are() {
    // One balance or force sensor that is known to 5 %.
    for count in [5, 100] {
        let (mut sound, mut held) = (0_u64, 0_u64);
        percent(&format!("{count} loads of one balance, accepted"), |random| {
            let skin = Skin::new(random, 0.02);
            let balance = 1.0 + 0.05 * random.normal();
            let mut points = skin.points(random, count, (2.0, 20.0));
            points.iter_mut().for_each(|p| (p.known, p.known_sigma) = (p.known * balance, 0.05 * p.known * balance));
            let found = of(&points, skin.assumptions).unwrap();
            if found.is_sound() {
                sound += 1;
                held += u64::from((found.line.gain - skin.gain).abs() <= 1.96 * found.gain_sigma());
            }
            found.is_sound()
        });
        let coverage = 100.0 * held as f64 / sound as f64;
        eprintln!("{count} loads of one balance: {coverage:.2} % of {sound} gains within 1.96 sigma");
        assert!(coverage >= 93.0, "{coverage} %");
    }
}

fn exact(gain: f64) -> Vec<LoadPoint> {
    let point = |(number, known): (u64, f64)| LoadPoint { number, read: known / gain, known, ..LoadPoint::default() };
    [(1, 2.0), (2, 3.0), (3, 5.0), (4, 7.0), (5, 9.0)].map(point).to_vec()
}

#[test]
fn what_no_skin_does_is_refused_in_words() {
    for (gain, is_sound) in [(0.49, false), (0.51, true), (1.99, true), (2.01, false), (1000.0, false)] {
        let found = of(&exact(gain), Assumptions::MASSES).unwrap();
        assert_eq!(found.is_sound(), is_sound, "{gain}: {found:?}");
        assert!(is_sound || found.refused_because[0].contains("no skin ages"), "{found:?}");
    }
    let with = |change: fn(&mut Vec<LoadPoint>)| {
        let mut points = exact(1.1);
        change(&mut points);
        of(&points, Assumptions::MASSES).unwrap_err()
    };
    for (says, refused) in [
        ("4 known loads so far; at least 5", with(|points| points.truncate(4))),
        ("what was read is 0", with(|points| points[1].read = 0.0)),
        ("known load is NaN", with(|points| points[2].known = f64::NAN)),
        ("uncertainty of the known load is -1", with(|points| points[2].known_sigma = -1.0)),
    ] {
        assert!(refused.contains(says), "{refused}");
    }
    let vague = Assumptions { place_rel: 0.3, ..Assumptions::MASSES };
    assert!(of(&exact(1.1), vague).unwrap_err().contains("scatter"));
}

#[test]
fn a_point_that_decides_alone_is_refused_because_nothing_can_contradict_it() {
    let mut points = exact(1.0);
    points.iter_mut().for_each(|point| (point.read, point.known) = (0.2, 0.2));
    (points[4].read, points[4].known) = (50.0, 50.0);
    let found = of(&points, Assumptions::MASSES).unwrap();
    assert!(!found.is_sound() && found.refused_because[0].contains("point 5 decides"), "{found:?}");
}
