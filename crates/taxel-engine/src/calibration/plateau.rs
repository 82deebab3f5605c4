//! A skin in a bag whose pressure somebody holds, reads off a dial and types: whether it has settled, and which scans belong to
//! what is typed. Plateau by plateau the pressure rises, because skin has hysteresis.

use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::Time;

use crate::calibration::limits::{PROBATION, SessionLimits};
use crate::calibration::samples::{Pending, Sample, SessionSamples};
use crate::statistics::{mean, root_mean_square};

/// So many plateaus above the vented bag make a calibration.
pub const PLATEAUS_MIN: usize = 8;
/// A wider step, as a share of the target, leaves a gap through which no curve is drawn.
const STEP_MAX_SHARE: f64 = 0.3;
/// The skin is watched for so long, and in at least so many scans.
const WATCHED: Duration = Duration::from_secs(3);
const SCANS_MIN: usize = 60;
/// From the first third of that to the last a settled skin moves by less, in counts in the mean of its taxels: by a leak of 0.05 kPa
/// a second, which is below what a dial tells, and by creep.
const DRIFT_COUNTS: f64 = 0.1;
/// While somebody reads and types it may move by so many times that: what is shown must not be taken back at once.
const TYPING_SLACK: f64 = 2.0;
/// Or by this share of what it moved since the plateau before: after a large step creep goes on for minutes.
const DRIFT_SHARE: f64 = 0.01;
/// A skin that has moved by less than this since the plateau before, in counts, is at the same pressure.
const MOVED_COUNTS: f64 = 0.2;
/// A skin that is back from the furthest since then by more than this share of the way, and by more than MOVED_COUNTS beside its
/// noise, has been at a higher pressure.
const BACK_SHARE: f64 = 0.15;
/// So many standard deviations of its noise no skin moves by chance.
const NOISE_SIGMAS: f64 = 3.0;
/// What is said of a plateau that was come to from above.
const BACK: &str = "the pressure has been higher since the plateau before, and skin reads otherwise while it falls: pump beyond \
                    that, hold, and type what the dial shows then";
/// Nobody needs longer from one plateau to the next.
pub const PLATEAU_PATIENCE: Duration = Duration::from_secs(15 * 60);

/// What an operator sees of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlateauView {
    /// Whether the skin has settled at a new pressure: then the dial may be typed.
    pub settled: bool,
    /// Plateaus of the session so far, beside those of the vented bag.
    pub taken: u16,
    /// What was typed last in this ramp, kPa.
    pub last_kpa: Option<f64>,
}

/// The plateaus of one ramp.
#[derive(Clone, Debug, Default)]
pub struct Plateaus {
    /// The newest scans, each with the mean of its taxels in counts.
    scans: VecDeque<(Pending, f64)>,
    /// The plateau before: what was typed, and the mean of the taxels.
    last: Option<(f64, f64)>,
    /// How far the skin has been from there since, in counts.
    furthest: f64,
    /// When it was taken, or the ramp began.
    pub since: Time,
}

impl Plateaus {
    /// A ramp begins, of which nothing was typed.
    pub fn begin(now: Time) -> Self {
        Self { since: now, ..Self::default() }
    }

    /// Takes a scan.
    pub fn push(&mut self, scan: Pending) {
        let (mean, _) = mean(scan.counts.counts().iter_units());
        self.furthest = self.last.map_or(0.0, |(_, last)| self.furthest.max((mean - last).abs()));
        self.scans.push_back((scan, mean));
        while self.scans.len() > SCANS_MIN && self.span() > WATCHED {
            self.scans.pop_front();
        }
    }

    /// The scans are invalid.
    pub fn forget_scans(&mut self) {
        self.scans.clear();
    }

    /// What was typed last, kPa.
    pub fn last_kpa(&self) -> Option<f64> {
        self.last.map(|(kpa, _)| kpa)
    }

    /// Whether the skin has settled at a new pressure.
    pub fn is_settled(&self) -> bool {
        self.check_settled(1.0).is_ok()
    }

    /// What the operator is to do now, in words; `taken` plateaus of the session count.
    pub fn advice(&self, taken: usize, limits: &SessionLimits) -> String {
        match (self.check_settled(1.0), self.last_kpa()) {
            (Ok(()), _) => "the skin has settled: read the dial and type what it shows".to_owned(),
            (Err(why), _) if why == BACK => why,
            (_, None) => "leave the bag vented: the skin is watched".to_owned(),
            (_, Some(last)) => {
                let left = PLATEAUS_MIN.saturating_sub(taken).max(1) as f64;
                let next = last + (limits.target.0 - last).max(0.0) / left;
                format!(
                    "{taken} of {PLATEAUS_MIN} plateaus: pump to about {next:.0} kPa and hold until the skin has settled"
                )
            }
        }
    }

