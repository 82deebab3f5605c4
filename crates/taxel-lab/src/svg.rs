//! A figure as one self-contained SVG, for a screen and for paper. The legend is below the plot.

use maud::{Markup, html};

use crate::document::{Axis, Figure, Line, Look};

const WIDTH_PX: f64 = 760.0;
const LEFT_PX: f64 = 80.0;
const RIGHT_PX: f64 = 734.0;
const TOP_PX: f64 = 50.0;
const BOTTOM_PX: f64 = 440.0;
const LEGEND_PX: f64 = BOTTOM_PX + 68.0;
const ROW_PX: f64 = 20.0;

/// Dark and bright alternate at first, so that neighbours can be told apart in print.
const COLOURS: [&str; 10] =
    ["#1f5fa8", "#d98200", "#00795f", "#7b3f9e", "#c0392b", "#6b4a1f", "#666666", "#c2488f", "#2a9fc4", "#7f8c1a"];
const DASHES: [&str; 4] = ["none", "7 3", "2 3", "9 3 2 3"];

/// A taxel on a map.
const DISC_PX: &str = "13";

/// More labels than this crowd an axis.
const LABELS_MAX: i32 = 10;

/// One axis with its range and where it lies.
struct Scale {
    log: bool,
    /// The quantity, or its decimal logarithm.
    from: f64,
    to: f64,
    from_px: f64,
    to_px: f64,
}

impl Scale {
    /// Spans all values that have a place, in whole decades or whole steps.
    fn new(axis: Axis, values: impl Iterator<Item = f64>, [from_px, to_px]: [f64; 2]) -> Self {
        let drawn = values.filter_map(|value| measure(axis.log, value));
        let (low, high) = drawn.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let (from, to) = if axis.log {
            (low.floor(), high.ceil().max(low.floor() + 1.0))
        } else {
            // Zero is among the steps where it is near.
            let low = if low > 0.0 && low < 0.5 * high { 0.0 } else { low };
            let high = if high > low { high } else { low + low.abs().max(1.0) };
            let step = nice_step(high - low);
            ((low / step).floor() * step, (high / step).ceil() * step)
        };
        Self { log: axis.log, from, to, from_px, to_px }
    }

    fn per_px(&self) -> f64 {
        (self.to - self.from) / (self.to_px - self.from_px).abs()
    }

    /// Where a value is drawn; `None` if it has no place.
    fn px(&self, value: f64) -> Option<f64> {
        let share = (measure(self.log, value)? - self.from) / (self.to - self.from);
        Some(tenths(self.from_px + share.clamp(0.0, 1.0) * (self.to_px - self.from_px)))
    }

    /// Lines of the grid with their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        let step = if self.log {
            f64::from(((self.to - self.from) as i32 / LABELS_MAX).max(0) + 1)
        } else {
            nice_step(self.to - self.from)
        };
        let first = (self.from / step - 1e-6).ceil();
        let count = (self.to / step + 1e-6 - first).clamp(0.0, 40.0) as i32; // rounded down
        let places = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        let tick = |k: i32| {
            let at = (first + f64::from(k)) * step;
            let value = if self.log { 10.0_f64.powf(at) } else { at };
            let label = match () {
                () if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) => format!("{value:.0e}"),
                () if self.log => format!("{value}"),
                () => format!("{value:.places$}"),
            };
            Some((self.px(value)?, label))
        };
        (0..=count).filter_map(tick).collect()
    }
}

/// A value in an axis' own measure, if it has one.
fn measure(log: bool, value: f64) -> Option<f64> {
    let measure = if log { value.log10() } else { value };
    (measure.abs() < 1e300).then_some(measure)
}

/// 1, 2 or 5 times a power of ten, four to ten of them in `span`.
pub(crate) fn nice_step(span: f64) -> f64 {
    let rough = span / 8.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= rough).unwrap_or(10.0) * power
}

fn tenths(px: f64) -> f64 {
    (10.0 * px).round() / 10.0
}

