//! Group 4: the fit of a whole skin, over stiff, long, scaled and broken recordings.

use crate::skin::{Gathered, SkinError, SkinFit, fit};
use crate::stability::case::{Case, Outcome, greatest};
use crate::stability::taxels::{NOMINAL, Taxel, random};
use crate::{FitOptions, OneByOne, TaxelModel};

const TAXELS: usize = 6;
const SCANS_PER_S: f64 = 20.0;
/// Seconds without pressure before each rise.
const REST_S: f64 = 5.0;
const TOP_KPA: f64 = 70.0;
/// Seconds of a rise.
const RISE_S: f64 = 60.0;

/// A recorded skin.
#[derive(Clone)]
struct Recorded {
    time_s: Vec<f64>,
    kpa: Vec<f64>,
    counts: Vec<Vec<f64>>,
}

pub(super) fn cases() -> Vec<Case> {
    let reading = |number: &str, name: &str, limit, run: fn() -> Outcome| {
        Case::of(number, name, "max |P - true P| from 5 to 65 kPa", limit, run)
    };
    let same = |number: &str, name: &str, limit, run: fn() -> Outcome| {
        Case::of(number, name, "max |P - P of the plain recording|, kPa", limit, run)
    };
    vec![
        reading("4.1", "six taxels of an 8-bit skin, one rise", 0.5, || read(&skin())),
        reading("4.2", "a million scans of one rise", 0.05, || read(&Recorded::of(&Taxel::of_skin(), &rise(1e6)))),
        reading("4.3", "an hour at the highest pressure", 0.5, hour),
        reading("4.4", "stiff: all but a tenth of the swing below 5 kPa", 2.5, stiff),
        reading("4.5", "a skin never pressed: its first rise has a dead zone of 6 kPa", 0.5, never_pressed),
        reading("4.6", "a fifth of each taxel's counts are missing", 0.5, gaps),
        reading("4.7", "six held pressures of twenty scans", 1.5, held),
        Case { also: "it is excluded as dead", ..reading("4.8", "one taxel of six never moves", 0.5, one_never_moves) },
        Case {
            also: "it is excluded as a poor fit",
            ..reading("4.9", "one taxel of six is noise alone", 0.5, one_is_noise)
        },
        Case { also: "the zero is known, and no plays", ..reading("4.10", "a fall alone", 0.5, fall_alone) },
        reading("4.11", "pressures in no order", 0.5, no_order),
        Case {
            also: "it is excluded as a poor fit",
            ..reading("4.12", "one taxel of six falls and rises again", 0.5, || {
                one_is("poor_fit", |share| 200.0 - 60.0 * (std::f64::consts::PI * share).sin())
            })
        },
        Case {
            also: "it is excluded as a poor fit",
            ..reading("4.13", "one taxel of six jumps: its highest pressure lies between two lower ones", 0.5, || {
                one_is("poor_fit", |share| match share {
                    s if s < 0.3 => 200.0 + 10.0 * s,
                    s if s < 0.65 => 235.0 + 10.0 * s,
                    s => 215.0 + 10.0 * s,
                })
            })
        },
        Case::of("4.14", "noise alone on all taxels", "taxels that may be used", 0.0, noise_alone),
        Case::of("4.15", "a swing of three counts", "range over the narrowest 95 % interval", 5.0, three_counts),
        Case {
            also: "there the 95 % interval holds 42 and 68 kPa",
            ..Case::of(
                "4.16",
                "taxels at the end of the converter from 40 kPa on",
                "max |P - true P| from 5 to 35 kPa",
                1.0,
                railed,
            )
        },
        same("4.17", "counts of 1e-9", 1e-9, || scaled(|count| count * 1e-9)),
        same("4.18", "counts of 1e9", 1e-9, || scaled(|count| count * 1e9)),
        same("4.19", "counts that begin at 1e9", 1e-6, || scaled(|count| count + 1e9)),
        same("4.20", "the same again, taxels in another order", 0.0, mirrored),
        refused("4.21", "two pressures", || two_levels(0.0, TOP_KPA), SkinError::TooFewPressures { distinct: 2 }),
        refused("4.22", "all pressures equal", || two_levels(3.0, 3.0), SkinError::TooFewPressures { distinct: 1 }),
        refused("4.23", "no count ever moves", nothing_moves, {
            SkinError::NothingMoves { from_kpa: 0.0, to_kpa: TOP_KPA }
        }),
    ]
}