    /// The dial shows `kpa`: gives the scans of this plateau.
    ///
    /// # Errors
    /// Why it is none, in words.
    pub fn take(&mut self, now: Time, kpa: f64, limits: &SessionLimits) -> Result<Vec<Pending>, String> {
        self.check(kpa, limits)?;
        let (mean, _) = mean(self.scans.iter().map(|(_, mean)| *mean));
        let scans = std::mem::take(&mut self.scans).into_iter().map(|(scan, _)| scan);
        // Those whose zero may still turn out to be wrong stay out.
        let scans = scans.filter(|scan| now.since(scan.time) >= PROBATION).collect();
        (self.last, self.furthest, self.since) = (Some((kpa, mean)), 0.0, now);
        Ok(scans)
    }

    fn check(&self, kpa: f64, limits: &SessionLimits) -> Result<(), String> {
        let (most, vented) = (limits.target_max_kpa(), limits.vented_below.0);
        match self.last {
            None if kpa.abs() <= vented => {}
            None => {
                return Err(format!(
                    "{kpa} kPa: the first plateau is the vented bag. Vent it, and type what the dial shows then, at most {vented} kPa"
                ));
            }
            Some((last, _)) if kpa <= last => {
                return Err(format!(
                    "{kpa} kPa is not above the {last} kPa of the plateau before. Skin reads otherwise while the pressure falls: pump \
                     to more than {last} kPa, hold, and type that"
                ));
            }
            Some(_) if kpa > most => return Err(format!("{kpa} kPa: expected at most {most} kPa")),
            Some((last, _)) if kpa - last > STEP_MAX_SHARE * limits.target.0 => {
                return Err(format!(
                    "nothing would be known between {last} and {kpa} kPa: expected at most {:.1} kPa. If the bag is beyond it, \
                     end this session, vent, and begin again with smaller steps",
                    last + STEP_MAX_SHARE * limits.target.0
                ));
            }
            Some(_) => {}
        }
        self.check_settled(TYPING_SLACK)
    }

    /// Whether the skin has settled at a new pressure, where a settled one may move by `slack` times the usual; else what it does.
    fn check_settled(&self, slack: f64) -> Result<(), String> {
        let seconds = WATCHED.as_secs();
        if self.scans.len() < SCANS_MIN || self.span() + WATCHED / 10 < WATCHED {
            return Err(format!("hold the pressure: the skin is watched for {seconds} s"));
        }
        let third = self.scans.len() / 3;
        let means = || self.scans.iter().map(|(_, mean)| *mean);
        let (first, newest) = (mean(means().take(third)).0, mean(means().rev().take(third)).0);
        let scan_sd = root_mean_square(means().zip(means().skip(1)).map(|(a, b)| b - a)) / 2.0_f64.sqrt();
        let chance = NOISE_SIGMAS * scan_sd * (2.0 / third as f64).sqrt();
        let moved = self.last.map(|(_, last)| (newest - last).abs());
        let limit = DRIFT_COUNTS.max(chance).max(DRIFT_SHARE * moved.unwrap_or(0.0));
        let drift = (newest - first).abs();
        if drift > slack * limit {
            return Err(format!(
                "hold the pressure: the skin still moves, by {drift:.2} counts in {seconds} s. If it does not end, the bag leaks"
            ));
        }
        let Some(((last, _), moved)) = self.last.zip(moved) else { return Ok(()) };
        if moved < MOVED_COUNTS.max(chance) {
            return Err(format!(
                "the skin has not moved since {last} kPa: pump on. If you have, the dial is not of this bag"
            ));
        }
        let back = BACK_SHARE * self.furthest + MOVED_COUNTS + NOISE_SIGMAS * scan_sd;
        if self.furthest - moved > back { Err(BACK.to_owned()) } else { Ok(()) }
    }

    /// From the oldest scan to the newest.
    fn span(&self) -> Duration {
        let ends = self.scans.front().zip(self.scans.back());
        ends.map_or(Duration::ZERO, |((first, _), (last, _))| last.time.since(first.time))
    }
}

impl SessionSamples {
    /// How many plateaus there are above those of the vented bag: runs of samples of one ramp at one pressure, of which the first of
    /// each ramp is the vented bag's.
    pub fn plateaus(&self) -> usize {
        let runs = self.samples.chunk_by(|a, b| a.ramp == b.ramp && a.pressure_kpa == b.pressure_kpa).count();
        runs - self.samples.chunk_by(|a, b| a.ramp == b.ramp).count()
    }
}

