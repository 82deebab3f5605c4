//! Hysteresis, live: follows each taxel's plays, and tells by how much its history takes from the curve.
//!
//! A play takes noise for motion, so it follows a smoothed count. A recording is smoothed to both sides; live there are
//! no scans to come, and the mean runs over the past only: exponential, with the same mean age that half the window of
//! the recording has. The curve itself is read at the newest count, so that a touch is seen at once.
//!
//! An offset may be off in two ways, both given as [`Offsets::sigma_kpa`]:
//! - **A history that is not known**, of a set that comes into use or of a taxel that was not heard for a while: whatever
//!   lies on the skin may have risen to it or fallen to it. Two runs of the plays enclose all that may have been
//!   (`hysteresis/bracket.rs`); the middle of both is served until they meet.
//! - **A count that has run ahead of its mean.** A load that lands within a scan leaves the offset behind for about three time
//!   constants of the mean, by up to the width of the loop. How much it will move yet is worked out for those taxels
//!   alone. A mean that is behind by less than `AHEAD_SIGMAS` of the noise counts as caught up: it may be off by so many
//!   counts times the sum of the weights, and nothing tells this from noise.

mod bracket;

use std::sync::Arc;
use taxel_model::{PlayState, Plays};
use taxel_skin::Time;

use crate::baseline::{NOISE_FLOOR_COUNTS, TaxelBaseline};
use crate::counts::Counts;
use crate::force::offsets::Offsets;
use crate::model_set::ModelSet;
use crate::statistics::exponential_share;

/// A count that is farther from its mean, in multiples of the noise, has moved: by chance it is once in 16,000 scans.
const AHEAD_SIGMAS: f64 = 4.0;
/// Two histories whose offsets differ by less than twice this share of half the loop's width are taken for one, and up to
/// a tenth of that half is neglected: a skin that creeps back to its rest for minutes would keep them apart for as long.
const SAME_SHARE: f64 = 0.05;
/// So long a taxel may go unheard with its history still known, seconds, or for the time constant of the mean if that is
/// longer: what comes and goes within that hardly moves a mean that sees it.
const UNHEARD_S: f64 = 0.2;

/// The plays of a patch at its present zero.
#[derive(Clone, Debug)]
pub struct Hysteresis {
    set: Arc<ModelSet>,
    /// One per taxel; `None` where hysteresis is not compensated.
    followers: Vec<Option<Follower>>,
    /// Time constant of the mean, seconds; 0 is none.
    tau_s: f64,
    /// The taxels whose history is not known, ascending; nearly always none.
    unknown: Vec<Unknown>,
    /// Taxels whose offset may be off, and by how much, kPa. One that is in here twice is off by the greater.
    unsure: Vec<(usize, f32)>,
}

/// One taxel's history.
#[derive(Clone, Debug)]
struct Follower {
    /// What is added to a raw count to get the count that the models refer to.
    shift: f64,
    /// Smoothed raw count.
    mean: f64,
    last: Option<Time>,
    plays: PlayState,
    offset_kpa: f32,
    /// Standard deviation of a count at rest.
    noise_counts: f32,
}

/// A taxel whose history is not known. Its follower has the plays of the history that adds the most.
#[derive(Clone, Debug)]
struct Unknown {
    taxel: usize,
    /// The plays of the history that adds the least; `None` until a count is seen.
    least: Option<PlayState>,
    /// How far any history lies from the offset, kPa.
    off_kpa: f32,
}

