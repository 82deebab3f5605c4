//! A figure as one self-contained SVG, fit for a page of paper.
//!
//! Lines differ in colour, dash and marker, so that they can be told apart in print; ours are stronger. The legend is
//! below the plot and the names of the bands right of it, so that neither hides a point.

mod legend;
pub(crate) mod scale;
mod style;

use crate::document::{Figure, Line, Point};
use crate::markup::escape;
use scale::{Label, Place, Scale};
use std::fmt::{Result, Write};
use style::{BOTTOM_PX, CHARACTER, FAINT, INK, LEFT_PX, RIGHT_OF_BANDS_PX, RIGHT_PX, Style, TOP_PX, WIDTH_PX, styles};

const MARK_SIZE_PX: f64 = 10.5;

/// A rectangle that text must keep clear of.
#[derive(Clone, Copy)]
struct Room {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

impl Room {
    fn meets(&self, other: &Self) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }
}

/// Draws `figure`. Values that have no place are drawn at the edge, and a note says so; nothing is left out silently.
#[must_use]
pub fn svg(figure: &Figure) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = Drawing::new(figure).draw(&mut out);
    out
}

struct Drawing<'a> {
    figure: &'a Figure,
    styles: Vec<Style>,
    x: Scale,
    y: Scale,
    right_px: f64,
}

impl<'a> Drawing<'a> {
    fn new(figure: &'a Figure) -> Self {
        let points = || figure.lines.iter().flat_map(|line| &line.points);
        let spreads = points().filter_map(|point| point.x_spread).flat_map(|(low, high)| [low, high]);
        let x: Vec<f64> = points().map(|point| point.x).chain(spreads).collect();
        let y: Vec<f64> = points().map(|point| point.y).chain(figure.bands.iter().map(|band| band.y)).collect();
        let right_px = if figure.bands.is_empty() { RIGHT_PX } else { RIGHT_OF_BANDS_PX };
        Self {
            figure,
            styles: styles(&figure.lines),
            x: Scale::new(&figure.x, &x, (LEFT_PX, right_px)),
            y: Scale::new(&figure.y, &y, (BOTTOM_PX, TOP_PX)),
            right_px,
        }
    }

    fn draw(&self, out: &mut String) -> Result {
        let mut body = String::new();
        self.axes(&mut body)?;
        legend::bands(&mut body, &self.figure.bands, &self.y, self.right_px)?;
        for (line, style) in self.figure.lines.iter().zip(&self.styles) {
            self.line(&mut body, line, *style)?;
        }
        let left_out = self.marks(&mut body)?;
        let names: Vec<(&str, Style)> =
            self.figure.lines.iter().map(|line| line.name.as_str()).zip(self.styles.iter().copied()).collect();
        let height = legend::below(&mut body, &names, &self.notes(left_out))?;
        let label = escape(&self.figure.caption);
        writeln!(
            out,
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH_PX} {height}" role="img" aria-label="{label}" font-family="Helvetica, Arial, sans-serif" font-size="12.5" fill="{INK}">"#
        )?;
        writeln!(out, r##"<rect width="{WIDTH_PX}" height="{height}" fill="#ffffff"/>"##)?;
        out.push_str(&body);
        writeln!(out, "</svg>")
    }