/// Of what was typed, how far the pressure may have moved within a plateau, root mean square over all, in kPa: the scatter of the
/// skin's mean within each, by what it moves from plateau to plateau. 0 of samples that a gauge came with.
pub fn scatter_kpa(samples: &SessionSamples) -> f64 {
    let of_run = |run: &[Sample]| {
        let means: Vec<f64> = run.iter().map(|sample| mean(sample.counts.counts().iter_units()).0).collect();
        let (level, _) = mean(means.iter().copied());
        (run[0].pressure_kpa, level, root_mean_square(means.iter().map(|m| m - level)))
    };
    let runs = samples.samples.chunk_by(|a, b| a.ramp == b.ramp && a.pressure_kpa == b.pressure_kpa);
    let runs: Vec<_> = runs.filter(|run| run.len() >= SCANS_MIN / 3).map(of_run).collect();
    let scatters = runs.windows(2).filter_map(|pair| {
        let per_kpa = (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0);
        (pair[1].0 > pair[0].0 && per_kpa != 0.0).then(|| pair[1].2 / per_kpa)
    });
    Some(root_mean_square(scatters)).filter(|kpa| kpa.is_finite()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zero::rest::tests::Noise;

    /// A skin of 24 taxels that is read every 50 ms, whose counts follow `counts` of seconds, with noise of one count.
    struct Skin {
        now: Time,
        noise: Noise,
        plateaus: Plateaus,
    }

    impl Skin {
        fn new() -> Self {
            Self { now: Time::default(), noise: Noise(7), plateaus: Plateaus::begin(Time::default()) }
        }

        fn run(&mut self, seconds: f64, counts: impl Fn(f64) -> f64) {
            let begun = self.now;
            while self.now.seconds_since(begun) < seconds {
                self.now = self.now + Duration::from_millis(50);
                let level = counts(self.now.seconds_since(begun));
                let counts: Vec<u16> =
                    (0..24).map(|_| (level + 2.0 * self.noise.uniform() - 1.0).round() as u16).collect();
                self.plateaus.push(Pending { time: self.now, counts: counts.into() });
            }
        }

        fn take(&mut self, kpa: f64) -> Result<usize, String> {
            self.plateaus.take(self.now, kpa, &SessionLimits::default()).map(|scans| scans.len())
        }
    }

    #[test]
    fn a_skin_that_moves_or_has_not_moved_is_not_taken() {
        let mut skin = Skin::new();
        skin.run(4.0, |_| 240.0);
        skin.take(0.0).unwrap();
        skin.run(4.0, |_| 240.0);
        assert!(skin.take(5.0).unwrap_err().contains("has not moved since 0 kPa"));
        skin.run(4.0, |t| 240.0 - t);
        assert!(skin.take(5.0).unwrap_err().contains("still moves, by "));
        skin.run(10.0, |t| 236.0 - 2.0 * (1.0 - (-t / 2.0).exp()));
        assert!(skin.plateaus.is_settled(), "creep has ended");
        skin.take(5.0).unwrap();
    }

    #[test]
    fn a_plateau_that_was_come_to_from_above_is_none() {
        let mut skin = Skin::new();
        skin.run(4.0, |_| 240.0);
        skin.take(0.0).unwrap();
        skin.run(4.0, |t| if t < 0.5 { 220.0 } else { 230.0 });
        assert!(skin.take(10.0).unwrap_err().contains("has been higher since the plateau before"));
        skin.run(4.0, |_| 219.0);
        skin.take(20.0).unwrap();
    }

    #[test]
    fn the_pressure_rises_from_the_vented_bag_in_steps_that_leave_no_gap() {
        let mut skin = Skin::new();
        let mut level = 240.0;
        let mut plateau = |kpa: f64| {
            level -= 3.0;
            skin.run(4.0, |_| level);
            skin.take(kpa)
        };
        assert!(plateau(20.0).unwrap_err().contains("the first plateau is the vented bag"));
        plateau(0.5).unwrap();
        plateau(10.0).unwrap();
        for (kpa, says) in [
            (10.0, "10 kPa is not above the 10 kPa of the plateau before"),
            (9.5, "pump to more than 10 kPa, hold, and type that"),
            (50.0, "nothing would be known between 10 and 50 kPa: expected at most 31.0 kPa"),
        ] {
            let why = plateau(kpa).unwrap_err();
            assert!(why.contains(says), "{why}");
        }
        plateau(31.0).unwrap();
    }
}
