//! The paper that a figure is drawn on: where its plot lies, how lines look, and text that is safe in SVG.

use maud::html;

pub(super) const WIDTH_PX: f64 = 760.0;
pub(super) const LEFT_PX: f64 = 80.0;
pub(super) const TOP_PX: f64 = 50.0;
pub(super) const BOTTOM_PX: f64 = 440.0;
/// Right end of the plot; the names of bands need room beside it.
pub(super) const RIGHT_PX: f64 = 734.0;
pub(super) const RIGHT_OF_BANDS_PX: f64 = 596.0;
/// Width of a character over the size of its letters, about, in a font without serifs.
pub(super) const CHARACTER: f64 = 0.56;

/// The look of one line.
#[derive(Clone, Copy)]
pub(super) struct Style {
    /// Of [`COLOURS`].
    pub(super) colour: usize,
    pub(super) dash: &'static str,
    pub(super) shape: usize,
    pub(super) width_px: f64,
}

/// `text` with everything replaced that has a meaning in SVG, also within quotes, and control characters, which are not
/// allowed in XML at all.
pub(super) fn escape(text: &str) -> String {
    let text = text.replace(|c: char| c.is_control() && c != '\n' && c != '\t', "\u{fffd}");
    html! { (text) }.into_string()
}

/// Writes to a string, which cannot fail.
macro_rules! put {
    ($out:expr, $($text:tt)*) => { let _ = writeln!($out, $($text)*); };
}
pub(super) use put;