impl Hysteresis {
    /// Plays that start at rest, at the zero `rest` (one per taxel); `None` if `set` compensates nothing.
    pub fn new(set: &Arc<ModelSet>, rest: &[TaxelBaseline]) -> Option<Self> {
        let recorded = set.recorded.as_ref()?;
        let begin = |taxel: usize| {
            let (plays, zero, then) = (set.plays(taxel)?, rest.get(taxel)?, set.baseline.get(taxel)?.mean);
            let usable = set.taxels[taxel].is_usable() && zero.mean.is_finite() && then.is_finite();
            let (shift, mut state) = (then - zero.mean, PlayState::default());
            let offset_kpa = plays.bend_kpa(&mut state, zero.mean + shift) as f32;
            usable.then_some(Follower {
                shift,
                mean: zero.mean,
                last: None,
                plays: state,
                offset_kpa,
                noise_counts: zero.noise.max(NOISE_FLOOR_COUNTS) as f32,
            })
        };
        let followers: Vec<Option<Follower>> = (0..set.taxels.len()).map(begin).collect();
        // The mean age of a centred window's later half, or of a window over the past.
        let tau_s = 0.5 * recorded.smooth_s.max(recorded.plays_mean_s).max(0.0);
        let (unknown, unsure) = (Vec::new(), Vec::new());
        let any = followers.iter().any(Option::is_some);
        any.then(|| Self { set: Arc::clone(set), followers, tau_s, unknown, unsure })
    }

    /// Plays of which nobody knows where they stand: a load may lie on the skin. Until a count is seen the middle of the loop is
    /// served, half a loop's width from all that may be.
    pub fn unknown(set: &Arc<ModelSet>, rest: &[TaxelBaseline]) -> Option<Self> {
        let mut hysteresis = Self::new(set, rest)?;
        for (taxel, follower) in hysteresis.followers.iter_mut().enumerate() {
            let (Some(follower), Some(plays)) = (follower, set.plays(taxel)) else { continue };
            let off_kpa = bracket::half_width_kpa(plays) as f32;
            follower.offset_kpa = -off_kpa; // the curve is at the upper end of the loop
            hysteresis.unknown.push(Unknown { taxel, least: None, off_kpa });
            hysteresis.unsure.push((taxel, off_kpa));
        }
        Some(hysteresis)
    }

    /// The zero is now `rest`; the histories go on.
    pub fn shift_zero(&mut self, rest: &[TaxelBaseline]) {
        for (taxel, follower) in self.followers.iter_mut().enumerate() {
            let then = self.set.baseline.get(taxel).map(|t| t.mean);
            if let (Some(follower), Some(then), Some(now)) = (follower, then, rest.get(taxel))
                && now.mean.is_finite()
            {
                follower.shift = then - now.mean;
            }
        }
    }

    /// Which taxels are sound has changed: those that are again after more than `UNHEARD_S` may have been pressed meanwhile.
    pub fn on_soundness(&mut self, time: Time, sound: impl Fn(usize) -> bool) {
        let longest_s = UNHEARD_S.max(self.tau_s);
        for (taxel, follower) in self.followers.iter().enumerate() {
            let Some(follower) = follower.as_ref().filter(|_| sound(taxel)) else { continue };
            if follower.last.is_some_and(|last| time.seconds_since(last) <= longest_s) {
                continue;
            }
            let anew = Unknown { taxel, least: None, off_kpa: 0.0 };
            match self.unknown.binary_search_by_key(&taxel, |unknown| unknown.taxel) {
                Ok(place) => self.unknown[place] = anew,
                Err(place) => self.unknown.insert(place, anew),
            }
        }
    }

