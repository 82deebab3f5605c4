//! The zero of a recording: where the taxels rest, whether they come back, and whether the beginning of another
//! recording shows the same rest.

use crate::baseline::TaxelBaseline;
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::scans::{Scans, modules};
use crate::model_set::ModelSet;
use crate::statistics::{mean, root_mean_square};
use crate::zero::rest::judge::{Reference, judge, lighter};
use crate::zero::rest::window::RestWindow;

/// Within this share of the range above the least pressure the rig is at rest.
const REST_BAND: f64 = 0.02;

/// Fewest scans of a baseline.
const BASELINE_SCANS_MIN: usize = 20;

/// The end of a calibration over which the return to zero is looked at, seconds.
const RETURN_S: f64 = 5.0;

/// The beginning of a recording that may serve as its zero, seconds.
const WINDOW_S: f64 = 2.0;

/// A taxel has a zero of its own if it is sound in so large a part of the window. The median of the others is no
/// substitute: for a flickering taxel it is wrong by 60 to 90 kPa.
const SOUND_SHARE: f64 = 0.9;

/// Scans of the calibration, up to its highest pressure, in which the rig was at rest.
pub(super) fn rest_scans(kpa: &[f64]) -> Vec<bool> {
    let known = (0..kpa.len()).filter(|&scan| kpa[scan].is_finite());
    let top = known.max_by(|&a, &b| kpa[a].total_cmp(&kpa[b])).unwrap_or(0);
    let limit = rest_limit_kpa(kpa);
    kpa.iter().enumerate().map(|(i, p)| i <= top && *p <= limit).collect()
}

/// The rig is at rest up to this pressure, kPa.
pub(super) fn rest_limit_kpa(kpa: &[f64]) -> f64 {
    let known = || kpa.iter().copied().filter(|p| p.is_finite());
    let (low, high) = (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
    low + REST_BAND * (high - low)
}

/// Mean and noise over the `rest` scans that are sound; NaN if they are too few.
pub(super) fn baseline(counts: &[f64], masked: &[bool], rest: &[bool]) -> TaxelBaseline {
    let at_rest =
        || counts.iter().zip(masked).zip(rest).filter(|((_, masked), rest)| **rest && !**masked).map(|(c, _)| *c.0);
    let (level, n) = mean(at_rest());
    if n < BASELINE_SCANS_MIN {
        return TaxelBaseline::UNKNOWN;
    }
    TaxelBaseline { mean: level, noise: root_mean_square(at_rest().map(|c| c - level)) }
}

/// How far `taxels` end from their baseline, root mean square in counts; `None` of a calibration that does not end at rest.
pub(crate) fn zero_return(
    scans: &Scans<'_>,
    masks: &Masks,
    kpa: &[f64],
    baseline: &[TaxelBaseline],
    taxels: &[usize],
) -> Option<f64> {
    let tail = scans.len().saturating_sub(scans.scans_in(RETURN_S))..scans.len();
    let (pressure, _) = mean(kpa[tail.clone()].iter().copied());
    if pressure.is_nan() || pressure > rest_limit_kpa(kpa) {
        return None;
    }
    let moved = taxels.iter().map(|&t| {
        let sound = tail.clone().filter(|&i| !masks.of(t)[i]).map(|i| scans.counts[t][i]);
        mean(sound).0 - baseline[t].mean
    });
    Some(root_mean_square(moved)).filter(|rms| rms.is_finite())
}

/// What to do about the zero of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Tare {
    /// Tare from the beginning of the recording if it proves to be at rest; else leave the zero of the calibration.
    #[default]
    Auto,
    /// Leave the zero of the calibration.
    None,
    /// The operator says that the first so many seconds are unloaded.
    Seconds(f64),
}

/// What was done about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Zero {
    /// Mean count now less that of the calibration, per taxel, NaN without a zero of its own; `None` where the zero of the
    /// calibration was left.
    pub moved: Option<Vec<f64>>,
    /// The same in words, and why.
    pub words: String,
}

impl Zero {
    /// By how much a taxel's zero has moved since the calibration, counts; `None` if it has no zero here.
    pub fn moved(&self, taxel: usize) -> Option<f64> {
        self.moved.as_ref().map_or(Some(0.0), |moved| moved.get(taxel).copied().filter(|m| m.is_finite()))
    }

    /// The zero of the calibration is left.
    fn left(why: &str) -> Self {
        Self { moved: None, words: format!("not tared, the zero is that of the calibration{why}") }
    }

    fn tared(window_s: f64, proof: &str, moved: Vec<f64>) -> Self {
        let (taxels, without) = (moved.len(), moved.iter().filter(|m| !m.is_finite()).count());
        let words = format!(
            "tared from the first {window_s} s{proof}; {without} of {taxels} taxels have no zero of their own there"
        );
        Self { moved: Some(moved), words }
    }

    /// Does what `tare` asks for.
    pub fn find(tare: Tare, scans: &Scans<'_>, masks: &Masks, set: &ModelSet, module_size: usize) -> Self {
        let window_s = match tare {
            Tare::None => return Self::left(""),
            Tare::Seconds(seconds) => seconds,
            Tare::Auto => WINDOW_S,
        };
        let n = scans.scans_in(window_s).min(scans.len());
        let modules = modules(scans.counts.len(), module_size);
        let window = |first: usize, whole: bool| {
            let spoiled = |t: usize| whole && masks.of(t)[first..first + n].contains(&true);
            let spoiled: Vec<bool> = (0..scans.counts.len()).map(spoiled).collect();
            let mut seen = RestWindow::new(scans.counts.len(), &modules);
            for i in first..first + n {
                let count = |t: usize| (!spoiled[t] && !masks.of(t)[i]).then(|| scans.counts[t][i]);
                seen.push(i >= first + n / 2, (0..scans.counts.len()).map(count));
            }
            seen
        };
        let begin = window(0, false);
        let sound = |t: &usize| masks.of(*t)[..n].iter().filter(|m| !**m).count() as f64 >= SOUND_SHARE * n as f64;
        let now = begin.all().baseline();
        let own = |t: usize| if sound(&t) { now[t].mean - set.baseline[t].mean } else { f64::NAN };
        let moved: Vec<f64> = (0..scans.counts.len()).map(own).collect();
        if tare != Tare::Auto {
            return Self::tared(window_s, ", confirmed by the operator", moved);
        }
        let sign = set.signs();
        let verdict = judge(&begin, Reference { models: Some(&set.baseline), zero: None, sign: &sign });
        if !verdict.is_rest() {
            return Self::left(&format!(": the beginning is not shown to be unloaded; {verdict}"));
        }
        let own = |(t, now): (usize, TaxelBaseline)| if sound(&t) { now } else { TaxelBaseline::UNKNOWN };
        let zero: Vec<TaxelBaseline> = now.into_iter().enumerate().map(own).collect();
        for first in (n..scans.len().saturating_sub(n - 1)).step_by(n) {
            let later = window(first, true);
            if let Some(lift) = lighter(&zero, (&later.all().baseline(), later.all().count()), &modules, &sign) {
                let (lift, after_s) = (lift.lighter_in_words(module_name), scans.time_s[first] - scans.time_s[0]);
                return Self::left(&format!(": the beginning is not unloaded; {lift} {after_s:.1} s later"));
            }
        }
        Self::tared(window_s, &format!(": {verdict}; nothing later is lighter"), moved)
    }
}

fn module_name(module: usize) -> String {
    format!("module {module}")
}
