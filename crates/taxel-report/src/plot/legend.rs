//! What stands around the plot: markers, the legend below it, the names of the bands beside it.

use super::scale::{Place, Scale};
use super::style::{BOTTOM_PX, CHARACTER, FAINT, LEFT_PX, Style, TOP_PX, WIDTH_PX};
use crate::document::Band;
use crate::markup::escape;
use std::fmt::{Error, Result, Write};

const ROW_PX: f64 = 20.0;
const FIRST_ROW_PX: f64 = BOTTOM_PX + 68.0;
const LEGEND_SIZE_PX: f64 = 12.5;
const BAND_SIZE_PX: f64 = 11.0;
const BAND_ROW_PX: f64 = 13.0;
const BAND_INK: &str = "#8a5a00";

/// A point's sign, one of six shapes.
pub(super) fn marker(out: &mut String, shape: usize, (x, y): (f64, f64), fill: &str, stroke: &str) -> Result {
    let look = format!(r#"fill="{fill}" stroke="{stroke}" stroke-width="1""#);
    let path = match shape % 6 {
        0 => return writeln!(out, r#"<circle cx="{x:.1}" cy="{y:.1}" r="2.9" {look}/>"#),
        1 => "m-2.7-2.7h5.4v5.4h-5.4z",
        2 => "m0-3.5l3.3 5.8h-6.6z",
        3 => "m0-3.7l3.7 3.7l-3.7 3.7l-3.7-3.7z",
        4 => "m0 3.5l3.3-5.8h-6.6z",
        _ => "m-3.4-1.3h6.8v2.6h-6.8z",
    };
    writeln!(out, r#"<path d="M{x:.1} {y:.1}{path}" {look}/>"#)
}

/// The sign of a point without a finite value.
pub(super) fn cross(out: &mut String, (x, y): (f64, f64), stroke: &str) -> Result {
    writeln!(out, r#"<path d="M{x:.1} {y:.1}m-4-4l8 8m-8 0l8-8" stroke="{stroke}" stroke-width="1.8"/>"#)
}

/// Levels with their names right of the plot, moved apart where they would overlap.
pub(super) fn bands(out: &mut String, bands: &[Band], scale: &Scale, right_px: f64) -> Result {
    let room = ((WIDTH_PX - right_px - 26.0) / (BAND_SIZE_PX * CHARACTER)) as usize;
    let mut named: Vec<(f64, Vec<String>)> = bands
        .iter()
        .filter_map(|band| match scale.place(band.y) {
            Place::Here(px) => Some((px, wrap(&band.label, room))),
            Place::LowerEdge(_) | Place::UpperEdge(_) => None,
        })
        .collect();
    named.sort_by(|a, b| a.0.total_cmp(&b.0));
    let heights: Vec<f64> = named.iter().map(|(_, lines)| lines.len() as f64 * BAND_ROW_PX + 5.0).collect();
    let levels: Vec<f64> = named.iter().map(|(px, _)| *px).collect();
    for ((level, lines), middle) in named.iter().zip(apart(&levels, &heights)) {
        let (x0, x1) = (right_px + 4.0, right_px + 18.0);
        let dashed = r#"stroke-dasharray="1.5 2.5""#;
        writeln!(out, r#"<path d="M{LEFT_PX} {level:.1}H{right_px}" stroke="{BAND_INK}" {dashed}/>"#)?;
        writeln!(out, r#"<path d="M{x0} {level:.1}L{x1} {middle:.1}" stroke="{BAND_INK}" stroke-width="0.7"/>"#)?;
        let first = middle - (lines.len() as f64 - 1.0) * BAND_ROW_PX / 2.0 + 4.0;
        for (k, line) in lines.iter().enumerate() {
            let (x, y) = (x1 + 4.0, first + k as f64 * BAND_ROW_PX);
            let look = format!(r#"font-size="{BAND_SIZE_PX}" fill="{BAND_INK}""#);
            writeln!(out, r#"<text x="{x}" y="{y:.1}" {look}>{}</text>"#, escape(line))?;
        }
    }
    Ok(())
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
pub(super) fn below(out: &mut String, names: &[(&str, Style)], notes: &[String]) -> std::result::Result<f64, Error> {
    let longest = names.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0) as f64;
    let needed = longest * LEGEND_SIZE_PX * CHARACTER + 66.0;
    let columns = ((WIDTH_PX - LEFT_PX) / needed).floor().clamp(1.0, 3.0) as usize;
    let rows = names.len().div_ceil(columns);
    let width = (WIDTH_PX - LEFT_PX) / columns as f64;
    for (k, (name, style)) in names.iter().enumerate() {
        let (x, y) = (LEFT_PX + (k / rows) as f64 * width, FIRST_ROW_PX + (k % rows) as f64 * ROW_PX);
        let Style { colour, dash, width_px, shape } = *style;
        let end = x + 42.0;
        let look = format!(r#"stroke="{colour}" stroke-width="{width_px}" stroke-dasharray="{dash}""#);
        writeln!(out, r#"<path d="M{x:.1} {y}H{end:.1}" {look}/>"#)?;
        marker(out, shape, (x + 21.0, y), colour, colour)?;
        let (x, y) = (end + 8.0, y + 4.5);
        writeln!(out, r#"<text x="{x:.1}" y="{y}" font-size="{LEGEND_SIZE_PX}">{}</text>"#, escape(name))?;
    }
    let mut y = FIRST_ROW_PX + rows as f64 * ROW_PX + 4.0;
    let room = ((WIDTH_PX - LEFT_PX) / (BAND_SIZE_PX * CHARACTER)) as usize;
    for line in wrap(&notes.join(" "), room).iter().filter(|line| !line.is_empty()) {
        let look = format!(r#"font-size="{BAND_SIZE_PX}" fill="{FAINT}""#);
        writeln!(out, r#"<text x="{LEFT_PX}" y="{y:.1}" {look}>{}</text>"#, escape(line))?;
        y += BAND_ROW_PX + 2.0;
    }
    Ok((y + 2.0).ceil())
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
