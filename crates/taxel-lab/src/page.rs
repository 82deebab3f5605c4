//! Sections as files: one self-contained page, the figures as `ID.svg`, and all numbers in one JSON file.
//!
//! `index.html` has the figures within it and needs no other file and no script. It is written last.

use std::path::Path;

use anyhow::Context as _;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::document::{Cell, Figure, Section, Table};
use crate::io;
use crate::svg::svg;

/// A table with more rows is folded away until somebody wants it.
const LONG_ROWS: usize = 16;

/// A page with what stands on it.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// The heading, and the name in a browser's tab.
    pub title: &'a str,
    /// A paragraph below it.
    pub introduction: &'a str,
    /// What follows.
    pub sections: &'a [Section],
}

impl Page<'_> {
    /// Writes the page and what goes with it into `out`, which is made if it is not there. All numbers are in `data`.json.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, out: &Path, data: &str) -> anyhow::Result<()> {
        std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
        for figure in self.sections.iter().flat_map(|section| &section.figures) {
            io::write_text(&out.join(format!("{}.svg", figure.id)), &svg(figure))?;
        }
        let data = format!("{data}.json");
        io::write_text(&out.join(&data), &serde_json::to_string_pretty(self.sections)?)?;
        io::write_text(&out.join("index.html"), &self.html(&data).into_string())
    }

    fn html(&self, data: &str) -> Markup {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width,initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(include_str!("page.css"))) }
                }
                body {
                    h1 { (self.title) }
                    p { (self.introduction) }
                    (self.aims())
                    ul { @for section in self.sections { li { a href={ "#section-" (section.id) } { (section.title) } } } }
                    @for section in self.sections { (self::section(section)) }
                    p { "All numbers: " a href=(data) { (data) } "." }
                }
            }
        }
    }

    /// The first screen: what was promised, with its verdict.
    fn aims(&self) -> Markup {
        let aims = self.sections.iter().flat_map(|section| section.aims.iter().map(move |aim| (section, aim)));
        let judged: Vec<_> = aims.filter_map(|(section, aim)| Some((section, aim, aim.met?))).collect();
        let met = judged.iter().filter(|aim| aim.2).count();
        html! { @if !judged.is_empty() {
            p { (met) " of " (judged.len()) " aims are met; a section's text says why one is missed." }
            div class="scroll" { table class="aims" {
                thead { tr { @for column in ["", "aim", "measured", "promised", "section"] { th { (column) } } } }
                tbody { @for (section, aim, met) in &judged { tr {
                    td class=(if *met { "pass" } else { "fail" }) { (if *met { "met" } else { "missed" }) }
                    td { (aim.what) } td class="n" { (Cell::from(aim.measured).words()) } td { (aim.aim) }
                    td { a href={ "#section-" (section.id) } { (section.id) } }
                } } }
            } }
        } }
    }
}

fn section(section: &Section) -> Markup {
    let beside = section.aims.iter().filter(|aim| aim.met.is_none());
    html! {
        section id={ "section-" (section.id) } {
            h2 { (section.title) }
            @for paragraph in &section.text { p { (paragraph) } }
            ul { @for aim in beside { li { (aim.what) ": " (Cell::from(aim.measured).words()) } } }
            @for one in &section.figures { (figure(one)) }
            @for one in &section.tables { (table(one)) }
        }
    }
}

fn figure(figure: &Figure) -> Markup {
    html! {
        figure id=(figure.id) {
            div class="scroll" { (PreEscaped(svg(figure))) }
            figcaption { (figure.caption) " " a href={ (figure.id) ".svg" } { "SVG" } }
        }
    }
}

fn table(table: &Table) -> Markup {
    let class = |cell: &Cell| match cell {
        Cell::Text(_) => None,
        Cell::Number(_) => Some("n"),
        Cell::Verdict(true) => Some("pass"),
        Cell::Verdict(false) => Some("fail"),
    };
    let whole = html! {
        div class="scroll" { table {
            caption { (table.caption) }
            thead { tr { @for column in &table.columns { th { (column) } } } }
            tbody { @for row in &table.rows { tr {
                @for cell in row { td class=[class(cell)] { (cell.words()) } }
            } } }
        } }
    };
    html! {
        @if table.rows.len() > LONG_ROWS {
            details { summary { "Table of " (table.rows.len()) " rows" } (whole) }
        } @else { (whole) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::{Aim, Axis, Line};

    #[test]
    fn a_page_is_whole_and_no_text_becomes_markup() {
        let lines = vec![Line { name: "a <name>".to_owned(), points: vec![(1.0, 2.0), (2.0, 3.0)], ..Line::default() }];
        let figure = Figure {
            id: "a-figure".to_owned(),
            title: "time < error".to_owned(),
            caption: "errors < 1 </figcaption><script>alert(1)</script>".to_owned(),
            x: Axis::log("x <b>"),
            lines,
            ..Figure::default()
        };
        let rows = vec![vec![Cell::from("a < b"), Cell::from(1.0 / 3.0), Cell::from(false)]];
        let section = Section {
            id: "a".to_owned(),
            text: vec!["first <p>".to_owned()],
            aims: vec![Aim::at_most("kept", 0.25, 1.0), Aim::at_least("missed", 0.25, 1.0), Aim::beside("beside", 2.0)],
            figures: vec![figure],
            tables: vec![Table::new("a-table", "a <table>", ["case", "us", "holds"], rows)],
            ..Section::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new/page");
        Page { title: "Title", introduction: "what", sections: &[section] }.write(&out, "data").unwrap();
        let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
        let page = read("index.html");
        for text in ["<script", "<name>", "<b>", "a < b", "first <p>", "src=", "<link"] {
            assert!(!page.contains(text), "{text}");
        }
        for text in ["1 of 2 aims are met", "beside: 2", "0.333", ">FAIL<", "<svg "] {
            assert!(page.contains(text), "{text}");
        }
        assert!(read("a-figure.svg").starts_with("<svg "));
        let data: serde_json::Value = serde_json::from_str(&read("data.json")).unwrap();
        assert_eq!(data[0]["figures"][0]["lines"][0]["points"][1][1], 3.0);
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 3);
    }
}