    /// Takes a scan. A taxel that is not `sound` now (silent, faulty) keeps its history and catches up later.
    ///
    /// Any time step will do: the mean is exact for every length of it, and one that is not positive is none.
    pub fn follow<'a>(&mut self, time: Time, counts: impl Into<Counts<'a>>, sound: impl Fn(usize) -> bool) {
        let counts = counts.into();
        self.unsure.clear();
        if !self.unknown.is_empty() {
            self.open(counts, &sound);
        }
        let mut known: Option<(f64, f64)> = None; // nearly all taxels have the same step
        for (taxel, (follower, count)) in self.followers.iter_mut().zip(counts.iter_units()).enumerate() {
            let (Some(follower), Some(plays)) = (follower.as_mut().filter(|_| sound(taxel)), self.set.plays(taxel))
            else {
                continue;
            };
            let step_s = follower.last.map_or(0.0, |last| time.seconds_since(last));
            let gain = match known {
                Some((step, gain)) if step == step_s => gain,
                _ => gain(step_s, self.tau_s),
            };
            known = Some((step_s, gain));
            follower.last = Some(follower.last.map_or(time, |last| last.max(time)));
            follower.mean += gain * (count - follower.mean);
            follower.offset_kpa = plays.bend_kpa(&mut follower.plays, follower.mean + follower.shift) as f32;
            if follower.is_ahead(count) {
                self.unsure.push((taxel, follower.lag_kpa(plays, count)));
            }
        }
        if !self.unknown.is_empty() {
            self.enclose(counts, &sound);
        }
    }

    /// Histories that are not known begin at the first count that is seen.
    fn open(&mut self, counts: Counts<'_>, sound: impl Fn(usize) -> bool) {
        for unknown in self.unknown.iter_mut().filter(|unknown| unknown.least.is_none() && sound(unknown.taxel)) {
            let taxel = unknown.taxel;
            let known = (self.followers[taxel].as_mut(), self.set.plays(taxel), counts.units(taxel));
            if let (Some(follower), Some(plays), Some(count)) = known {
                (follower.mean, follower.last) = (count, None);
                follower.plays = bracket::risen(plays, count + follower.shift);
                unknown.least = Some(bracket::fallen(plays, count + follower.shift));
            }
        }
    }

    /// The least that a history may add follows the scan, too, and the middle is served. One that has met the most is known,
    /// and so is that of a taxel that is back at its zero, where all that pressed on it has gone.
    fn enclose(&mut self, counts: Counts<'_>, sound: impl Fn(usize) -> bool) {
        let Self { set, followers, unknown, unsure, .. } = self;
        unknown.retain_mut(|unknown| {
            let taxel = unknown.taxel;
            let (Some(follower), Some(plays)) = (followers[taxel].as_mut(), set.plays(taxel)) else { return false };
            if let (Some(least), Some(count)) = (&mut unknown.least, counts.units(taxel).filter(|_| sound(taxel))) {
                let present = follower.mean + follower.shift;
                let (most_kpa, least_kpa) = (follower.offset_kpa, plays.bend_kpa(least, present) as f32);
                let (off_kpa, all_kpa) = (0.5 * (most_kpa - least_kpa), bracket::half_width_kpa(plays));
                let pressed = plays.sign.as_f64() * (present - set.baseline[taxel].mean);
                if f64::from(off_kpa) <= SAME_SHARE * all_kpa || pressed <= f64::from(follower.noise_counts) {
                    return false;
                }
                follower.offset_kpa = 0.5 * (most_kpa + least_kpa);
                // What lags behind may lie anywhere in the loop.
                let ahead_kpa = all_kpa as f32 + follower.offset_kpa.abs();
                unknown.off_kpa = if follower.is_ahead(count) { ahead_kpa } else { off_kpa };
            }
            unsure.push((taxel, unknown.off_kpa));
            true
        });
    }

    /// What each taxel's history adds to its pressure, kPa; 0 where hysteresis is not compensated.
    pub fn offset_kpa(&self) -> Arc<[f32]> {
        self.followers.iter().map(|follower| follower.as_ref().map_or(0.0, |f| f.offset_kpa)).collect()
    }

    /// The same with what is uncertain of it.
    pub fn offsets(&self) -> Offsets {
        let unsure_kpa = (!self.unsure.is_empty()).then(|| {
            let mut unsure_kpa = vec![0.0_f32; self.followers.len()];
            self.unsure.iter().for_each(|&(taxel, kpa)| unsure_kpa[taxel] = unsure_kpa[taxel].max(kpa));
            unsure_kpa.into()
        });
        Offsets::new(self.offset_kpa(), unsure_kpa)
    }
}

impl Follower {
    /// Whether a count lies farther from the mean than noise explains.
    fn is_ahead(&self, count: f64) -> bool {
        (count - self.mean).abs() > AHEAD_SIGMAS * f64::from(self.noise_counts)
    }

