//! The report as files: one self-contained page, and the data of every figure and table beside it.
//!
//! `index.html` has the figures within it and needs no other file and no script. `ID.svg`, `ID.csv` and `ID.json` are one
//! figure or table each, `report.json` is everything. Each file is written beside its place and then renamed, the page
//! last: what is there is whole.

use std::collections::HashSet;
use std::path::Path;

use anyhow::{Context as _, ensure};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Serialize;

use crate::document::{Cell, Figure, Section, Table};
use crate::draw;
use crate::machine::Machine;

/// A table with more rows is folded away until somebody wants it.
const LONG_ROWS: usize = 16;

/// Everything that `report.json` holds.
#[derive(Serialize)]
struct Report<'a> {
    machine: &'a Machine,
    sections: &'a [Section],
}

/// Writes the page of `sections` and all that goes with it into `out`, which is made if it is not there.
///
/// # Errors
/// A file cannot be written. Or an id of a figure or table is not made of a-z, 0-9 and `-`, or is another's too: then it
/// has no files of its own, but everything else is there, also the page with it.
pub fn write(out: &Path, machine: &Machine, sections: &[Section]) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let put = |name: &str, bytes: &[u8]| put(out, name, bytes);
    let mut names = Names::default();
    for section in sections {
        for figure in section.figures.iter().filter(|figure| names.take(&figure.id)) {
            put(&format!("{}.svg", figure.id), draw::svg(figure).as_bytes())?;
            put(&format!("{}.csv", figure.id), &figure_csv(figure)?)?;
            put(&format!("{}.json", figure.id), &serde_json::to_vec_pretty(figure)?)?;
        }
        for table in section.all_tables().filter(|table| names.take(&table.id)) {
            put(&format!("{}.csv", table.id), &table_csv(&table)?)?;
            put(&format!("{}.json", table.id), &serde_json::to_vec_pretty(&table)?)?;
        }
    }
    put("report.json", &serde_json::to_vec_pretty(&Report { machine, sections })?)?;
    put("index.html", page(machine, sections).into_string().as_bytes())?;
    let refused = names.refused.join(", ");
    ensure!(refused.is_empty(), "ids of figures or tables that are no file names, or used twice: {refused}");
    Ok(())
}

/// The names of files that are taken, and the ids that got none.
#[derive(Default)]
struct Names {
    taken: HashSet<String>,
    refused: Vec<String>,
}

impl Names {
    fn take(&mut self, id: &str) -> bool {
        let plain = !id.is_empty() && id.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-');
        let free = plain && !["report", "index"].contains(&id) && self.taken.insert(id.to_owned());
        if !free {
            self.refused.push(format!("`{id}`"));
        }
        free
    }
}

/// Writes a file beside its place and renames it, so that what is there is whole.
pub(crate) fn put(folder: &Path, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
    let (place, beside) = (folder.join(name), folder.join(format!(".{name}.part")));
    std::fs::write(&beside, bytes).with_context(|| format!("cannot write {}", beside.display()))?;
    std::fs::rename(&beside, &place).with_context(|| format!("cannot write {}", place.display()))
}

/// One row a point, and one a level of the vertical axis with an empty `x`.
fn figure_csv(figure: &Figure) -> anyhow::Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    let (x_label, y_label) = (figure.x.label.as_str(), figure.y.label.as_str());
    csv.write_record(["line", "mark", "x", "x_p5", "x_p95", "y", "x_label", "y_label"])?;
    for line in &figure.lines {
        for point in &line.points {
            let [low, high] = [0, 1].map(|end| point.x_spread.map(|(low, high)| [low, high][end]));
            csv.serialize((&line.name, &point.mark, point.x, low, high, point.y, x_label, y_label))?;
        }
    }
    for band in &figure.bands {
        csv.serialize((&band.label, "band", "", "", "", band.at, "", y_label))?;
    }
    Ok(csv.into_inner().map_err(csv::IntoInnerError::into_error)?)
}

/// Headings, then the rows, with all digits.
fn table_csv(table: &Table) -> anyhow::Result<Vec<u8>> {
    // Flexible: a row of the wrong length is still all there.
    let mut csv = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    csv.write_record(&table.columns)?;
    for row in &table.rows {
        csv.write_record(row.iter().map(|cell| match cell {
            Cell::Number(value) => value.to_string(),
            cell => cell.words(),
        }))?;
    }
    Ok(csv.into_inner().map_err(csv::IntoInnerError::into_error)?)
}

