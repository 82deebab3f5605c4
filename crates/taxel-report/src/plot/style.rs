//! The measures of a figure, and how its lines look.

use crate::document::Line;

pub(super) const WIDTH_PX: f64 = 760.0;
pub(super) const LEFT_PX: f64 = 80.0;
pub(super) const TOP_PX: f64 = 14.0;
pub(super) const BOTTOM_PX: f64 = 414.0;
/// Right end of the plot; the names of bands need room beside it.
pub(super) const RIGHT_PX: f64 = 734.0;
pub(super) const RIGHT_OF_BANDS_PX: f64 = 596.0;

pub(super) const INK: &str = "#222222";
pub(super) const FAINT: &str = "#555555";

/// Width of a character over the size of its letters, about, in a font without serifs.
pub(super) const CHARACTER: f64 = 0.56;

/// How a line looks. Ours come first, so that they have the clearest ones.
const COLOURS: [&str; 10] =
    ["#1f5fa8", "#00795f", "#7b3f9e", "#c0392b", "#d98200", "#6b4a1f", "#666666", "#c2488f", "#2a9fc4", "#7f8c1a"];
const DASHES: [&str; 5] = ["none", "7 3", "2 3", "9 3 2 3", "4 2"];

/// The look of one line.
#[derive(Clone, Copy)]
pub(super) struct Style {
    pub colour: &'static str,
    pub dash: &'static str,
    pub shape: usize,
    pub width_px: f64,
}

/// Where all styles of a figure's lines come from: in the lines' own order.
pub(super) fn styles(lines: &[Line]) -> Vec<Style> {
    let ours = lines.iter().filter(|line| line.ours).count();
    let (mut next_of_ours, mut next) = (0, ours);
    let style = |line: &Line| {
        let number = if line.ours { &mut next_of_ours } else { &mut next };
        let at = *number;
        *number += 1;
        Style {
            colour: COLOURS[at % COLOURS.len()],
            // Out of step with the colours, so that the eleventh line is not the first again.
            dash: DASHES[(at + at / COLOURS.len()) % DASHES.len()],
            shape: at,
            width_px: if line.ours { 2.6 } else { 1.3 },
        }
    };
    lines.iter().map(style).collect()
}
