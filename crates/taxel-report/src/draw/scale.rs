//! From a quantity to a place on paper: one axis of a figure.

use crate::document::Axis;

/// Numbers beyond this size are drawn at it, so that no difference overflows.
const LARGEST: f64 = 1e300;

/// On a logarithmic axis numbers below this are drawn at the edge, like zero.
const SMALLEST: f64 = 1e-300;

/// More labels than this crowd an axis.
const MOST_LABELS: i32 = 10;

/// On a shorter axis than this 2 and 5 have labels, too.
const SHORT_DECADES: f64 = 2.5;

/// On a shorter axis than this all digits have labels.
const HALF_DECADE: f64 = 0.5;

/// What logarithms are off by at most.
const ROUNDING: f64 = 1e-9;

/// What lies so little below zero, as a share of an axis, is noise about zero: the axis begins there all the same.
const NOISE_SHARE: f64 = 0.005;

/// Fewer decades than this get lines at 2, 3, .. 9 as well.
const FEW_DECADES: i32 = 5;

/// One axis with its range and where it lies.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    log: bool,
    /// In the axis' own measure: the quantity, or its decimal logarithm.
    from: f64,
    to: f64,
    from_px: f64,
    to_px: f64,
}

/// Where a value is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// At its own place.
    Here(f64),
    /// At the lower edge: not above 0, on a logarithmic axis.
    LowerEdge(f64),
    /// At the upper edge: not a finite number.
    UpperEdge(f64),
}

impl Place {
    pub fn px(self) -> f64 {
        let (Self::Here(px) | Self::LowerEdge(px) | Self::UpperEdge(px)) = self;
        px
    }
}

/// A line of the grid, with a label if it has room for one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub px: f64,
    /// As SVG: a power of ten has a raised exponent.
    pub label: Option<String>,
}

impl Scale {
    /// Spans all `values`; those that cannot be drawn at their own place have no say, but zero on a logarithmic axis
    /// gets an edge apart from the others.
    pub fn new(axis: &Axis, mut values: Vec<f64>, px: (f64, f64)) -> Self {
        if !axis.log {
            about_zero(&mut values);
        }
        let (from, to) = if axis.log { decades(&values) } else { linear(&values) };
        Self { log: axis.log, from, to, from_px: px.0, to_px: px.1 }
    }

    pub fn place(&self, value: f64) -> Place {
        if !value.is_finite() {
            return Place::UpperEdge(self.to_px);
        }
        if !self.log {
            return Place::Here(self.px(value.clamp(-LARGEST, LARGEST)));
        }
        if value < SMALLEST {
            return Place::LowerEdge(self.from_px);
        }
        Place::Here(self.px(value.min(LARGEST).log10()))
    }

