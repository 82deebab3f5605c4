//! A history that is lost is not taken for known: what the plays add to a force and how uncertain that is, when a set
//! comes into use or nobody knows the zero while something presses on the skin.

use std::sync::Arc;
use std::time::Duration;

use proptest::prelude::*;
use taxel_model::PlayState;
use taxel_skin::Time;

use crate::force::hysteresis::Hysteresis;
use crate::force::owner::{Force, ZeroState};
use crate::force::sample::ForceSample;
use crate::force::tests::{AREA, REST, model, plan, plays, rest, row, with_plays};
use crate::model_set::ModelSet;
use crate::scan::Scan;

const TAXELS: usize = 100;
const PERIOD: Duration = Duration::from_millis(20);
/// A count takes so many scans: the mean over the past lags behind by little more than one.
const SCANS_A_COUNT: usize = 10;
/// The offset has come to rest after so many.
const SETTLED_SCANS: usize = 100;

/// Models whose counts are averaged over half a second.
fn models() -> Arc<ModelSet> {
    with_plays(TAXELS, 0.5)
}

/// A skin on which the same pressure lies everywhere, and whose plays the test knows.
struct Skin {
    force: Force,
    truth: PlayState,
    pressed: u16,
    time: Time,
    sound: Vec<bool>,
    silent: Vec<bool>,
    soundness: u64,
}

impl Skin {
    /// At its zero, without models.
    fn bare() -> Self {
        let mut force = Force::new(plan(TAXELS, Some(row(TAXELS))));
        force.set_zero(Some(&rest(TAXELS)), 0.0);
        let (sound, silent) = (vec![true; TAXELS], vec![false; TAXELS / 10]);
        Self { force, truth: PlayState::default(), pressed: 0, time: Time::default(), sound, silent, soundness: 0 }
    }

    /// With the models in use since it was at rest.
    fn known() -> Self {
        let mut skin = Self::bare();
        skin.force.set_models(models(), 0.0);
        skin.force.set_zero(Some(&rest(TAXELS)), 0.0);
        skin
    }

    fn scan(&mut self, pressed: u16) -> ForceSample {
        self.pressed = pressed;
        self.time = self.time + PERIOD;
        plays().bend_kpa(&mut self.truth, f64::from(REST - pressed));
        self.at_present(|force, scan| {
            force.follow(scan);
            force.sample(scan, 0, &ZeroState::default()).sample
        })
    }