/// A recording that must not be fitted, for this reason.
fn refused(number: &str, name: &str, of: fn() -> Recorded, reason: SkinError) -> Case {
    Case::of(number, name, "recordings fitted that must be refused", 0.0, move || {
        let found = of().fit();
        let mut outcome = Outcome::of_figure(f64::from(u8::from(found.is_ok())));
        let found = found.err();
        outcome.require(found == Some(reason), || format!("{found:?}"));
        outcome
    })
}

impl Taxel {
    /// The taxels of a skin, no two alike.
    fn of_skin() -> [Self; TAXELS] {
        std::array::from_fn(|k| Self {
            gain: 90.0 + 8.0 * k as f64,
            half: 35.0 + 2.0 * k as f64,
            rest: 240.0 - k as f64,
            ..NOMINAL
        })
    }

    /// The count at a pressure, without noise.
    fn at(&self, kpa: f64) -> f64 {
        self.rest - self.gain * kpa / (kpa + self.half)
    }
}

impl Recorded {
    fn of(taxels: &[Taxel], kpa: &[f64]) -> Self {
        let read = |(k, taxel): (usize, &Taxel)| {
            let mut random = random(400 + k as u64);
            kpa.iter().map(|kpa| taxel.read(*kpa, &mut random)).collect()
        };
        let counts = taxels.iter().enumerate().map(read).collect();
        Self { time_s: (0..kpa.len()).map(|scan| scan as f64 / SCANS_PER_S).collect(), kpa: kpa.to_vec(), counts }
    }

    fn fit(&self) -> Result<SkinFit, SkinError> {
        let counts: Vec<&[f64]> = self.counts.iter().map(Vec::as_slice).collect();
        let gathered = Gathered { time_s: &self.time_s, pressure_kpa: &self.kpa, counts: &counts, zeros: None };
        fit(&gathered, true, &OneByOne)
    }

    fn model(&self, skin: &SkinFit, taxel: usize) -> TaxelModel {
        skin.model(taxel, &self.counts[taxel], &FitOptions::default())
    }

    /// What the fitted taxel reads at `count`, kPa; NaN without a usable model.
    fn reads(&self, skin: &SkinFit, taxel: usize, count: f64) -> f64 {
        let model = self.model(skin, taxel);
        let sound = model.is_usable() && model.validate().is_ok();
        model.evaluate(count).filter(|_| sound).map_or(f64::NAN, |reading| reading.kpa)
    }
}

/// Pressures of a rest and a rise in so many scans.
fn rise(scans: f64) -> Vec<f64> {
    let rest = scans * REST_S / (REST_S + RISE_S);
    (0..scans as usize).map(|scan| (TOP_KPA * (scan as f64 - rest) / (scans - rest)).max(0.0)).collect()
}

fn plain_rise() -> Vec<f64> {
    rise(SCANS_PER_S * (REST_S + RISE_S))
}

fn skin() -> Recorded {
    Recorded::of(&Taxel::of_skin(), &plain_rise())
}

fn pressures() -> impl Iterator<Item = f64> {
    (1..=13).map(|k| 5.0 * f64::from(k))
}

/// The error of the skin's readings of noiseless counts.
fn read(recorded: &Recorded) -> Outcome {
    read_as(recorded, &Taxel::of_skin())
}

fn read_as(recorded: &Recorded, taxels: &[Taxel]) -> Outcome {
    let skin = match recorded.fit() {
        Ok(skin) => skin,
        Err(error) => return Outcome { broken: vec![error.to_string()], ..Outcome::of_figure(f64::NAN) },
    };
    let of = |(k, taxel): (usize, &Taxel)| {
        greatest(pressures().map(|kpa| (recorded.reads(&skin, k, taxel.at(kpa)) - kpa).abs()))
    };
    Outcome::of_figure(greatest(taxels.iter().enumerate().map(of)))
}

