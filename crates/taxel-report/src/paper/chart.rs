//! A figure of the paper as one self-contained SVG: title, axes with units, samples as dots, curves, bars, and levels
//! of the horizontal axis that mean something.

use crate::document::Axis;
use crate::markup::escape;
use crate::plot::scale::{Label, Scale};
use std::fmt::{Result, Write};

const WIDTH_PX: f64 = 760.0;
const LEFT_PX: f64 = 76.0;
const RIGHT_PX: f64 = 740.0;
const TOP_PX: f64 = 56.0;
const BOTTOM_PX: f64 = 436.0;
const FIRST_ROW_PX: f64 = BOTTOM_PX + 74.0;
const ROW_PX: f64 = 22.0;
const LETTER_PX: f64 = 7.4;
const SWATCH_PX: f64 = 34.0;
const INK: &str = "#222222";
const FAINT: &str = "#555555";
const LEVEL_INK: &str = "#b00020";

/// Marks of several series stand side by side, so far apart, or they would hide each other.
const ASIDE_PX: f64 = 9.0;

/// What lies so little below zero, as a share of an axis, is noise about zero: the axis begins there all the same.
const NOISE_SHARE: f64 = 0.005;

/// Told apart also without colour: dark and light alternate.
const COLOURS: [&str; 5] = ["#1f5fa8", "#d98200", "#00795f", "#7b3f9e", "#c0392b"];

/// One figure.
#[derive(Clone, Debug, Default)]
pub(super) struct Chart {
    /// Short, stable, lower case: the name of its file.
    pub id: &'static str,
    pub title: String,
    /// How to read it, below it on the page.
    pub caption: String,
    /// Quantity and unit.
    pub x: &'static str,
    pub y: &'static str,
    pub series: Vec<Series>,
    /// Places on the horizontal axis with what they mean.
    pub levels: Vec<(f64, String)>,
}

/// How points are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Look {
    /// Each for itself.
    Dots,
    /// Each for itself, large.
    Marks,
    /// Joined.
    Line,
    /// Joined by a dashed line.
    Dashed,
    /// From zero up, this wide in the unit of the horizontal axis.
    Bars(f64),
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub(super) struct Series {
    /// As the legend shows it.
    pub name: String,
    pub look: Look,
    /// In the order in which they are joined; what is not finite is left out.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    pub fn new(name: impl Into<String>, look: Look, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let points = points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
        Self { name: name.into(), look, points }
    }
}

/// Draws `chart`.
pub(super) fn svg(chart: &Chart) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = Drawing::new(chart).draw(&mut out);
    out
}

struct Drawing<'a> {
    chart: &'a Chart,
    x: Scale,
    y: Scale,
}