    /// How much the offset moves yet if the mean catches up with a count, kPa, not negative.
    fn lag_kpa(&self, plays: &Plays, count: f64) -> f32 {
        (plays.bend_kpa(&mut self.plays.clone(), count + self.shift) as f32 - self.offset_kpa).abs()
    }
}

/// By how much the mean moves to the newest count after `step_s`: 1 - exp(-step / tau).
fn gain(step_s: f64, tau_s: f64) -> f64 {
    if step_s <= 0.0 {
        0.0
    } else if tau_s <= 0.0 {
        1.0
    } else {
        exponential_share(step_s, tau_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::tests::with_plays;

    /// Twice the sum of weight x radius: the offset can be no further below 0.
    const OFFSET_MAX_KPA: f64 = 2.0 * (0.8 * 4.0 + 0.4 * 10.0);

    /// Two taxels whose counts fall from 240 by one a kilopascal; the first one's hysteresis is compensated.
    fn set(smooth_s: f64) -> Arc<ModelSet> {
        let mut set = ModelSet::clone(&with_plays(2, smooth_s));
        set.recorded.as_mut().unwrap().taxels[1].as_mut().unwrap().plays = None;
        Arc::new(set)
    }

    fn rest() -> Vec<TaxelBaseline> {
        crate::force::tests::rest(2)
    }

    /// Bends of the first taxel while the counts go along `path`, a scan every 50 ms.
    fn offsets(hysteresis: &mut Hysteresis, path: impl IntoIterator<Item = u16>) -> Vec<f32> {
        let follow = |(i, count): (i64, u16)| {
            hysteresis.follow(Time::from_nanos(i * 50_000_000), &[count; 2], |_| true);
            assert_eq!(hysteresis.offset_kpa()[1], 0.0, "nothing to compensate there");
            hysteresis.offset_kpa()[0]
        };
        (0..).zip(path).map(follow).collect()
    }

    #[test]
    fn a_load_from_rest_reads_the_curve_and_its_release_below() {
        let mut hysteresis = Hysteresis::new(&set(0.5), &rest()).unwrap();
        assert!(hysteresis.offset_kpa()[0].abs() < 1e-3, "at rest the last load has gone");
        let slow = |counts: std::ops::Range<u16>| counts.flat_map(|c| [c; 40]);
        let load = offsets(&mut hysteresis, slow(180..240).collect::<Vec<_>>().into_iter().rev());
        assert!(load[load.len() - 1].abs() < 1e-3, "{load:?}");
        let release = offsets(&mut hysteresis.clone(), slow(180..215));
        assert!(release[0] > -1e-3, "the times of this second run begin at 0 again and lie in the past");
        hysteresis.followers.iter_mut().flatten().for_each(|follower| follower.last = None);
        let release = offsets(&mut hysteresis, slow(180..215));
        assert!((f64::from(release[release.len() - 1]) + OFFSET_MAX_KPA).abs() < 1e-3, "{release:?}");
    }

    #[test]
    fn a_silent_or_faulty_taxel_keeps_its_history() {
        let mut hysteresis = Hysteresis::new(&set(0.0), &rest()).unwrap();
        offsets(&mut hysteresis, (200..240).rev());
        let before = hysteresis.offset_kpa();
        hysteresis.follow(Time::from_seconds(100.0), &[240; 2], |_| false);
        assert_eq!(hysteresis.offset_kpa(), before);
    }

    #[test]
    fn a_zero_that_drifts_by_what_the_counts_drift_changes_nothing() {
        let drifted: Vec<TaxelBaseline> = rest().iter().map(|t| TaxelBaseline { mean: t.mean - 3.0, ..*t }).collect();
        let mut still = Hysteresis::new(&set(0.0), &rest()).unwrap();
        let mut moved = still.clone();
        moved.shift_zero(&drifted);
        let there = offsets(&mut still, (200..240).rev());
        assert_eq!(offsets(&mut moved, (197..237).rev()), there);
    }
}
