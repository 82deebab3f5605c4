//! Reading the live force under a known load: for a short time, and only while it holds still.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::Time;

use crate::force::owner::Measured;
use crate::force::sample::{ForceSample, ForceState};
use crate::loads::load::{Load, Reading};
use crate::request::{ErrorReason, Rejection, RequestId};
use crate::statistics::{mean, root_mean_square};

/// The force is read for so long,
const SPAN: Duration = Duration::from_secs(1);
/// and from at least so many scans.
const SCANS_MIN: usize = 5;
/// How much longer than planned a watch may take before it is given up.
const GRACE: Duration = Duration::from_secs(2);
/// The force may scatter by this share of it from scan to scan,
const SCATTER_SHARE_MAX: f64 = 0.1;
/// or by so many newtons, the noise of a few taxels at the threshold of touch.
const SCATTER_FLOOR_N: f64 = 0.05;
/// So many of the reasons why the force was DEGRADED meanwhile are kept.
const REASONS_MAX: usize = 8;
/// Less than this share of the load is no error of calibration: it lies elsewhere.
const READ_SHARE_MIN: f64 = 0.1;
/// From the first half of the time to the second it may move by this share,
const DRIFT_SHARE_MAX: f64 = 0.03;
/// or by so many standard errors of that difference.
const DRIFT_ERRORS_MAX: f64 = 3.0;

/// One load being read.
#[derive(Debug)]
pub struct LoadWatch {
    /// Whom to answer.
    pub request: RequestId,
    /// What lies on the skin.
    pub load: Load,
    begun: Time,
    /// Receive time of the newest frame that was looked at.
    newest: Time,
    /// Zero and model set of the first sample, which must stay.
    first: Option<(u64, Option<Arc<str>>)>,
    totals_n: Vec<f64>,
    sigmas_n: f64,
    reading: Reading,
}

impl LoadWatch {
    /// Begins to read.
    pub fn new(now: Time, request: RequestId, load: Load) -> Self {
        let (first, totals_n, reading) = (None, Vec::new(), Reading::default());
        Self { request, load, begun: now, newest: now, first, totals_n, sigmas_n: 0.0, reading }
    }

    /// Takes what was published: the force of the scan at `time`, read at the zero with this epoch.
    /// `Some` ends the watch: the reading, or why there is none.
    pub fn take(&mut self, time: Time, epoch: u64, measured: &Measured) -> Option<Result<Reading, Rejection>> {
        let force = &measured.sample;
        if !matches!(force.state, ForceState::Ok | ForceState::Degraded) {
            return Some(Err(ErrorReason::NoForce.because(format!("there is no force: {}", force.why()))));
        }
        if time <= self.newest {
            return None; // no new frame in it
        }
        self.newest = time;
        let ground = (epoch, force.model_set.clone());
        if *self.first.get_or_insert_with(|| ground.clone()) != ground {
            return Some(Err(ErrorReason::LoadInterrupted.because("the zero or the model set changed meanwhile")));
        }
        self.add(force);
        self.reading.taxels = measured.active.to_vec();
        let enough = self.totals_n.len() >= SCANS_MIN && time.since(self.begun) >= SPAN;
        enough.then(|| self.conclude())
    }

    /// When a watch that gets no scans ends.
    pub fn give_up_at(&self) -> Time {
        self.begun + SPAN + GRACE + Duration::from_nanos(1)
    }

    /// Time passed: a watch that gets no scans ends.
    pub fn overdue(&self, now: Time) -> Option<Result<Reading, Rejection>> {
        let late = now.since(self.begun) > SPAN + GRACE;
        let (scans, seconds) = (self.totals_n.len(), (SPAN + GRACE).as_secs());
        late.then(|| {
            let why = format!("{scans} scans came within {seconds} s, at least {SCANS_MIN} are needed");
            Err(ErrorReason::SkinSilent.because(why))
        })
    }

    fn add(&mut self, force: &ForceSample) {
        self.totals_n.push(force.total.map_or(0.0, |total| total.0));
        self.sigmas_n += force.total_sigma.map_or(0.0, |sigma| sigma.0);
        self.reading.out_of_range = self.reading.out_of_range.max(force.out_of_range);
        for reason in &force.reasons {
            let known = self.reading.reasons.iter().any(|known| known == reason.text());
            if !known && self.reading.reasons.len() < REASONS_MAX {
                self.reading.reasons.push(reason.text().to_owned());
            }
        }
    }