/// Draws `figure`. Points that have no place on its axes are left out.
#[must_use]
pub fn svg(figure: &Figure) -> String {
    let points = || figure.lines.iter().flat_map(|line| line.points.iter().map(move |point| (line.look, *point)));
    let widths = points().flat_map(|(look, (x, _))| {
        let half = if let Look::Bars(width) = look { 0.5 * width } else { 0.0 };
        [x - half, x + half]
    });
    let mut x = Scale::new(figure.x, widths.chain(figure.levels.iter().map(|level| level.0)), [LEFT_PX, RIGHT_PX]);
    let floor = figure.lines.iter().any(|line| matches!(line.look, Look::Bars(_))).then_some(0.0);
    let heights = points().map(|(_, (_, y))| y).chain(floor);
    let mut y = Scale::new(figure.y, heights, [BOTTOM_PX, TOP_PX]);
    if figure.lines.iter().any(|line| matches!(line.look, Look::Discs(_))) {
        let per_px = x.per_px().max(y.per_px());
        [&mut x, &mut y]
            .into_iter()
            .for_each(|scale| scale.to = scale.from + per_px * (scale.to_px - scale.from_px).abs());
    }
    let rows = figure.lines.len().div_ceil(2);
    let height = LEGEND_PX + rows as f64 * ROW_PX + 4.0;
    let lines = || figure.lines.iter().enumerate();
    let picture = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (WIDTH_PX) " " (height) } role="img" aria-label=(figure.title)
            font-family="Helvetica, Arial, sans-serif" font-size="12.5" fill="black" {
            rect width=(WIDTH_PX) height=(height) fill="white" {}
            text x=(LEFT_PX) y="28" font-size="16" font-weight="bold" { (figure.title) }
            (axes(figure, &x, &y))
            @for (at, line) in lines() { (draw(line, at, &x, &y)) }
            @for (at, label) in &figure.levels { (mark(x.px(*at), label)) }
            @for (at, line) in lines() { (legend(line, at, rows)) }
        }
    };
    picture.into_string() + "\n"
}

fn axes(figure: &Figure, x: &Scale, y: &Scale) -> Markup {
    let (middle, centre) = ((LEFT_PX + RIGHT_PX) / 2.0, (TOP_PX + BOTTOM_PX) / 2.0);
    html! {
        @for (px, label) in x.ticks() {
            path d={ "M" (px) " " (TOP_PX) "V" (BOTTOM_PX) } stroke="#dddddd" stroke-width="0.8" {}
            text x=(px) y=(BOTTOM_PX + 18.0) text-anchor="middle" { (label) }
        }
        @for (px, label) in y.ticks() {
            path d={ "M" (LEFT_PX) " " (px) "H" (RIGHT_PX) } stroke="#dddddd" stroke-width="0.8" {}
            text x=(LEFT_PX - 8.0) y=(px + 4.5) text-anchor="end" { (label) }
        }
        path d={ "M" (LEFT_PX) " " (TOP_PX) "V" (BOTTOM_PX) "H" (RIGHT_PX) } fill="none" stroke="#555555" {}
        text x=(middle) y=(BOTTOM_PX + 40.0) font-size="14" text-anchor="middle" { (figure.x.label) }
        text x="22" y=(centre) font-size="14" text-anchor="middle" transform={ "rotate(-90 22 " (centre) ")" } {
            (figure.y.label)
        }
    }
}

/// A place on the horizontal axis that means something, with its name on the side with more room.
fn mark(px: Option<f64>, label: &str) -> Markup {
    let Some(px) = px else { return Markup::default() };
    let (x, anchor) = if px < (LEFT_PX + RIGHT_PX) / 2.0 { (px + 6.0, "start") } else { (px - 6.0, "end") };
    html! {
        path d={ "M" (px) " " (TOP_PX) "V" (BOTTOM_PX) } stroke="#8a5a00" stroke-width="1.3" stroke-dasharray="6 4" {}
        text x=(x) y=(TOP_PX + 16.0) text-anchor=(anchor) fill="#8a5a00" stroke="white" stroke-width="3" paint-order="stroke" {
            (label)
        }
    }
}

fn colour(at: usize) -> &'static str {
    COLOURS[at % COLOURS.len()]
}