    fn axes(&self, out: &mut String) -> Result {
        let right = self.right_px;
        for tick in self.x.ticks() {
            let (px, stroke) = (tick.px, grid(&tick.label));
            writeln!(out, r#"<path d="M{px:.1} {TOP_PX}V{BOTTOM_PX}" stroke="{stroke}" stroke-width="0.8"/>"#)?;
            text(out, px, BOTTOM_PX + 18.0, "middle", &tick.label)?;
        }
        for tick in self.y.ticks() {
            let (px, stroke) = (tick.px, grid(&tick.label));
            writeln!(out, r#"<path d="M{LEFT_PX} {px:.1}H{right}" stroke="{stroke}" stroke-width="0.8"/>"#)?;
            text(out, LEFT_PX - 8.0, px + 4.5, "end", &tick.label)?;
        }
        writeln!(out, r#"<path d="M{LEFT_PX} {TOP_PX}V{BOTTOM_PX}H{right}" fill="none" stroke="{FAINT}"/>"#)?;
        let (x, y) = ((LEFT_PX + right) / 2.0, BOTTOM_PX + 40.0);
        let label = escape(&self.figure.x.label);
        writeln!(out, r#"<text x="{x:.1}" y="{y}" font-size="14" text-anchor="middle">{label}</text>"#)?;
        let (x, y) = (22.0, (TOP_PX + BOTTOM_PX) / 2.0);
        let (label, turned) = (escape(&self.figure.y.label), format!(r#"transform="rotate(-90 {x} {y})""#));
        writeln!(out, r#"<text x="{x}" y="{y}" font-size="14" text-anchor="middle" {turned}>{label}</text>"#)
    }

    /// Where a point is drawn; `None` if it has no place on the horizontal axis.
    fn place(&self, point: &Point) -> Option<(f64, Place)> {
        point.x.is_finite().then(|| (self.x.place(point.x).px(), self.y.place(point.y)))
    }

    fn line(&self, out: &mut String, line: &Line, style: Style) -> Result {
        let Style { colour, dash, width_px, shape } = style;
        let mut path = String::new();
        let mut pen_down = false;
        for point in &line.points {
            // A method that failed has no value to go to: its line is broken there.
            let Some((x, y)) = self.place(point).filter(|(_, y)| !matches!(y, Place::UpperEdge(_))) else {
                pen_down = false;
                continue;
            };
            let command = if pen_down { 'L' } else { 'M' };
            write!(path, "{command}{x:.1} {:.1}", y.px())?;
            pen_down = true;
        }
        if !path.is_empty() {
            let look = format!(r#"stroke="{colour}" stroke-width="{width_px}" stroke-dasharray="{dash}""#);
            writeln!(out, r#"<path d="{path}" fill="none" stroke-linejoin="round" {look}/>"#)?;
        }
        for point in &line.points {
            let Some((x, place)) = self.place(point) else { continue };
            if let Some((low, high)) = point.x_spread.filter(|(low, high)| low.is_finite() && high.is_finite()) {
                let (low, high, y) = (self.x.place(low).px(), self.x.place(high).px(), place.px());
                let look = format!(r#"stroke="{colour}" stroke-width="1" stroke-opacity="0.6""#);
                writeln!(out, r#"<path d="M{low:.1} {y:.1}H{high:.1}" {look}/>"#)?;
            }
            match place {
                Place::Here(y) => legend::marker(out, shape, (x, y), colour, colour)?,
                Place::LowerEdge(y) => legend::marker(out, shape, (x, y), "#ffffff", colour)?,
                Place::UpperEdge(y) => legend::cross(out, (x, y), colour)?,
            }
        }
        Ok(())
    }

    /// Writes the points' marks where they hide nothing; returns how many found no such place.
    fn marks(&self, out: &mut String) -> std::result::Result<usize, std::fmt::Error> {
        let mut taken: Vec<Room> = Vec::new();
        let mut wanted = Vec::new();
        for (line, style) in self.figure.lines.iter().zip(&self.styles) {
            for (k, point) in line.points.iter().enumerate() {
                let Some((x, y)) = self.place(point) else { continue };
                let y = y.px();
                taken.push(Room { left: x - 3.5, top: y - 3.5, right: x + 3.5, bottom: y + 3.5 });
                if !point.mark.is_empty() {
                    let end = k == 0 || k + 1 == line.points.len();
                    wanted.push((!end, (x, y), point.mark.as_str(), style.colour));
                }
            }
        }
        // The ends of all lines first: from them the rest can be counted.
        wanted.sort_by_key(|(later, ..)| *later);
        let mut left_out = 0;
        for (_, at, mark, colour) in wanted {
            let Some(room) = self.room_for(mark, at, &taken) else {
                left_out += 1;
                continue;
            };
            taken.push(room);
            let (x, y) = ((room.left + room.right) / 2.0, room.bottom - 1.5);
            let halo = r##"stroke="#ffffff" stroke-width="2.4" paint-order="stroke""##;
            let look = format!(r#"font-size="{MARK_SIZE_PX}" text-anchor="middle" fill="{colour}" {halo}"#);
            writeln!(out, r#"<text x="{x:.1}" y="{y:.1}" {look}>{}</text>"#, escape(mark))?;
        }
        Ok(left_out)
    }

    /// A place for `mark` around the point at `(x, y)` within the plot that meets nothing of `taken`.
    fn room_for(&self, mark: &str, (x, y): (f64, f64), taken: &[Room]) -> Option<Room> {
        let (half, height) = (mark.chars().count() as f64 * MARK_SIZE_PX * CHARACTER / 2.0 + 0.5, MARK_SIZE_PX);
        let aside = half + 5.0;
        let above = height / 2.0 + 5.0;
        let directions = [(0.0, -above), (aside, 0.0), (0.0, above), (-aside, 0.0)];
        let corners = [(aside, -above), (-aside, -above), (aside, above), (-aside, above)];
        let around = directions.into_iter().chain(corners.map(|(dx, dy)| (0.8 * dx, 0.8 * dy)));
        around
            .map(|(dx, dy)| Room {
                left: x + dx - half,
                top: y + dy - height / 2.0,
                right: x + dx + half,
                bottom: y + dy + height / 2.0,
            })
            .find(|room| {
                let inside = room.left > LEFT_PX && room.right < self.right_px;
                let inside = inside && room.top > TOP_PX && room.bottom < BOTTOM_PX;
                inside && !taken.iter().any(|other| other.meets(room))
            })
    }

    /// What the picture cannot show by itself.
    fn notes(&self, marks_left_out: usize) -> Vec<String> {
        let points = || self.figure.lines.iter().flat_map(|line| &line.points);
        let placed =
            |wanted: fn(&Place) -> bool| points().filter_map(|p| self.place(p)).filter(|p| wanted(&p.1)).count();
        let low = placed(|place| matches!(place, Place::LowerEdge(_)));
        let failed = placed(|place| matches!(place, Place::UpperEdge(_)));
        let left = points().filter(|p| p.x.is_finite() && matches!(self.x.place(p.x), Place::LowerEdge(_))).count();
        let nowhere = points().filter(|point| !point.x.is_finite()).count();
        let mut notes = Vec::new();
        if low > 0 {
            notes.push(format!("Open markers at the lower edge: 0 or less ({low})."));
        }
        if left > 0 {
            notes.push(format!("At the left edge: 0 or less ({left})."));
        }
        if failed > 0 {
            notes.push(format!("Crosses at the upper edge: no finite value ({failed})."));
        }
        if nowhere > 0 {
            notes.push(format!("Not drawn, because they have no place on the horizontal axis: {nowhere}."));
        }
        if marks_left_out > 0 {
            notes.push(format!("{marks_left_out} marks left out for want of room."));
        }
        notes
    }
}

fn grid(label: &Label) -> &'static str {
    if *label == Label::None { "#f1f1f1" } else { "#dddddd" }
}

/// A tick's label; powers of ten with a raised exponent.
fn text(out: &mut String, x: f64, y: f64, anchor: &str, label: &Label) -> Result {
    let words = match label {
        Label::None => return Ok(()),
        Label::Plain(words) => escape(words),
        Label::Power(power) => format!(r#"10<tspan dy="-5" font-size="9.5">{power}</tspan>"#),
    };
    writeln!(out, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{words}</text>"#)
}

#[cfg(test)]
mod tests;
