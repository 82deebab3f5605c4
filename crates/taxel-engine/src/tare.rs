//! The zero of a patch: watched, judged, kept with its proof, and lost when something may have moved it.

use std::time::Duration;
use taxel_skin::Time;

use crate::command::RequestId;
use crate::drift::DriftView;
use crate::rest::{RestStatistics, RestVerdict, TaxelBaseline};
use crate::snapshot::TareView;

/// How much longer than planned a watch may take before it is given up.
const GRACE: Duration = Duration::from_secs(2);

/// A provisional zero rests on at least so long: three conversions of the boards, however often they send.
const FIRST_SPAN_MIN: Duration = Duration::from_millis(100);

/// Who asked for a zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Nobody: after start, against the active model set.
    AtStart,
    /// An operator; `confirmed_by` vouches that nothing touches the skin.
    Operator {
        /// Whom to answer.
        request: RequestId,
        /// Who vouches.
        confirmed_by: Option<String>,
    },
    /// A calibration session, before a ramp.
    Session {
        /// Who vouches.
        confirmed_by: Option<String>,
    },
}

impl Purpose {
    /// Who vouches that nothing touches the skin.
    #[must_use]
    pub fn confirmed_by(&self) -> Option<&str> {
        match self {
            Self::AtStart => None,
            Self::Operator { confirmed_by, .. } | Self::Session { confirmed_by } => confirmed_by.as_deref(),
        }
    }
}

/// A watch that has seen enough, or that never will.
#[derive(Debug)]
pub struct Watched {
    /// Who asked.
    pub purpose: Purpose,
    /// What was seen; `None` if too few scans came in time.
    pub statistics: Option<RestStatistics>,
}

/// The zero of one patch.
#[derive(Debug, Default)]
pub struct Tare {
    view: TareView,
    baseline: Option<Vec<TaxelBaseline>>,
    watch: Option<Watch>,
    /// Whether a provisional zero was thought of: one chance, or each retry would be a chance for a load.
    looked: bool,
}

#[derive(Debug)]
struct Watch {
    statistics: RestStatistics,
    begun: Time,
    purpose: Purpose,
    /// Scans in which no module was silent.
    whole: u32,
}

impl Tare {
    /// Begins to watch with empty `statistics`. An earlier watch is given up and returned.
    pub fn watch(&mut self, now: Time, statistics: RestStatistics, purpose: Purpose) -> Option<Purpose> {
        let watch = Watch { statistics, begun: now, purpose, whole: 0 };
        self.watch.replace(watch).map(|old| old.purpose)
    }

    /// Who asked for the watch that is under way.
    #[must_use]
    pub fn watching(&self) -> Option<&Purpose> {
        self.watch.as_ref().map(|w| &w.purpose)
    }

    /// Gives up the watch.
    pub fn stop_watching(&mut self) -> Option<Purpose> {
        self.watch.take().map(|w| w.purpose)
    }

    /// Takes one scan; a taxel with a fault is `None`, and the scan is `whole` if no module was silent.
    pub fn push(&mut self, whole: bool, scan: impl IntoIterator<Item = Option<f64>>) {
        if let Some(watch) = &mut self.watch {
            watch.statistics.push(scan);
            watch.whole += u32::from(whole);
        }
    }

    /// What was seen so far, as soon as it may do for a provisional zero: once, at start alone.
    pub fn first_look(&mut self, now: Time, first_scans: u32) -> Option<&RestStatistics> {
        let watch = self.watch.as_ref().filter(|w| w.purpose == Purpose::AtStart && first_scans > 0)?;
        let enough = watch.whole >= first_scans && now.since(watch.begun) >= FIRST_SPAN_MIN;
        if !enough || std::mem::replace(&mut self.looked, true) {
            return None;
        }
        Some(&watch.statistics)
    }

    /// Ends the watch after so long a time and so many scans.
    pub fn full_look(&mut self, now: Time, duration: Duration, scans_min: u64) -> Option<Watched> {
        let watch = self.watch.as_ref()?;
        let enough = watch.statistics.count() >= scans_min && now.since(watch.begun) >= duration;
        let watch = if enough { self.watch.take()? } else { return None };
        Some(Watched { purpose: watch.purpose, statistics: Some(watch.statistics) })
    }

    /// Time passed: a watch that gets no scans ends.
    pub fn tick(&mut self, now: Time, duration: Duration) -> Option<Watched> {
        let late = self.watch.as_ref().is_some_and(|w| now.since(w.begun) > duration + GRACE);
        let watch = if late { self.watch.take()? } else { return None };
        Some(Watched { purpose: watch.purpose, statistics: None })
    }

    /// The zero was proven, or somebody vouches for it.
    pub fn accept(
        &mut self,
        wall_ns: i64,
        baseline: Vec<TaxelBaseline>,
        verdict: &RestVerdict,
        confirmed_by: Option<&str>,
    ) {
        let reason = match confirmed_by {
            Some(who) => format!("{who} confirms that nothing touches the skin; {verdict}"),
            None => verdict.to_string(),
        };
        self.take(wall_ns, baseline, reason, None);
    }

    /// Rest is proven as far as so few scans can: the watch goes on.
    pub fn accept_provisionally(
        &mut self,
        wall_ns: i64,
        baseline: Vec<TaxelBaseline>,
        verdict: &RestVerdict,
        scans: u64,
    ) {
        let scans = u32::try_from(scans).unwrap_or(u32::MAX);
        self.take(wall_ns, baseline, format!("for now, after {scans} scans: {verdict}"), Some(scans));
    }

    fn take(&mut self, wall_ns: i64, baseline: Vec<TaxelBaseline>, reason: String, provisional_scans: Option<u32>) {
        self.view = TareView {
            epoch: self.view.epoch + 1,
            valid: true,
            wall_ns,
            reason,
            baseline_median: median(baseline.iter().map(|t| t.mean)),
            noise_median: median(baseline.iter().map(|t| t.noise)),
            provisional_scans,
            drift: DriftView::default(),
        };
        self.baseline = Some(baseline);
    }

    /// How the zero follows the temperature.
    pub const fn set_drift(&mut self, drift: DriftView) {
        self.view.drift = drift;
    }

    /// Something may have moved the zero: live force is invalid until it is taken again.
    pub fn lose(&mut self, reason: impl Into<String>) {
        if self.view.valid || self.view.reason.is_empty() {
            self.view.epoch += 1;
            self.view.valid = false;
            self.view.reason = reason.into();
            self.view.drift = DriftView::default();
        }
        if self.view.provisional_scans.take().is_some() {
            self.baseline = None;
        }
    }

    /// Replaces the reason for which there is no zero; a valid one is left alone.
    pub fn explain(&mut self, reason: impl Into<String>) {
        if !self.view.valid {
            self.view.reason = reason.into();
        }
    }

    /// What the world sees of it.
    #[must_use]
    pub const fn view(&self) -> &TareView {
        &self.view
    }

    /// The zero, one per taxel, if it is valid.
    #[must_use]
    pub fn baseline(&self) -> Option<&[TaxelBaseline]> {
        self.baseline.as_deref().filter(|_| self.view.valid)
    }

    /// Whether a zero was ever taken that was watched in full.
    #[must_use]
    pub const fn ever_taken(&self) -> bool {
        self.baseline.is_some() && self.view.provisional_scans.is_none()
    }
}

/// Median of the finite values; NaN without any.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut finite: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    match finite.len() {
        0 => f64::NAN,
        n => (finite[(n - 1) / 2] + finite[n / 2]) / 2.0,
    }
}
