//! Small things that several commands print.

use indicatif::ProgressStyle;

/// The style of a living line.
pub fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