impl<'a> Drawing<'a> {
    fn new(chart: &'a Chart) -> Self {
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = (chart.levels.iter().map(|level| level.0).collect(), Vec::new());
        for series in &chart.series {
            let half = if let Look::Bars(width) = series.look { 0.5 * width } else { 0.0 };
            x.extend(series.points.iter().flat_map(|point| [point.0 - half, point.0 + half]));
            y.extend(series.points.iter().map(|point| point.1));
            y.extend((half > 0.0).then_some(0.0));
        }
        about_zero(&mut x);
        about_zero(&mut y);
        let axis = |label: &str| Axis { label: label.to_owned(), log: false };
        let (x, y) =
            (Scale::new(&axis(chart.x), &x, (LEFT_PX, RIGHT_PX)), Scale::new(&axis(chart.y), &y, (BOTTOM_PX, TOP_PX)));
        Self { chart, x, y }
    }

    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.place(x).px(), self.y.place(y).px())
    }

    fn draw(&self, out: &mut String) -> Result {
        let mut body = String::new();
        self.axes(&mut body)?;
        let marked = self.chart.series.iter().filter(|series| series.look == Look::Marks).count();
        let mut aside_px = -0.5 * ASIDE_PX * marked.saturating_sub(1) as f64;
        for (series, colour) in self.coloured() {
            if series.look == Look::Marks {
                self.series(&mut body, series, colour, aside_px)?;
                aside_px += ASIDE_PX;
            } else {
                self.series(&mut body, series, colour, 0.0)?;
            }
        }
        self.levels(&mut body)?;
        let height = self.legend(&mut body)?;
        let title = escape(&self.chart.title);
        writeln!(
            out,
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH_PX} {height}" role="img" aria-label="{title}" font-family="Helvetica, Arial, sans-serif" font-size="14" fill="{INK}">"#
        )?;
        writeln!(out, r##"<rect width="{WIDTH_PX}" height="{height}" fill="#ffffff"/>"##)?;
        writeln!(out, r#"<text x="{LEFT_PX}" y="32" font-size="18" font-weight="bold">{title}</text>"#)?;
        out.push_str(&body);
        writeln!(out, "</svg>")
    }

    fn coloured(&self) -> impl Iterator<Item = (&Series, &'static str)> {
        self.chart.series.iter().zip(COLOURS.into_iter().cycle())
    }

    fn axes(&self, out: &mut String) -> Result {
        for tick in self.x.ticks() {
            let (px, y) = (tick.px, BOTTOM_PX + 20.0);
            writeln!(out, r##"<path d="M{px:.1} {TOP_PX}V{BOTTOM_PX}" stroke="#e2e2e2"/>"##)?;
            writeln!(out, r#"<text x="{px:.1}" y="{y}" text-anchor="middle">{}</text>"#, words(&tick.label))?;
        }
        for tick in self.y.ticks() {
            let (px, x) = (tick.px, LEFT_PX - 8.0);
            writeln!(out, r##"<path d="M{LEFT_PX} {px:.1}H{RIGHT_PX}" stroke="#e2e2e2"/>"##)?;
            writeln!(out, r#"<text x="{x}" y="{:.1}" text-anchor="end">{}</text>"#, px + 5.0, words(&tick.label))?;
        }
        writeln!(out, r#"<path d="M{LEFT_PX} {TOP_PX}V{BOTTOM_PX}H{RIGHT_PX}" fill="none" stroke="{FAINT}"/>"#)?;
        let (x, y) = ((LEFT_PX + RIGHT_PX) / 2.0, BOTTOM_PX + 46.0);
        let label = escape(self.chart.x);
        writeln!(out, r#"<text x="{x:.1}" y="{y}" font-size="15" text-anchor="middle">{label}</text>"#)?;
        let (x, y) = (22.0, (TOP_PX + BOTTOM_PX) / 2.0);
        let (label, turned) = (escape(self.chart.y), format!(r#"transform="rotate(-90 {x} {y})""#));
        writeln!(out, r#"<text x="{x}" y="{y}" font-size="15" text-anchor="middle" {turned}>{label}</text>"#)
    }

    fn series(&self, out: &mut String, series: &Series, colour: &str, aside_px: f64) -> Result {
        if let Look::Bars(width) = series.look {
            let zero = self.y.place(0.0).px();
            for &(x, y) in series.points.iter().filter(|point| point.1 > 0.0) {
                let ((left, top), right) = (self.at((x - 0.5 * width, y)), self.x.place(x + 0.5 * width).px());
                let (across, up) = (right - left, zero - top);
                writeln!(
                    out,
                    r##"<rect x="{left:.1}" y="{top:.1}" width="{across:.1}" height="{up:.1}" fill="{colour}" stroke="#ffffff"/>"##
                )?;
            }
            return Ok(());
        }
        if series.points.is_empty() {
            return Ok(());
        }
        // One path for all points, or thousands of samples make a file of megabytes: dots are strokes of no length.
        let joined = matches!(series.look, Look::Line | Look::Dashed);
        let mut path = String::new();
        for (k, point) in series.points.iter().enumerate() {
            let (x, y) = self.at(*point);
            let x = x + aside_px;
            match (joined, k) {
                (true, 0) => write!(path, "M{x:.1} {y:.1}")?,
                (true, _) => write!(path, "L{x:.1} {y:.1}")?,
                (false, _) => write!(path, "M{x:.1} {y:.1}h0")?,
            }
        }
        let look = stroke(series.look);
        writeln!(out, r#"<path d="{path}" fill="none" stroke="{colour}" {look}/>"#)
    }

    fn levels(&self, out: &mut String) -> Result {
        for (row, (x, label)) in self.chart.levels.iter().enumerate() {
            let (px, y) = (self.x.place(*x).px(), TOP_PX + 18.0 + ROW_PX * row as f64);
            let look = format!(r#"stroke="{LEVEL_INK}" stroke-width="1.6" stroke-dasharray="6 4""#);
            writeln!(out, r#"<path d="M{px:.1} {TOP_PX}V{BOTTOM_PX}" {look}/>"#)?;
            let (x, anchor) = if px > (LEFT_PX + RIGHT_PX) / 2.0 { (px - 8.0, "end") } else { (px + 8.0, "start") };
            let halo = r##"stroke="#ffffff" stroke-width="3" paint-order="stroke""##;
            let label = escape(label);
            writeln!(
                out,
                r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" fill="{LEVEL_INK}" {halo}>{label}</text>"#
            )?;
        }
        Ok(())
    }

    /// The names of all series below the plot; returns the height of the picture.
    fn legend(&self, out: &mut String) -> std::result::Result<f64, std::fmt::Error> {
        let (mut x, mut y) = (LEFT_PX, FIRST_ROW_PX);
        for (series, colour) in self.coloured() {
            let width = SWATCH_PX + 28.0 + LETTER_PX * series.name.chars().count() as f64;
            if x > LEFT_PX && x + width > WIDTH_PX {
                (x, y) = (LEFT_PX, y + ROW_PX);
            }
            let (end, middle, text) = (x + SWATCH_PX, x + 0.5 * SWATCH_PX, x + SWATCH_PX + 8.0);
            let look = stroke(series.look);
            match series.look {
                Look::Bars(_) => {
                    let top = y - 7.0;
                    writeln!(out, r#"<rect x="{x:.1}" y="{top:.1}" width="24" height="14" fill="{colour}"/>"#)?;
                }
                Look::Line | Look::Dashed => {
                    writeln!(out, r#"<path d="M{x:.1} {y:.1}H{end:.1}" stroke="{colour}" {look}/>"#)?;
                }
                Look::Dots | Look::Marks => {
                    let wide = r#"stroke-width="6" stroke-linecap="round""#;
                    writeln!(out, r#"<path d="M{middle:.1} {y:.1}h0" stroke="{colour}" {wide}/>"#)?;
                }
            }
            writeln!(out, r#"<text x="{text:.1}" y="{:.1}">{}</text>"#, y + 5.0, escape(&series.name))?;
            x += width;
        }
        Ok(y + 20.0)
    }
}

/// Takes out what is noise about zero.
fn about_zero(values: &mut Vec<f64>) {
    let high = values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    values.retain(|v| *v >= 0.0 || *v < -NOISE_SHARE * high);
}

fn stroke(look: Look) -> &'static str {
    match look {
        Look::Dots => r#"stroke-width="2.6" stroke-linecap="round" stroke-opacity="0.55""#,
        Look::Marks => r#"stroke-width="6" stroke-linecap="round" stroke-opacity="0.8""#,
        Look::Line => r#"stroke-width="2.4" stroke-linejoin="round""#,
        Look::Dashed | Look::Bars(_) => r#"stroke-width="1.4" stroke-dasharray="6 4""#,
    }
}

fn words(label: &Label) -> String {
    match label {
        Label::None => String::new(),
        Label::Plain(words) => escape(words),
        Label::Power(power) => format!("1e{power}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_series_and_level_is_drawn_and_named_whatever_its_numbers() {
        let hostile = [f64::NAN, f64::INFINITY, -1e300, 0.0, 1e300, 5.0];
        let points = || hostile.iter().flat_map(|x| hostile.iter().map(move |y| (*x, *y)));
        let looks = [Look::Dots, Look::Marks, Look::Line, Look::Dashed, Look::Bars(0.5)];
        let chart = Chart {
            title: "a < b".to_owned(),
            series: looks.iter().map(|look| Series::new(format!("{look:?}"), *look, points())).collect(),
            levels: vec![(3.0, "limit & co".to_owned())],
            ..Chart::default()
        };
        let picture = svg(&chart);
        assert!(picture.contains("a &lt; b") && picture.contains("limit &amp; co"), "{picture}");
        assert!(!picture.contains("NaN") && !picture.contains("inf"), "{picture}");
        for look in looks {
            assert!(picture.contains(&format!(">{look:?}<")), "{look:?}");
        }
        assert!(svg(&Chart::default()).ends_with("</svg>\n"));
    }
}