    fn px(&self, measure: f64) -> f64 {
        let share = ((measure - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        self.from_px + share * (self.to_px - self.from_px)
    }

    pub fn ticks(&self) -> Vec<Tick> {
        if self.log { self.decade_ticks() } else { self.linear_ticks() }
    }

    fn decade_ticks(&self) -> Vec<Tick> {
        let (from, to) = (self.from - ROUNDING, self.to + ROUNDING);
        let (first, last) = (from.floor() as i32, to.floor() as i32);
        let step = ((last - first) / MOST_LABELS + 1).max(1);
        let mut ticks = Vec::new();
        for decade in first..=last {
            for k in 1..10 {
                let at = f64::from(decade) + f64::from(k).log10();
                let label = match k {
                    1 if (decade - first) % step == 0 => decade_label(1, decade),
                    2 | 5 if to - from < SHORT_DECADES => decade_label(k, decade),
                    2..10 if to - from < HALF_DECADE => decade_label(k, decade),
                    2..10 if last - first < FEW_DECADES => None,
                    _ => continue,
                };
                if (from..=to).contains(&at) {
                    ticks.push(Tick { px: self.px(at), label });
                }
            }
        }
        ticks
    }

    fn linear_ticks(&self) -> Vec<Tick> {
        let step = nice_step(self.to - self.from);
        let (first, last) = ((self.from / step).round(), (self.to / step).round());
        let places = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        let name = |value: f64| {
            let plain = value == 0.0 || (1e-6..1e7).contains(&value.abs());
            Some(if plain { format!("{value:.places$}") } else { format!("{value:e}") })
        };
        let count = (last - first).clamp(0.0, 40.0) as i32;
        let values = (0..=count).map(|k| (first + f64::from(k)) * step);
        values.map(|value| Tick { px: self.px(value), label: name(value) }).collect()
    }
}

/// `k` times ten to the power of `decade`.
fn decade_label(k: i32, decade: i32) -> Option<String> {
    match decade {
        0..=4 => Some((k * 10_i32.pow(decade as u32)).to_string()),
        -3..0 => Some(format!("{:.*}", -decade as usize, f64::from(k) * 10.0_f64.powi(decade))),
        _ => (k == 1).then(|| format!(r#"10<tspan dy="-5" font-size="9.5">{decade}</tspan>"#)),
    }
}

/// Decades around all values above 0: whole ones, or from and to 1, 2 or 5 where it is little more than one.
fn decades(values: &[f64]) -> (f64, f64) {
    let drawn = values.iter().filter(|v| v.is_finite() && **v >= SMALLEST).map(|v| v.min(LARGEST).log10());
    let (low, high) = drawn.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let edge = values.iter().any(|v| *v < SMALLEST);
    if edge || high - low > SHORT_DECADES / 2.0 {
        let low = low.floor() - if edge { 1.0 } else { 0.0 };
        return (low, high.ceil().max(low + 1.0));
    }
    let ends = |decade: f64| [1.0_f64, 2.0, 5.0].map(|k| decade + k.log10());
    let below = ends(low.floor()).into_iter().rfind(|end| *end <= low + ROUNDING);
    let above = ends(high.floor()).into_iter().find(|end| *end >= high - ROUNDING);
    let (low, high) = (below.unwrap_or(low.floor()), above.unwrap_or(high.floor() + 1.0));
    // A single value is in the middle of a decade.
    if high - low < ROUNDING { (low - 0.5, high + 0.5) } else { (low, high) }
}

/// Takes out what is noise about zero.
fn about_zero(values: &mut Vec<f64>) {
    let high = values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    values.retain(|v| *v >= 0.0 || *v < -NOISE_SHARE * high);
}

/// Whole steps around all finite values, zero among them where it is near.
fn linear(values: &[f64]) -> (f64, f64) {
    let drawn = values.iter().filter(|v| v.is_finite()).map(|v| v.clamp(-LARGEST, LARGEST));
    let (mut low, mut high) = drawn.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    if low > 0.0 && low < 0.5 * high {
        low = 0.0;
    }
    if high - low <= low.abs().max(high.abs()) * 1e-12 || high - low < SMALLEST {
        let room = low.abs().max(1.0) * 0.5;
        (low, high) = (low - room, high + room);
    }
    let step = nice_step(high - low);
    ((low / step).floor() * step, (high / step).ceil() * step)
}

/// 1, 2 or 5 times a power of ten, four to ten of them in `span`.
fn nice_step(span: f64) -> f64 {
    let rough = span / 8.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= rough);
    factor.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(log: bool, values: &[f64]) -> Scale {
        Scale::new(&Axis { label: String::new(), log }, values.to_vec(), (100.0, 200.0))
    }

    fn labels(axis: &Scale) -> Vec<String> {
        axis.ticks().into_iter().filter_map(|tick| tick.label).collect()
    }

    #[test]
    fn decades_span_the_values_and_zero_has_its_own_edge() {
        let axis = scale(true, &[3.0, 400.0]);
        assert_eq!(axis.place(1.0), Place::Here(100.0));
        assert_eq!(axis.place(1000.0), Place::Here(200.0));
        let axis = scale(true, &[3.0, 400.0, 0.0]);
        assert_eq!(axis.place(0.1), Place::Here(100.0));
        assert_eq!(axis.place(-5.0), Place::LowerEdge(100.0));
        assert_eq!(axis.place(f64::NAN), Place::UpperEdge(200.0));
    }

    #[test]
    fn labels_are_few_and_round() {
        assert_eq!(labels(&scale(true, &[0.02, 30.0])), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(labels(&scale(false, &[0.0, 0.9])).len(), 6);
        let wide = labels(&scale(true, &[1e-300, 1e300]));
        assert!(wide.len() <= 11 && wide[0].starts_with("10<tspan"), "{wide:?}");
    }

    #[test]
    fn a_short_axis_ends_at_2_or_5() {
        let axis = scale(true, &[2.5, 7.0]);
        assert_eq!((axis.place(2.0), axis.place(10.0)), (Place::Here(100.0), Place::Here(200.0)));
        assert_eq!(labels(&axis), ["2", "5", "10"]);
        assert!((100.0..200.0).contains(&scale(true, &[1.0]).place(1.0).px()));
    }

    #[test]
    fn any_values_give_finite_places() {
        let hostile = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e-300, 5e-324, f64::MAX, f64::MIN, 1.0];
        for log in [false, true] {
            for first in hostile {
                for second in hostile {
                    let axis = scale(log, &[first, second]);
                    for value in hostile {
                        assert!((100.0..=200.0).contains(&axis.place(value).px()), "{log} {first} {second} {value}");
                    }
                    assert!(axis.ticks().iter().all(|tick| (100.0..=200.0).contains(&tick.px)));
                    assert!(!axis.ticks().is_empty());
                }
            }
        }
    }
}
