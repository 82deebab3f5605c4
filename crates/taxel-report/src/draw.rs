//! A figure as one self-contained SVG, for a screen, dark or light, and for a page of paper.
//!
//! Lines differ in colour, dash and sign, so that they can be told apart in print; ours are stronger. The legend is below
//! the plot and the names of the bands right of it, so that neither hides a point.

mod legend;
mod paper;
mod scale;

use std::fmt::Write;

use crate::document::{Figure, Line, Look, Point};
use paper::{BOTTOM_PX, CHARACTER, LEFT_PX, RIGHT_OF_BANDS_PX, RIGHT_PX, Style, TOP_PX, WIDTH_PX, escape, put};
use scale::{Place, Scale, Tick};

const MARK_SIZE_PX: f64 = 10.5;
/// Large marks of several lines stand side by side, so far apart, or they would hide each other.
const ASIDE_PX: f64 = 9.0;

/// On a light and on a dark ground, told apart without colour too: dark and bright alternate at first. Ours come first, so
/// that they have the clearest ones.
const COLOURS: [[&str; 2]; 10] = [
    ["#1f5fa8", "#6fb1ff"],
    ["#d98200", "#ffb84d"],
    ["#00795f", "#3fd6ab"],
    ["#7b3f9e", "#c896ec"],
    ["#c0392b", "#ff8478"],
    ["#6b4a1f", "#cfa878"],
    ["#666666", "#a8a8a8"],
    ["#c2488f", "#ff8fcb"],
    ["#2a9fc4", "#63d4f5"],
    ["#7f8c1a", "#c8d64b"],
];
const DASHES: [&str; 5] = ["none", "7 3", "2 3", "9 3 2 3", "4 2"];

/// Classes of ink, as strokes and as fills, on a light and on a dark ground.
const INKS: [(&str, [&str; 2]); 6] = [
    ("ink", ["#222222", "#e6e6e6"]),
    ("faint", ["#555555", "#aaaaaa"]),
    ("grid", ["#dddddd", "#3c3c3c"]),
    ("fine", ["#f1f1f1", "#262626"]),
    ("band", ["#8a5a00", "#e0b060"]),
    ("paper", ["#ffffff", "#161616"]),
];

/// All styles of a figure's lines, in their own order.
fn styles(lines: &[Line]) -> Vec<Style> {
    let (mut next_of_ours, mut next) = (0, lines.iter().filter(|line| line.ours).count());
    let style = |line: &Line| {
        let number = if line.ours { &mut next_of_ours } else { &mut next };
        let at = *number;
        *number += 1;
        // Out of step with the colours, so that the eleventh line is not the first again.
        let dash = DASHES[(at + at / COLOURS.len()) % DASHES.len()];
        let (dash, width_px) = match line.look {
            Look::Signs => (dash, if line.ours { 2.6 } else { 1.3 }),
            Look::Plain => ("none", 2.4),
            Look::Dashed | Look::Bars(_) => ("6 4", 1.4),
            Look::Dots => ("none", 2.6),
            Look::Marks => ("none", 6.0),
        };
        Style { colour: at % COLOURS.len(), dash, shape: at, width_px }
    };
    lines.iter().map(style).collect()
}

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
    Drawing::new(figure).draw()
}

struct Drawing<'a> {
    figure: &'a Figure,
    styles: Vec<Style>,
    x: Scale,
    y: Scale,
    right_px: f64,
}

/// The classes of all inks and colours; a reader's dark mode turns them.
fn classes() -> String {
    let mut of = [String::new(), String::new()];
    let colours = COLOURS.iter().enumerate().map(|(k, colours)| (format!("c{k}"), colours));
    for (name, values) in INKS.iter().map(|(name, values)| ((*name).to_owned(), values)).chain(colours) {
        for (of, value) in of.iter_mut().zip(values) {
            let _ = write!(of, ".s-{name}{{stroke:{value}}}.f-{name}{{fill:{value}}}");
        }
    }
    format!("{}@media(prefers-color-scheme:dark){{{}}}", of[0], of[1])
}

impl<'a> Drawing<'a> {
    fn new(figure: &'a Figure) -> Self {
        let (mut x, mut y): (Vec<f64>, Vec<f64>) = (figure.levels.iter().map(|level| level.at).collect(), Vec::new());
        y.extend(figure.bands.iter().map(|band| band.at));
        for line in &figure.lines {
            let half = if let Look::Bars(width) = line.look { 0.5 * width } else { 0.0 };
            for point in &line.points {
                let (low, high) = point.x_spread.unwrap_or((point.x - half, point.x + half));
                x.extend([low, point.x, high]);
                y.push(point.y);
            }
            y.extend((half > 0.0).then_some(0.0));
        }
        let right_px = if figure.bands.is_empty() { RIGHT_PX } else { RIGHT_OF_BANDS_PX };
        let (x, y) = (Scale::new(&figure.x, x, (LEFT_PX, right_px)), Scale::new(&figure.y, y, (BOTTOM_PX, TOP_PX)));
        Self { figure, styles: styles(&figure.lines), x, y, right_px }
    }