/// A page of its own with a title and a body.
pub(crate) fn document(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width,initial-scale=1";
                title { (title) }
                style { (PreEscaped(include_str!("page.css"))) }
            }
            body { h1 { (title) } (body) }
        }
    }
}

/// Figure and caption, with links to the files of these endings.
pub(crate) fn figure(figure: &Figure, endings: &[&str]) -> Markup {
    html! {
        figure id=(figure.id) {
            div class="scroll" { (PreEscaped(draw::svg(figure))) }
            figcaption { (figure.caption) (links(&figure.id, endings)) }
        }
    }
}

fn links(id: &str, endings: &[&str]) -> Markup {
    html! { @for ending in endings { " " a href={ (id) "." (ending) } { (ending.to_uppercase()) } } }
}

/// A table without a caption.
pub(crate) fn rows(columns: &[impl AsRef<str>], rows: &[Vec<Cell>], caption: &Markup) -> Markup {
    html! {
        div class="scroll" { table {
            caption { (caption) }
            thead { tr { @for column in columns { th { (column.as_ref()) } } } }
            tbody { @for row in rows { tr { @for cell in row { (self::cell(cell)) } } } }
        } }
    }
}

/// A table of the page; a long one is folded away.
fn folded(table: &Table) -> Markup {
    let links = links(&table.id, &["csv", "json"]);
    let whole = rows(&table.columns, &table.rows, &html! { (table.caption) (links) });
    html! {
        @if table.rows.len() > LONG_ROWS {
            details { summary { "Table of " (table.rows.len()) " rows" } (whole) }
        } @else { (whole) }
    }
}

fn cell(cell: &Cell) -> Markup {
    let class = match cell {
        Cell::Text(_) => "",
        Cell::Number(_) => "n",
        Cell::Verdict(true) => "pass",
        Cell::Verdict(false) => "fail",
    };
    html! { td class=[Some(class).filter(|class| !class.is_empty())] { (cell.words()) } }
}

fn page(machine: &Machine, sections: &[Section]) -> Markup {
    let body = html! {
        (summary(sections))
        ul { @for section in sections { li { a href={ "#section-" (section.id) } { (section.title) } } } }
        @for section in sections {
            section id={ "section-" (section.id) } {
                h2 { (section.title) }
                @for paragraph in &section.text { p { (paragraph) } }
                @for one in &section.figures { (figure(one, &["svg", "csv", "json"])) }
                @for table in section.all_tables() { (folded(&table)) }
            }
        }
        h2 { "Measured on" }
        table { @for (what, value) in machine.rows() { tr { th { (what) } td { (value) } } } }
        p { "All numbers: " a href="report.json" { "report.json" } "." }
    };
    document("taxeld: how right, and how fast", &body)
}

/// The first screen: what this is about, and what was promised with its verdict.
fn summary(sections: &[Section]) -> Markup {
    let aims = sections.iter().flat_map(|section| section.aims.iter().map(move |aim| (section, aim)));
    let judged: Vec<_> = aims.filter_map(|(section, aim)| aim.met.map(|met| (section, aim, met))).collect();
    let missed = judged.iter().filter(|aim| !aim.2).count();
    html! {
        p {
            "taxeld turns the raw counts of a robot's skin into the force that presses on it. It learns how from a vacuum \
             bag: while the pressure in the bag rises, one curve from counts to pressure is fitted for each sensing element \
             (taxel). This page measures how long such a fit takes and how exact it is beside other methods, how well it \
             predicts what it has not seen, and how soon a force reaches a robot's controller. "
            (judged.len() - missed) " of " (judged.len()) " aims are met; a section's text says why one is missed."
        }
        div class="scroll" { table class="aims" {
            thead { tr { @for column in ["", "aim", "measured", "promised", "section"] { th { (column) } } } }
            tbody { @for (section, aim, met) in &judged { tr {
                td class=(if *met { "pass" } else { "fail" }) { (if *met { "met" } else { "missed" }) }
                td { (aim.what) }
                (cell(&aim.measured.map_or_else(|| "not measured".into(), Cell::from)))
                td { (aim.aim) }
                td { a href={ "#section-" (section.id) } { (section.id) } }
            } } }
        } }
    }
}
