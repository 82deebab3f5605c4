//! `index.html` of the paper's figures.

use maud::{Markup, html};

use crate::document::Figure;
use crate::page::{document, figure, rows};
use crate::paper::table::{Errors, Tables};

/// The page of all figures and tables.
pub(super) fn page(figures: &[Figure], tables: &Tables) -> Markup {
    let body = html! {
        p {
            "What J. Kangro, S. Traversaro, D. Pucci and F. Nori show in \u{201c}Skin Normal Force Calibration Using Vacuum \
             Bags\u{201d}, drawn from these data: " (tables.source) ". The models are the paper's: the polynomial of order 5 \
             with the least squares over all samples of rising pressure, left as it is. Taxels are excluded by their swing \
             alone."
        }
        p { "The tables: " a href="table.md" { "table.md" } ", " a href="table.json" { "table.json" } "." }
        @if !tables.errors.is_empty() { h2 { "Force error of known loads" } }
        @for errors in &tables.errors {
            (rows(&Errors::COLUMNS, &errors.cells(), &html! { (errors.by) }))
        }
        h2 { "Figures" }
        @for one in figures { (figure(one, &["svg"])) }
        @if !tables.left_out.is_empty() {
            h2 { "Left out, because the data cannot draw it" }
            ul { @for left_out in &tables.left_out { li { (left_out.figure) ": " (left_out.why) } } }
        }
        h2 { "Calibration" }
        div class="scroll" { table {
            @for (what, value) in tables.calibration_rows() { tr { th { (what) } td { (value) } } }
        } }
    };
    document("The paper's figures and table", &body)
}