fn hour() -> Outcome {
    let held = std::iter::repeat_n(TOP_KPA, (3600.0 * SCANS_PER_S) as usize);
    read(&Recorded::of(&Taxel::of_skin(), &plain_rise().into_iter().chain(held).collect::<Vec<f64>>()))
}

fn stiff() -> Outcome {
    let taxels = [Taxel { half: 0.5, gain: 5000.0, rest: 60_000.0, noise: 0.7, bits: 16 }; TAXELS];
    read_as(&Recorded::of(&taxels, &plain_rise()), &taxels)
}

fn never_pressed() -> Outcome {
    let (once, fall) = (plain_rise(), fall());
    let mut recorded = Recorded::of(&Taxel::of_skin(), &[&once[..], &fall, &once].concat());
    let first = Recorded::of(&Taxel::of_skin(), &once.iter().map(|kpa| (kpa - 6.0).max(0.0)).collect::<Vec<f64>>());
    for (counts, first) in recorded.counts.iter_mut().zip(&first.counts) {
        counts[..first.len()].copy_from_slice(first);
    }
    read(&recorded)
}

fn gaps() -> Outcome {
    let mut recorded = skin();
    for (k, counts) in recorded.counts.iter_mut().enumerate() {
        counts.iter_mut().skip(k).step_by(5).for_each(|count| *count = f64::NAN);
    }
    read(&recorded)
}

fn held() -> Outcome {
    let levels = (0..6).flat_map(|level| std::iter::repeat_n(TOP_KPA / 5.0 * f64::from(level), 20));
    read(&Recorded::of(&Taxel::of_skin(), &levels.collect::<Vec<f64>>()))
}

/// Pressures of a rise, backwards.
fn fall() -> Vec<f64> {
    plain_rise().into_iter().rev().collect()
}

fn fall_alone() -> Outcome {
    let recorded = Recorded::of(&Taxel::of_skin(), &fall());
    let mut outcome = read(&recorded);
    let found = recorded.fit().map(|skin| (skin.zero_known, (0..TAXELS).any(|taxel| skin.plays(taxel).is_some())));
    outcome.require(found == Ok((true, false)), || format!("{found:?}"));
    outcome
}

fn no_order() -> Outcome {
    let rise = plain_rise();
    // 457 has no divisor in common with the number of scans.
    read(&Recorded::of(
        &Taxel::of_skin(),
        &(0..rise.len()).map(|scan| rise[scan * 457 % rise.len()]).collect::<Vec<f64>>(),
    ))
}

fn one_is_noise() -> Outcome {
    let mut recorded = skin();
    let noise = |(scan, count): (usize, &mut f64)| *count = 200.0 + (scan * 104_729 % 53) as f64;
    recorded.counts[TAXELS - 1].iter_mut().enumerate().for_each(noise);
    all_but_the_last(&recorded, "poor_fit")
}

fn one_never_moves() -> Outcome {
    one_is("dead", |_| 200.0)
}

/// The last taxel has this count at a share of the highest pressure, and must have this status.
fn one_is(status: &str, law: impl Fn(f64) -> f64) -> Outcome {
    let mut recorded = skin();
    recorded.counts[TAXELS - 1] = recorded.kpa.iter().map(|kpa| law(kpa / TOP_KPA).round()).collect();
    all_but_the_last(&recorded, status)
}

fn noise_alone() -> Outcome {
    let taxels = Taxel::of_skin().map(|taxel| Taxel { gain: 0.0, noise: 3.0, ..taxel });
    let recorded = Recorded::of(&taxels, &plain_rise());
    let usable = |skin: SkinFit| (0..TAXELS).filter(|taxel| recorded.model(&skin, *taxel).is_usable()).count();
    Outcome::of_figure(recorded.fit().map_or(0, usable) as f64)
}