/// A path in the look of a line: dots are strokes of no length.
fn stroke(path: &str, line: &Line, at: usize) -> Markup {
    let (width, dash) = match line.look {
        Look::Signs => ("1.4", DASHES[at % DASHES.len()]),
        Look::Ours => ("2.6", DASHES[at % DASHES.len()]),
        Look::Plain => ("2.4", "none"),
        Look::Dashed => ("1.4", "6 4"),
        Look::Dots => ("3", "none"),
        Look::Bars(_) => ("12", "none"),
        Look::Discs(_) => (DISC_PX, "none"),
        Look::Crosses => ("2", "none"),
    };
    let colour = match line.look {
        Look::Discs(colour) => colour,
        Look::Crosses => "#b00020",
        _ => colour(at),
    };
    html! {
        path d=(path) stroke=(colour) stroke-width=(width) stroke-dasharray=(dash) stroke-linecap="round" fill="none" {}
    }
}

fn draw(line: &Line, at: usize, x: &Scale, y: &Scale) -> Markup {
    if let Look::Bars(width) = line.look {
        return html! { @for (middle, top) in line.points.iter().filter(|(_, top)| *top > 0.0) {
            @let ends = [x.px(middle - 0.5 * width), x.px(middle + 0.5 * width), y.px(*top), y.px(0.0)];
            @if let [Some(left), Some(right), Some(top), Some(zero)] = ends {
                rect x=(left) y=(top) width=(tenths(right - left)) height=(tenths(zero - top)) fill=(colour(at)) stroke="white" {}
            }
        } };
    }
    let place = |(at, value): &(f64, f64)| x.px(*at).zip(y.px(*value));
    // In one path, or thousands of samples make a file of megabytes. Where a point has no place the line is broken.
    let (mut path, mut pen_down) = (String::new(), false);
    for at in line.points.iter().map(place) {
        if let Some((x, y)) = at {
            let end = sign(line.look);
            let command = if pen_down && end.is_empty() { "L" } else { "M" };
            path += &format!("{command}{x} {y}{end}");
        }
        pen_down = at.is_some();
    }
    let has_signs = matches!(line.look, Look::Signs | Look::Ours);
    html! {
        @for (x, y) in line.points.iter().filter_map(place).filter(|_| has_signs) {
            circle cx=(x) cy=(y) r="3" fill=(colour(at)) {}
        }
        (stroke(&path, line, at))
    }
}

/// What is drawn at each point that is not joined to the next.
const fn sign(look: Look) -> &'static str {
    match look {
        Look::Dots | Look::Discs(_) => "h0",
        Look::Crosses => "m-4 -4l8 8m0 -8l-8 8",
        _ => "",
    }
}

fn legend(line: &Line, at: usize, rows: usize) -> Markup {
    let (column, row) = (at / rows.max(1), at % rows.max(1));
    let (x, y) = (LEFT_PX + column as f64 * (WIDTH_PX - LEFT_PX) / 2.0, LEGEND_PX + row as f64 * ROW_PX);
    let sign = sign(line.look);
    let path = if sign.is_empty() { format!("M{x} {y}h30") } else { format!("M{} {y}{sign}", x + 15.0) };
    html! {
        (stroke(&path, line, at))
        text x=(x + 38.0) y=(y + 4.5) { (line.name) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_values_make_a_picture_of_finite_places() {
        let hostile = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e-300, 5e-324, f64::MAX, f64::MIN, 1.0];
        for (log, look) in [(false, Look::Signs), (true, Look::Plain), (false, Look::Bars(1.0)), (true, Look::Dots)] {
            for first in hostile {
                let points = hostile.map(|second| (first, second)).to_vec();
                let axis = Axis { label: "a < b", log };
                let line = Line { name: "<name> \"x\"".to_owned(), look, points };
                let figure = Figure { x: axis, y: axis, lines: vec![line], ..Figure::default() };
                let picture = svg(&figure);
                assert!(
                    !picture.contains("NaN") && !picture.contains("inf\"") && !picture.contains("<name>"),
                    "{picture}"
                );
                assert!(picture.ends_with("</svg>\n"));
            }
        }
    }
}