    fn at_present<T>(&mut self, on: impl FnOnce(&mut Force, &Scan<'_>) -> T) -> T {
        let counts = [REST - self.pressed; TAXELS];
        let (time, soundness) = (self.time, self.soundness);
        let (sound, silent) = (&self.sound, &self.silent);
        on(
            &mut self.force,
            &Scan { time, whole: true, counts: (&counts).into(), pads: &[], silent, sound, soundness, jumps: &[] },
        )
    }

    /// Slowly to so many counts, and stays there.
    fn go(&mut self, to: u16) -> &mut Self {
        while self.pressed != to {
            let next = if to > self.pressed { self.pressed + 1 } else { self.pressed - 1 };
            (0..SCANS_A_COUNT).for_each(|_| drop(self.scan(next)));
        }
        (0..SETTLED_SCANS).for_each(|_| drop(self.scan(to)));
        self
    }

    fn check_zero(&mut self) -> &mut Self {
        self.force.move_zero(None, None, 0.0);
        self
    }

    fn clear(&mut self) -> &mut Self {
        self.force.move_zero(Some(&rest(TAXELS)), Some(rest(TAXELS)), 0.0);
        self
    }

    /// What truly presses, N.
    fn truth_n(&self) -> f64 {
        let count = f64::from(REST - self.pressed);
        let kpa = model().evaluate(count).unwrap().kpa + plays().bend_kpa(&mut self.truth.clone(), count);
        TAXELS as f64 * AREA.0 * 1e-3 * kpa.max(0.0)
    }

    /// Error and standard uncertainty of a sample, N.
    fn error_n(&self, sample: &ForceSample) -> (f64, f64) {
        (sample.total.unwrap().0 - self.truth_n(), sample.total_sigma.unwrap().0)
    }

    fn holds(&self, sample: &ForceSample, what: &str) {
        let (error, sigma) = self.error_n(sample);
        assert!(error.abs() <= 3.0 * sigma, "{what}: {error} N off {} N, sigma {sigma} N", self.truth_n());
    }

    /// The force is that of a skin that was watched from the start, and so is its uncertainty.
    fn is_known(&mut self, what: &str) {
        let sample = self.scan(self.pressed);
        let (error, sigma) = self.error_n(&sample);
        assert!(error.abs() < 0.01 * self.truth_n(), "{what}: {error} N off {} N", self.truth_n());
        let mut watched = Self::known();
        let usual = watched.go(60).scan(60).total_sigma.unwrap().0 / watched.truth_n();
        let relative = sigma / self.truth_n();
        assert!(relative < 2.0 * usual, "{what}: {relative} is uncertain, usually {usual}");
    }
}

#[test]
fn a_set_that_comes_into_use_while_the_zero_is_in_check_has_a_history_from_then_on() {
    let mut skin = Skin::bare();
    skin.go(50).check_zero().force.set_models(models(), 0.0);
    skin.clear();
    let first = skin.scan(50);
    skin.holds(&first, "of the past nothing is known");
    let relaxed = skin.go(20).scan(20);
    skin.holds(&relaxed, "relaxed");
    skin.is_known("it has turned by more than the greatest play since");
}

#[test]
fn a_set_that_comes_into_use_under_a_load_does_not_know_how_it_came_there() {
    for (most, present) in [(60, 20), (20, 20), (40, 40), (30, 8)] {
        let what = format!("{most} counts, then {present}");
        let mut skin = Skin::bare();
        skin.go(most).go(present).force.set_models(models(), 0.0);
        let at_once = skin.at_present(|force, scan| force.sample(scan, 0, &ZeroState::default()).sample);
        skin.holds(&at_once, &format!("{what}, before a scan"));
        let next = skin.scan(present);
        skin.holds(&next, &what);
        for on in (0..=25).map(|more| present + more) {
            let sample = skin.go(on).scan(on);
            skin.holds(&sample, &format!("{what}, then {on}"));
        }
        skin.is_known(&what);
    }
}

#[test]
fn a_set_that_comes_into_use_at_rest_knows_that_nothing_presses() {
    let mut skin = Skin::bare();
    skin.go(0).force.set_models(models(), 0.0);
    skin.go(1).go(0);
    let little = skin.go(5).scan(5).total_sigma.unwrap().0;
    let usual = Skin::known().go(5).scan(5).total_sigma.unwrap().0;
    assert!((little - usual).abs() < 1e-6 * usual, "{little} N, usually {usual} N");
    skin.go(40).is_known("loaded since");
}

/// Noise drags plays ahead of a load that lies there.
#[test]
fn a_load_that_was_put_on_reads_the_curve() {
    let mut skin = Skin::known();
    skin.go(40);
    (0..50).for_each(|scan| drop(skin.scan(40 + 2 * (scan % 2))));
    let (total, kpa) = (skin.scan(40).total.unwrap().0, model().evaluate(f64::from(REST - 40)).unwrap().kpa);
    assert!((total / (TAXELS as f64 * AREA.0 * 1e-3 * kpa) - 1.0).abs() < 1e-3, "{total} N of {kpa} kPa");
}

#[test]
fn a_load_that_lands_or_goes_at_once_is_in_the_interval() {
    for (from, to) in [(0, 40), (60, 20), (20, 60)] {
        let mut skin = Skin::known();
        skin.go(from);
        for scan in 0..SETTLED_SCANS {
            let sample = skin.scan(to);
            skin.holds(&sample, &format!("from {from} to {to} counts, scan {scan}"));
        }
        skin.is_known("it has settled");
    }
}

#[test]
fn what_happens_to_a_taxel_while_it_is_not_heard_is_not_known() {
    let mut skin = Skin::known();
    skin.go(20);
    let heard = |skin: &mut Skin, heard: bool| {
        skin.sound[10..].fill(heard);
        skin.soundness += 1;
    };
    heard(&mut skin, false);
    skin.go(60).go(20);
    heard(&mut skin, true);
    let sample = skin.scan(20);
    skin.holds(&sample, "squeezed and relaxed unheard");
    skin.go(45).is_known("loaded since");
}

proptest! {
    /// Whatever lay on the skin before and whatever comes: what it adds lies within what is said of it, but for what is
    /// neglected when two histories are taken for one.
    #[test]
    fn the_offset_of_an_unknown_history_is_as_far_off_as_it_says(
        past in proptest::collection::vec(170..=REST, 0..20), path in proptest::collection::vec(170..=REST, 1..40)
    ) {
        let (mut truth, plays, neglected_kpa) = (PlayState::default(), plays(), 0.1 * (0.8 * 4.0 + 0.4 * 10.0));
        for count in past {
            plays.bend_kpa(&mut truth, f64::from(count));
        }
        let mut hysteresis = Hysteresis::unknown(&with_plays(TAXELS, 0.0), &rest(TAXELS)).unwrap();
        let mut time = Time::default();
        for count in path {
            time = time + PERIOD;
            hysteresis.follow(time, &[count; TAXELS], |_| true);
            let (offsets, adds_kpa) = (hysteresis.offsets(), plays.bend_kpa(&mut truth, f64::from(count)));
            let off_kpa = (f64::from(offsets.kpa(0)) - adds_kpa).abs();
            let says_kpa = 3.0_f64.sqrt() * offsets.sigma_kpa(0);
            prop_assert!(off_kpa <= says_kpa + neglected_kpa + 1e-4, "{off_kpa} kPa off, {says_kpa} kPa said");
        }
    }
}
