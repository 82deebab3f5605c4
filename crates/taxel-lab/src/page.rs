//! Sections as one self-contained page, for a screen and for paper; as files with the figures as `ID.svg` and all numbers in
//! one JSON file.

use std::path::Path;

use anyhow::Context as _;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;

use crate::document::{Figure, Section, Table, words};
use crate::svg::svg;

/// A page with what stands on it.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// The heading, and the name in a browser's tab.
    pub title: &'a str,
    /// Paragraphs below it.
    pub introduction: &'a [String],
    /// What follows.
    pub sections: &'a [Section],
}

impl Page<'_> {
    /// Writes the page and what goes with it into `out`, which is made if it is not there. All numbers are in `data`.json. The
    /// page comes last and needs no other file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, out: &Path, data: &str) -> anyhow::Result<()> {
        std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
        for figure in self.sections.iter().flat_map(|section| &section.figures) {
            taxel_files::write_text(&out.join(format!("{}.svg", figure.id)), &svg(figure))?;
        }
        let data = format!("{data}.json");
        taxel_files::write_text(&out.join(&data), &serde_json::to_string_pretty(self.sections)?)?;
        taxel_files::write_text(&out.join("index.html"), &self.html(Some(&data)))
    }

    /// The page alone; `data` is the file of all numbers beside it.
    #[must_use]
    pub fn html(&self, data: Option<&str>) -> String {
        let page = html! {
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
                    @for paragraph in self.introduction { p { (paragraph) } }
                    (self.aims())
                    @for section in self.sections { (self::section(section)) }
                    @if let Some(data) = data { p { "All numbers: " a href=(data) { (data) } "." } }
                }
            }
        };
        page.into_string()
    }

    /// The first screen: what was promised, with its verdict.
    fn aims(&self) -> Markup {
        let aims = || self.sections.iter().flat_map(|section| section.aims.iter().map(move |aim| (section, aim)));
        html! { @if aims().next().is_some() {
            p { (aims().filter(|(_, aim)| aim.met).count()) " of " (aims().count()) " aims are met; a section's text says why one is missed." }
            div class="scroll" { table class="aims" {
                thead { tr { @for column in ["", "aim", "measured", "promised", "section"] { th { (column) } } } }
                tbody { @for (section, aim) in aims() { tr {
                    td class=(if aim.met { "pass" } else { "fail" }) { (if aim.met { "met" } else { "missed" }) }
                    td { (aim.what) } td class="n" { (words(&aim.measured.into())) } td { (aim.aim) }
                    td { a href={ "#section-" (section.id) } { (section.id) } }
                } } }
            } }
        } }
    }
}

fn section(section: &Section) -> Markup {
    html! {
        section id={ "section-" (section.id) } {
            h2 { (section.title) }
            @for paragraph in &section.text { p { (paragraph) } }
            @for one in &section.figures { (figure(one)) }
            @for one in section.tables.iter().filter(|table| !table.rows.is_empty()) { (table(one)) }
        }
    }
}

fn figure(figure: &Figure) -> Markup {
    html! {
        figure id=(figure.id) {
            div class="scroll" { (PreEscaped(svg(figure))) }
            // Without a caption it is a page of one file: no other is beside it.
            @if !figure.caption.is_empty() {
                figcaption { (figure.caption) " " a href={ (figure.id) ".svg" } { "SVG" } }
            }
        }
    }
}

fn table(table: &Table) -> Markup {
    let class = |cell: &Value| match cell {
        Value::Number(_) => Some("n"),
        Value::Bool(true) => Some("pass"),
        Value::Bool(false) => Some("fail"),
        _ => None,
    };
    html! {
        div class="scroll" { table class=[(table.columns.len() > 12).then_some("dense")] {
            caption { (table.caption) }
            thead { tr { @for column in &table.columns { th { (column) } } } }
            tbody { @for row in &table.rows { tr {
                @for cell in row { td class=[class(cell)] { (words(cell)) } }
            } } }
        } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::{Aim, Axis, Line, row};

    #[test]
    fn a_page_is_whole_and_no_text_becomes_markup() {
        let lines = vec![Line { name: "a <name>".to_owned(), points: vec![(1.0, 2.0), (2.0, 3.0)], ..Line::default() }];
        let figure = Figure {
            id: "a-figure".to_owned(),
            title: "time < error".to_owned(),
            caption: "errors < 1 </figcaption><script>alert(1)</script>".to_owned(),
            x: Axis { label: "x <b>", log: true },
            lines,
            ..Figure::default()
        };
        let rows = vec![row!["a < b", 1.0 / 3.0, false]];
        let section = Section {
            id: "a".to_owned(),
            text: vec!["first <p>".to_owned()],
            aims: vec![Aim::at_most("kept", 0.25, 1.0), Aim::at_most("missed", 2.0, 1.0)],
            figures: vec![figure],
            tables: vec![Table::new("a-table", "a <table>", ["case", "us", "holds"], rows)],
            ..Section::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new/page");
        Page { title: "Title", introduction: &[], sections: &[section] }.write(&out, "data").unwrap();
        let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
        let page = read("index.html");
        for text in ["<script", "<name>", "<b>", "a < b", "first <p>", "src=", "<link"] {
            assert!(!page.contains(text), "{text}");
        }
        for text in ["1 of 2 aims are met", "0.3333", ">FAIL<", "<svg "] {
            assert!(page.contains(text), "{text}");
        }
        assert!(read("a-figure.svg").starts_with("<svg "));
        let data: serde_json::Value = serde_json::from_str(&read("data.json")).unwrap();
        assert_eq!(data[0]["figures"][0]["lines"][0]["points"][1][1], 3.0);
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 3);
    }
}