    fn conclude(&mut self) -> Result<Reading, Rejection> {
        let scans = self.totals_n.len();
        let mean_of = |totals_n: &[f64]| mean(totals_n.iter().copied()).0;
        let mean_n = mean_of(&self.totals_n);
        let unbiased = (scans as f64 / (scans - 1) as f64).sqrt();
        let scatter_n = unbiased * root_mean_square(self.totals_n.iter().map(|total| total - mean_n));
        let felt = self.totals_n.iter().filter(|total| **total > 0.0).count();
        let (not_felt, unsteady) = (ErrorReason::LoadNotFelt, ErrorReason::LoadUnsteady);
        not_felt.unless(felt == scans, || {
            format!("the skin feels nothing in {} of {scans} scans: no taxel is active", scans - felt)
        })?;
        let laid_on_n = self.load.force_n;
        not_felt.unless(mean_n >= READ_SHARE_MIN * laid_on_n, || {
            format!("{mean_n:.2} N were read under {laid_on_n:.2} N: does the load lie on this patch?")
        })?;
        unsteady.unless(scatter_n <= (SCATTER_SHARE_MAX * mean_n).max(SCATTER_FLOOR_N), || {
            format!("the force is unsteady: {mean_n:.2} N with a scatter of {scatter_n:.2} N")
        })?;
        let (early, late) = self.totals_n.split_at(scans / 2);
        let (early_n, late_n) = (mean_of(early), mean_of(late));
        let error_n = 2.0 * scatter_n / (scans as f64).sqrt();
        let drift_max_n = (DRIFT_SHARE_MAX * mean_n).max(DRIFT_ERRORS_MAX * error_n);
        unsteady.unless((late_n - early_n).abs() <= drift_max_n, || {
            format!("the force is unsteady: it moved from {early_n:.2} N to {late_n:.2} N")
        })?;
        let (sigma_n, reading) = (self.sigmas_n / scans as f64, std::mem::take(&mut self.reading));
        Ok(Reading { scans: scans as u32, mean_n, scatter_n, sigma_n, ..reading })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::reason::{Reason, ReasonCode};
    use taxel_skin::Newton;

    fn watch() -> LoadWatch {
        LoadWatch::new(Time::default(), RequestId(1), Load { force_n: 5.0, ..Load::default() })
    }

    fn at(ms: i64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    fn sample(total_n: f64) -> Measured {
        let (total, total_sigma) = (Some(Newton(total_n)), Some(Newton(0.5)));
        let sample = ForceSample { state: ForceState::Ok, total, total_sigma, ..ForceSample::default() };
        Measured { sample, active: [3, 4, 17].into() }
    }

    /// What comes of scans every 50 ms with this force at each second.
    fn read(force_n: impl Fn(f64) -> f64) -> Result<Reading, Rejection> {
        let mut watch = watch();
        (1..100).find_map(|i| watch.take(at(50 * i), 1, &sample(force_n(0.05 * i as f64)))).expect("an end")
    }

    #[test]
    fn what_moves_or_is_not_there_is_refused_in_words() {
        use ErrorReason::{LoadNotFelt, LoadUnsteady};
        for (what, code, refused) in [
            ("it moved from", LoadUnsteady, read(|s| 5.0 + 0.5 * s)),
            ("scatter", LoadUnsteady, read(|s| 5.0 + (40.0 * s).sin())),
            ("feels nothing in 20 of 20 scans", LoadNotFelt, read(|_| 0.0)),
            ("feels nothing in 11 of 20 scans", LoadNotFelt, read(|s| if s < 0.5 { 0.04 } else { 0.0 })),
            ("does the load lie on this patch", LoadNotFelt, read(|_| 0.1)),
        ] {
            let why = refused.unwrap_err();
            assert!(why.to_string().contains(what), "{why}");
            assert_eq!(why.reason(), code, "{why}");
        }
    }

    #[test]
    fn the_same_frames_count_once_and_silence_ends_the_watch() {
        let mut watch = watch();
        for _ in 0..100 {
            assert_eq!(watch.take(at(0), 1, &sample(5.0)), None, "what came before the command does not count");
            assert_eq!(watch.take(at(1_500), 1, &sample(5.0)), None);
        }
        assert_eq!(watch.overdue(Time::from_seconds(3.0)), None);
        let why = watch.overdue(Time::from_seconds(3.1)).unwrap().unwrap_err().to_string();
        assert!(why.starts_with("1 scans came within 3 s"), "{why}");
    }

    #[test]
    fn another_zero_or_the_loss_of_the_force_ends_the_watch() {
        let mut other = sample(5.0);
        let mut watch = watch();
        assert_eq!(watch.take(at(50), 1, &sample(5.0)), None);
        assert!(watch.take(at(100), 9, &other).unwrap().unwrap_err().to_string().contains("zero"));
        let mut watch = self::watch();
        other.sample.state = ForceState::Stale;
        other.sample.reasons = vec![Reason::new(ReasonCode::TaxelsSilent, "80 taxels are silent")];
        assert!(watch.take(at(150), 1, &other).unwrap().unwrap_err().to_string().contains("80 taxels are silent"));
    }
}
