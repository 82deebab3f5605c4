//! Steady stretches of two quantities: there a lag between them changes nothing, so they can be compared.

use crate::statistics::mean;

/// What counts as steady.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steadiness {
    /// How long a stretch lasts, in seconds.
    pub span_s: f64,
    /// Within it neither quantity may move by more than this share of its mean,
    pub share: f64,
    /// or by so much, whichever is more.
    pub floor: f64,
}

/// Two quantities while both were steady.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// First and last position in the series, both within.
    pub scans: [usize; 2],
    /// Mean of the first quantity.
    pub read: f64,
    /// Mean of the second.
    pub known: f64,
}

/// The longest steady stretches of `read` and `known` at these times, in the order of time, none overlapping another.
/// Values that are no number end a stretch.
#[must_use]
pub fn stretches(time_s: &[f64], read: &[f64], known: &[f64], wanted: Steadiness) -> Vec<Stretch> {
    let count = time_s.len().min(read.len()).min(known.len());
    let (mut found, mut from) = (Vec::new(), 0);
    while from < count {
        let end = end_of_steady(read, known, from, count, wanted);
        let long = end > from && time_s[end - 1] - time_s[from] >= wanted.span_s;
        if long {
            let of = |values: &[f64]| mean(values[from..end].iter().copied()).0;
            found.push(Stretch { scans: [from, end - 1], read: of(read), known: of(known) });
            from = end;
        } else {
            from += 1;
        }
    }
    found
}

/// Where both stop being steady, if they are at `from`: the position after the last value that belongs to it.
fn end_of_steady(read: &[f64], known: &[f64], from: usize, count: usize, wanted: Steadiness) -> usize {
    let (mut spans, mut end) = ([Span::EMPTY; 2], from);
    while end < count && read[end].is_finite() && known[end].is_finite() {
        let next = [spans[0].with(read[end]), spans[1].with(known[end])];
        if next.iter().any(|span| !span.is_steady(wanted)) {
            break;
        }
        (spans, end) = (next, end + 1);
    }
    end
}

/// Least and greatest value so far.
#[derive(Clone, Copy)]
struct Span {
    least: f64,
    most: f64,
}

impl Span {
    const EMPTY: Self = Self { least: f64::INFINITY, most: f64::NEG_INFINITY };

    const fn with(self, value: f64) -> Self {
        Self { least: self.least.min(value), most: self.most.max(value) }
    }

    fn is_steady(self, wanted: Steadiness) -> bool {
        let middle = 0.5 * (self.least + self.most);
        self.most - self.least <= (wanted.share * middle.abs()).max(wanted.floor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_both_hold_is_a_stretch_and_a_lag_between_them_changes_nothing() {
        let time_s: Vec<f64> = (0..1200).map(|i| 0.01 * f64::from(i)).collect();
        let step = |t: f64| {
            if t < 4.0 {
                10.0
            } else if t < 5.0 {
                10.0 + 20.0 * (t - 4.0)
            } else {
                30.0
            }
        };
        let known: Vec<f64> = time_s.iter().map(|t| step(*t)).collect();
        let read: Vec<f64> = time_s.iter().map(|t| 0.9 * step(t - 0.7)).collect();
        let wanted = Steadiness { span_s: 2.0, share: 0.01, floor: 0.0 };
        let found = stretches(&time_s, &read, &known, wanted);
        assert_eq!(found.len(), 2, "{found:?}");
        for (stretch, force) in found.iter().zip([10.0, 30.0]) {
            assert!(
                (stretch.known / force - 1.0).abs() < 2e-3 && (stretch.read / force - 0.9).abs() < 2e-3,
                "{stretch:?}"
            );
        }
        let mut broken = read.clone();
        broken.iter_mut().step_by(150).for_each(|value| *value = f64::NAN);
        assert!(stretches(&time_s, &broken, &known, wanted).is_empty());
        assert!(stretches(&[], &[], &[], wanted).is_empty());
    }
}