fn three_counts() -> Outcome {
    let taxels = Taxel::of_skin().map(|taxel| Taxel { gain: 4.5, ..taxel });
    let recorded = Recorded::of(&taxels, &plain_rise());
    let shares = |skin: SkinFit| {
        let share = |taxel| recorded.model(&skin, taxel).quality.interval_share.unwrap_or(f64::INFINITY);
        (0..TAXELS).map(share).fold(f64::INFINITY, f64::min)
    };
    Outcome::of_figure(recorded.fit().map_or(0.0, |skin| 1.0 / shares(skin)))
}

/// At the end of the converter a count says no more than that it is 40 kPa and more.
fn railed() -> Outcome {
    let taxels = Taxel::of_skin().map(|taxel| Taxel { gain: 2.0 * taxel.rest, half: 40.0, ..taxel });
    let recorded = Recorded::of(&taxels, &plain_rise());
    let Ok(skin) = recorded.fit() else { return Outcome::of_figure(f64::NAN) };
    let of = |(k, taxel): (usize, &Taxel)| {
        greatest(pressures().take(7).map(|kpa| (recorded.reads(&skin, k, taxel.at(kpa)) - kpa).abs()))
    };
    let mut outcome = Outcome::of_figure(greatest(taxels.iter().enumerate().map(of)));
    let at_end = (0..TAXELS).filter_map(|taxel| recorded.model(&skin, taxel).evaluate(0.0));
    let holds = |kpa: f64| at_end.clone().all(|reading| (reading.kpa - kpa).abs() <= 2.0 * reading.sigma_kpa);
    outcome.require(holds(42.0) && holds(68.0), || "the interval at the converter's end holds no more".to_owned());
    outcome
}

/// The error of all taxels but the last, which must have this status.
fn all_but_the_last(recorded: &Recorded, status: &str) -> Outcome {
    let mut outcome = read_as(recorded, &Taxel::of_skin()[..TAXELS - 1]);
    let found = recorded.fit().ok().map(|skin| recorded.model(&skin, TAXELS - 1).status);
    outcome.require(found.is_some_and(|found| found.code() == status), || format!("{found:?}"));
    outcome
}

/// What a skin reads whose counts are written in other units, beside the plain one.
fn scaled(change: fn(f64) -> f64) -> Outcome {
    let plain = skin();
    let mut other = plain.clone();
    other.counts.iter_mut().flatten().for_each(|count| *count = change(*count));
    let (Ok(one), Ok(two)) = (plain.fit(), other.fit()) else { return Outcome::of_figure(f64::NAN) };
    let apart = |(taxel, count): (usize, f64)| {
        (plain.reads(&one, taxel, count) - other.reads(&two, taxel, change(count))).abs()
    };
    let counts = Taxel::of_skin().into_iter().enumerate();
    Outcome::of_figure(greatest(
        counts.flat_map(|(k, taxel)| pressures().map(move |kpa| (k, taxel.at(kpa)))).map(apart),
    ))
}

fn mirrored() -> Outcome {
    let plain = skin();
    let mut other = plain.clone();
    other.counts.reverse();
    let (Ok(one), Ok(two)) = (plain.fit(), other.fit()) else { return Outcome::of_figure(f64::NAN) };
    let apart = |(taxel, count): (usize, f64)| {
        (plain.reads(&one, taxel, count) - other.reads(&two, TAXELS - 1 - taxel, count)).abs()
    };
    Outcome::of_figure(greatest(
        (0..TAXELS).flat_map(|k| pressures().map(move |kpa| (k, Taxel::of_skin()[k].at(kpa)))).map(apart),
    ))
}

fn two_levels(low_kpa: f64, high_kpa: f64) -> Recorded {
    Recorded::of(&Taxel::of_skin(), &[[low_kpa; 200], [high_kpa; 200]].concat())
}

fn nothing_moves() -> Recorded {
    let mut recorded = skin();
    recorded.counts.iter_mut().flatten().for_each(|count| *count = 200.0);
    recorded.kpa.push(TOP_KPA);
    recorded.time_s.push(REST_S + RISE_S);
    recorded.counts.iter_mut().for_each(|counts| counts.push(200.0));
    recorded
}
