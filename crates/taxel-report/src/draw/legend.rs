//! What stands around the plot: the signs and the legend below it, the names of the bands beside it, those of the levels
//! in it.

use std::fmt::Write;

use super::paper::{BOTTOM_PX, CHARACTER, LEFT_PX, Style, TOP_PX, WIDTH_PX, escape, put};
use super::scale::{Place, Scale};
use crate::document::{Level, Line, Look};

const ROW_PX: f64 = 20.0;
const FIRST_ROW_PX: f64 = BOTTOM_PX + 68.0;
const NAME_PX: f64 = 12.5;
const BAND_PX: f64 = 11.0;
const BAND_ROW_PX: f64 = 13.0;

/// A point's sign, one of six shapes, filled or open.
pub(super) fn sign(out: &mut String, shape: usize, (x, y): (f64, f64), colour: usize, filled: bool) {
    let fill = if filled { format!("c{colour}") } else { "paper".to_owned() };
    let path = match shape % 6 {
        0 => "m-2.9 0a2.9 2.9 0 1 0 5.8 0a2.9 2.9 0 1 0-5.8 0z",
        1 => "m-2.7-2.7h5.4v5.4h-5.4z",
        2 => "m0-3.5l3.3 5.8h-6.6z",
        3 => "m0-3.7l3.7 3.7l-3.7 3.7l-3.7-3.7z",
        4 => "m0 3.5l3.3-5.8h-6.6z",
        _ => "m-3.4-1.3h6.8v2.6h-6.8z",
    };
    put!(out, r#"<path d="M{x:.1} {y:.1}{path}" class="f-{fill} s-c{colour}"/>"#);
}

/// Bands with their names right of the plot, moved apart where they would overlap.
pub(super) fn bands(out: &mut String, bands: &[Level], scale: &Scale, right_px: f64) {
    let room = ((WIDTH_PX - right_px - 26.0) / (BAND_PX * CHARACTER)) as usize;
    let named = |band: &Level| match scale.place(band.at) {
        Place::Here(px) => Some((px, wrap(&band.label, room))),
        Place::LowerEdge(_) | Place::UpperEdge(_) => None,
    };
    let mut named: Vec<(f64, Vec<String>)> = bands.iter().filter_map(named).collect();
    named.sort_by(|a, b| a.0.total_cmp(&b.0));
    let heights: Vec<f64> = named.iter().map(|(_, lines)| lines.len() as f64 * BAND_ROW_PX + 5.0).collect();
    let levels: Vec<f64> = named.iter().map(|(px, _)| *px).collect();
    for ((level, lines), middle) in named.iter().zip(apart(&levels, &heights)) {
        let (x0, x1) = (right_px + 4.0, right_px + 18.0);
        put!(out, r#"<path d="M{LEFT_PX} {level:.1}H{right_px}" class="s-band" stroke-dasharray="1.5 2.5"/>"#);
        put!(out, r#"<path d="M{x0} {level:.1}L{x1} {middle:.1}" class="s-band" stroke-width="0.7"/>"#);
        let first = middle - (lines.len() as f64 - 1.0) * BAND_ROW_PX / 2.0 + 4.0;
        for (k, line) in lines.iter().enumerate() {
            let (x, y, line) = (x1 + 4.0, first + k as f64 * BAND_ROW_PX, escape(line));
            put!(out, r#"<text x="{x}" y="{y:.1}" font-size="{BAND_PX}" class="f-band">{line}</text>"#);
        }
    }
}

/// Levels of the horizontal axis with their names beside them.
pub(super) fn levels(out: &mut String, levels: &[Level], scale: &Scale, right_px: f64) {
    for (row, level) in levels.iter().enumerate() {
        let (px, y) = (scale.place(level.at).px(), TOP_PX + 18.0 + ROW_PX * row as f64);
        let look = r#"class="s-band" stroke-width="1.6" stroke-dasharray="6 4""#;
        put!(out, r#"<path d="M{px:.1} {TOP_PX}V{BOTTOM_PX}" {look}/>"#);
        let (x, anchor) = if px > (LEFT_PX + right_px) / 2.0 { (px - 8.0, "end") } else { (px + 8.0, "start") };
        let halo = r#"class="f-band s-paper" stroke-width="3" paint-order="stroke""#;
        put!(out, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" {halo}>{}</text>"#, escape(&level.label));
    }
}

/// Middles of boxes of these heights that do not overlap, as near to `wanted` (ascending) as one pass down and one up
/// bring them.
fn apart(wanted: &[f64], heights: &[f64]) -> Vec<f64> {
    let mut middles = wanted.to_vec();
    let mut floor = TOP_PX;
    for (middle, height) in middles.iter_mut().zip(heights) {
        *middle = middle.max(floor + height / 2.0);
        floor = *middle + height / 2.0;
    }
    let mut ceiling = BOTTOM_PX + ROW_PX;
    for (middle, height) in middles.iter_mut().zip(heights).rev() {
        *middle = middle.min(ceiling - height / 2.0);
        ceiling = *middle - height / 2.0;
    }
    middles
}

/// Breaks `text` between words into lines of at most about `room` characters.
fn wrap(text: &str, room: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The legend and the notes below the plot; returns the height of the whole picture.
pub(super) fn below(out: &mut String, lines: &[Line], styles: &[Style], notes: &str) -> f64 {
    let longest = lines.iter().map(|line| line.name.chars().count()).max().unwrap_or(0) as f64;
    let needed = longest * NAME_PX * CHARACTER + 66.0;
    let columns = ((WIDTH_PX - LEFT_PX) / needed).floor().clamp(1.0, 3.0) as usize;
    let rows = lines.len().div_ceil(columns);
    let width = (WIDTH_PX - LEFT_PX) / columns as f64;
    for (k, (line, style)) in lines.iter().zip(styles).enumerate() {
        let (x, y) = (LEFT_PX + (k / rows) as f64 * width, FIRST_ROW_PX + (k % rows) as f64 * ROW_PX);
        let Style { colour, dash, width_px, shape } = *style;
        let (middle, end, top) = (x + 21.0, x + 42.0, y - 7.0);
        let look = format!(r#"class="s-c{colour}" stroke-width="{width_px}" stroke-dasharray="{dash}""#);
        match line.look {
            Look::Bars(_) => {
                put!(out, r#"<rect x="{x:.1}" y="{top:.1}" width="24" height="14" class="f-c{colour}"/>"#);
            }
            Look::Dots | Look::Marks => {
                let wide = r#"stroke-width="6" stroke-linecap="round""#;
                put!(out, r#"<path d="M{middle:.1} {y:.1}h0" class="s-c{colour}" {wide}/>"#);
            }
            _ => {
                put!(out, r#"<path d="M{x:.1} {y}H{end:.1}" {look}/>"#);
            }
        }
        if line.look == Look::Signs {
            sign(out, shape, (middle, y), colour, true);
        }
        let (x, y, name) = (end + 8.0, y + 4.5, escape(&line.name));
        put!(out, r#"<text x="{x:.1}" y="{y}" font-size="{NAME_PX}">{name}</text>"#);
    }
    let mut y = FIRST_ROW_PX + rows as f64 * ROW_PX + 4.0;
    let room = ((WIDTH_PX - LEFT_PX) / (BAND_PX * CHARACTER)) as usize;
    for line in wrap(notes, room).iter().filter(|line| !line.is_empty()) {
        put!(out, r#"<text x="{LEFT_PX}" y="{y:.1}" font-size="{BAND_PX}" class="f-faint">{}</text>"#, escape(line));
        y += BAND_ROW_PX + 2.0;
    }
    (y + 2.0).ceil()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_bands_never_overlap() {
        let heights = [18.0, 31.0, 18.0];
        let middles = apart(&[400.0, 401.0, 402.0], &heights);
        for k in 1..3 {
            assert!(middles[k] - middles[k - 1] >= (heights[k] + heights[k - 1]) / 2.0 - 1e-9, "{middles:?}");
        }
    }

    #[test]
    fn words_are_kept_whole() {
        assert_eq!(wrap("half a count of a taxel", 12), ["half a count", "of a taxel"]);
        assert_eq!(wrap("incomprehensibilities", 5), ["incomprehensibilities"]);
    }
}