    fn draw(&self) -> String {
        let mut body = String::new();
        self.axes(&mut body);
        legend::bands(&mut body, &self.figure.bands, &self.y, self.right_px);
        let marked = self.figure.lines.iter().filter(|line| line.look == Look::Marks).count();
        let mut aside_px = -0.5 * ASIDE_PX * marked.saturating_sub(1) as f64;
        for (line, style) in self.figure.lines.iter().zip(&self.styles) {
            match line.look {
                Look::Bars(width) => self.bars(&mut body, line, *style, width),
                Look::Marks => {
                    self.joined(&mut body, line, *style, aside_px);
                    aside_px += ASIDE_PX;
                }
                _ => self.joined(&mut body, line, *style, 0.0),
            }
            if line.look == Look::Signs {
                self.signs(&mut body, line, *style);
            }
        }
        let left_out = self.marks(&mut body);
        legend::levels(&mut body, &self.figure.levels, &self.x, self.right_px);
        let height = legend::below(&mut body, &self.figure.lines, &self.styles, &self.notes(left_out));
        let (title, classes) = (escape(&self.figure.title), classes());
        let mut out = String::new();
        put!(
            out,
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH_PX} {height}" role="img" aria-label="{title}" font-family="Helvetica, Arial, sans-serif" font-size="12.5" class="f-ink"><style>{classes}</style>"#
        );
        put!(out, r#"<rect width="{WIDTH_PX}" height="{height}" class="f-paper"/>"#);
        put!(out, r#"<text x="{LEFT_PX}" y="28" font-size="16" font-weight="bold">{title}</text>"#);
        out.push_str(&body);
        put!(out, "</svg>");
        out
    }

    fn axes(&self, out: &mut String) {
        let right = self.right_px;
        let class = |label: &Option<String>| if label.is_some() { "grid" } else { "fine" };
        for Tick { px, label } in self.x.ticks() {
            let (class, y) = (class(&label), BOTTOM_PX + 18.0);
            put!(out, r#"<path d="M{px:.1} {TOP_PX}V{BOTTOM_PX}" class="s-{class}" stroke-width="0.8"/>"#);
            if let Some(label) = label {
                put!(out, r#"<text x="{px:.1}" y="{y:.1}" text-anchor="middle">{label}</text>"#);
            }
        }
        for Tick { px, label } in self.y.ticks() {
            let (class, x, y) = (class(&label), LEFT_PX - 8.0, px + 4.5);
            put!(out, r#"<path d="M{LEFT_PX} {px:.1}H{right}" class="s-{class}" stroke-width="0.8"/>"#);
            if let Some(label) = label {
                put!(out, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="end">{label}</text>"#);
            }
        }
        put!(out, r#"<path d="M{LEFT_PX} {TOP_PX}V{BOTTOM_PX}H{right}" fill="none" class="s-faint"/>"#);
        let (x, y) = ((LEFT_PX + right) / 2.0, BOTTOM_PX + 40.0);
        let label = escape(&self.figure.x.label);
        put!(out, r#"<text x="{x:.1}" y="{y}" font-size="14" text-anchor="middle">{label}</text>"#);
        let (x, y) = (22.0, (TOP_PX + BOTTOM_PX) / 2.0);
        let (label, turned) = (escape(&self.figure.y.label), format!(r#"transform="rotate(-90 {x} {y})""#));
        put!(out, r#"<text x="{x}" y="{y}" font-size="14" text-anchor="middle" {turned}>{label}</text>"#);
    }

    /// Where a point is drawn; `None` if it has no place on the horizontal axis.
    fn place(&self, point: &Point) -> Option<(f64, Place)> {
        point.x.is_finite().then(|| (self.x.place(point.x).px(), self.y.place(point.y)))
    }

    fn bars(&self, out: &mut String, line: &Line, style: Style, width: f64) {
        let zero = self.y.place(0.0).px();
        for point in line.points.iter().filter(|point| point.y > 0.0) {
            let [left, right] = [-0.5, 0.5].map(|side| self.x.place(point.x + side * width).px());
            let (top, across) = (self.y.place(point.y).px(), right - left);
            let (up, colour) = (zero - top, style.colour);
            let place = format!(r#"x="{left:.1}" y="{top:.1}" width="{across:.1}" height="{up:.1}""#);
            put!(out, r#"<rect {place} class="f-c{colour} s-paper"/>"#);
        }
    }

    /// The line itself, or its dots: in one path, or thousands of samples make a file of megabytes.
    fn joined(&self, out: &mut String, line: &Line, style: Style, aside_px: f64) {
        let Style { colour, dash, width_px, .. } = style;
        let apart = matches!(line.look, Look::Dots | Look::Marks);
        let (mut path, mut pen_down) = (String::new(), false);
        for point in &line.points {
            // A method that failed has no value to go to: its line is broken there.
            let Some((x, y)) = self.place(point).filter(|(_, y)| !matches!(y, Place::UpperEdge(_))) else {
                pen_down = false;
                continue;
            };
            // Dots are strokes of no length.
            let (command, end) = (if pen_down && !apart { 'L' } else { 'M' }, if apart { "h0" } else { "" });
            let _ = write!(path, "{command}{:.1} {:.1}{end}", x + aside_px, y.px());
            pen_down = true;
        }
        if !path.is_empty() {
            let cap = if apart { r#"stroke-linecap="round" stroke-opacity="0.6""# } else { "" };
            let look = format!(r#"class="s-c{colour}" stroke-width="{width_px}" stroke-dasharray="{dash}" {cap}"#);
            put!(out, r#"<path d="{path}" fill="none" stroke-linejoin="round" {look}/>"#);
        }
    }

    fn signs(&self, out: &mut String, line: &Line, Style { colour, shape, .. }: Style) {
        for point in &line.points {
            let Some((x, place)) = self.place(point) else { continue };
            if let Some((low, high)) = point.x_spread.filter(|(low, high)| low.is_finite() && high.is_finite()) {
                let (low, high, y) = (self.x.place(low).px(), self.x.place(high).px(), place.px());
                put!(out, r#"<path d="M{low:.1} {y:.1}H{high:.1}" class="s-c{colour}" stroke-opacity="0.6"/>"#);
            }
            match place {
                Place::Here(y) => legend::sign(out, shape, (x, y), colour, true),
                Place::LowerEdge(y) => legend::sign(out, shape, (x, y), colour, false),
                Place::UpperEdge(y) => {
                    put!(out, r#"<path d="M{x:.1} {y:.1}m-4-4l8 8m-8 0l8-8" class="s-c{colour}" stroke-width="1.8"/>"#);
                }
            }
        }
    }

    /// Writes the points' marks where they hide nothing; returns how many found no such place.
    fn marks(&self, out: &mut String) -> usize {
        let (mut taken, mut wanted): (Vec<Room>, _) = (Vec::new(), Vec::new());
        for (line, style) in self.figure.lines.iter().zip(&self.styles).filter(|(line, _)| line.look == Look::Signs) {
            for (k, point) in line.points.iter().enumerate() {
                let Some((x, y)) = self.place(point).map(|(x, y)| (x, y.px())) else { continue };
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
            let look = format!(r#"font-size="{MARK_SIZE_PX}" text-anchor="middle" class="f-c{colour} s-paper""#);
            let halo = r#"stroke-width="2.4" paint-order="stroke""#;
            put!(out, r#"<text x="{x:.1}" y="{y:.1}" {look} {halo}>{}</text>"#, escape(mark));
        }
        left_out
    }

    /// A place for `mark` around the point at `(x, y)` within the plot that meets nothing of `taken`.
    fn room_for(&self, mark: &str, (x, y): (f64, f64), taken: &[Room]) -> Option<Room> {
        let half = mark.chars().count() as f64 * MARK_SIZE_PX * CHARACTER / 2.0 + 0.5;
        let (aside, above, tall) = (half + 5.0, MARK_SIZE_PX / 2.0 + 5.0, MARK_SIZE_PX / 2.0);
        let directions = [(0.0, -above), (aside, 0.0), (0.0, above), (-aside, 0.0)];
        let corners = [(aside, -above), (-aside, -above), (aside, above), (-aside, above)];
        let around = directions.into_iter().chain(corners.map(|(dx, dy)| (0.8 * dx, 0.8 * dy)));
        let room = |(dx, dy)| {
            let (x, y): (f64, f64) = (x + dx, y + dy);
            Room { left: x - half, top: y - tall, right: x + half, bottom: y + tall }
        };
        around.map(room).find(|room| {
            let inside = room.left > LEFT_PX && room.right < self.right_px;
            let inside = inside && room.top > TOP_PX && room.bottom < BOTTOM_PX;
            inside && !taken.iter().any(|other| other.meets(room))
        })
    }

    /// What the picture cannot show by itself.
    fn notes(&self, marks_left_out: usize) -> String {
        let points = || self.figure.lines.iter().flat_map(|line| &line.points);
        let placed =
            |wanted: fn(&Place) -> bool| points().filter_map(|p| self.place(p)).filter(|p| wanted(&p.1)).count();
        let low = placed(|place| matches!(place, Place::LowerEdge(_)));
        let failed = placed(|place| matches!(place, Place::UpperEdge(_)));
        let left = points().filter(|p| p.x.is_finite() && matches!(self.x.place(p.x), Place::LowerEdge(_))).count();
        let nowhere = points().filter(|point| !point.x.is_finite()).count();
        let notes = [
            (low, format!("Open signs at the lower edge: 0 or less ({low}).")),
            (left, format!("At the left edge: 0 or less ({left}).")),
            (failed, format!("Crosses at the upper edge: no finite value ({failed}).")),
            (nowhere, format!("Not drawn, because they have no place on the horizontal axis: {nowhere}.")),
            (marks_left_out, format!("{marks_left_out} marks left out for want of room.")),
        ];
        notes.into_iter().filter(|(count, _)| *count > 0).map(|(_, note)| note).collect::<Vec<_>>().join(" ")
    }
}

#[cfg(test)]
mod tests;
