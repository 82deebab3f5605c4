//! `index.html`: no script, no other file, readable on screen and on paper.

use super::data::verdict;
use crate::document::{Cell, Figure, Section, Table};
use crate::machine::Machine;
use crate::markup::{escape, three_digits};
use crate::plot;
use std::fmt::{Result, Write};

const STYLE: &str = "\
body{font:16px/1.5 Helvetica,Arial,sans-serif;color:#222;max-width:860px;margin:2em auto;padding:0 1em}
h1{font-size:1.7em}h2{font-size:1.3em;margin-top:2.2em;border-top:1px solid #ccc;padding-top:.8em}
figure{margin:1.6em 0}svg{width:100%;height:auto;border:1px solid #eee}
figcaption,caption{font-size:.9em;color:#444;text-align:left;padding:.3em 0}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.88em;margin:1.2em 0}
th,td{border-bottom:1px solid #ddd;padding:.25em .6em;text-align:left;vertical-align:top}
td.n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}
td.pass{color:#00663f}td.fail{color:#b00020;font-weight:bold}
@media print{@page{size:A4;margin:15mm}body{font-size:10pt;margin:0;max-width:none}
svg{max-height:100mm}figure{margin:.8em 0}table{font-size:.8em}figure,tr{break-inside:avoid}h2,h3{break-after:avoid}.scroll{overflow:visible}a{color:inherit;text-decoration:none}}
";

/// The page of all sections.
pub(super) fn page(machine: &Machine, sections: &[Section]) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write_page(&mut out, machine, sections);
    out
}

fn write_page(out: &mut String, machine: &Machine, sections: &[Section]) -> Result {
    writeln!(out, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">")?;
    writeln!(out, "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">")?;
    writeln!(out, "<title>taxeld: error against run time</title>\n<style>\n{STYLE}</style></head><body>")?;
    writeln!(out, "<h1>taxeld: error against run time</h1>\n<ul>")?;
    for section in sections {
        let (id, title) = (escape(&section.id), escape(&section.title));
        writeln!(out, "<li><a href=\"#section-{id}\">{title}</a></li>")?;
    }
    writeln!(out, "</ul>\n<h2>Measured on</h2>\n<table>")?;
    for (what, value) in machine.rows() {
        writeln!(out, "<tr><th>{what}</th><td>{}</td></tr>", escape(&value))?;
    }
    writeln!(out, "</table>\n<p>All numbers: <a href=\"report.json\">report.json</a>.</p>")?;
    for section in sections {
        let (id, title) = (escape(&section.id), escape(&section.title));
        writeln!(out, "<section id=\"section-{id}\">\n<h2>{title}</h2>")?;
        for paragraph in &section.text {
            writeln!(out, "<p>{}</p>", escape(paragraph))?;
        }
        for figure in &section.figures {
            write_figure(out, figure)?;
        }
        for table in &section.tables {
            write_table(out, table)?;
        }
        writeln!(out, "</section>")?;
    }
    writeln!(out, "</body></html>")
}

fn write_figure(out: &mut String, figure: &Figure) -> Result {
    let (id, caption) = (escape(&figure.id), escape(&figure.caption));
    writeln!(out, "<figure id=\"{id}\">\n{}", plot::svg(figure))?;
    let files = format!("<a href=\"{id}.svg\">SVG</a> <a href=\"{id}.csv\">CSV</a> <a href=\"{id}.json\">JSON</a>");
    writeln!(out, "<figcaption>{caption} {files}</figcaption>\n</figure>")
}

fn write_table(out: &mut String, table: &Table) -> Result {
    let (id, caption) = (escape(&table.id), escape(&table.caption));
    let files = format!("<a href=\"{id}.csv\">CSV</a> <a href=\"{id}.json\">JSON</a>");
    writeln!(out, "<div class=\"scroll\"><table id=\"{id}\"><caption>{caption} {files}</caption><thead><tr>")?;
    for column in &table.columns {
        write!(out, "<th>{}</th>", escape(column))?;
    }
    writeln!(out, "</tr></thead><tbody>")?;
    for row in &table.rows {
        write!(out, "<tr>")?;
        for cell in row {
            match cell {
                Cell::Text(text) => write!(out, "<td>{}</td>", escape(text))?,
                Cell::Number(value) => write!(out, "<td class=\"n\">{}</td>", three_digits(*value))?,
                Cell::Verdict(pass) => {
                    let class = if *pass { "pass" } else { "fail" };
                    write!(out, "<td class=\"{class}\">{}</td>", verdict(*pass))?;
                }
            }
        }
        writeln!(out, "</tr>")?;
    }
    writeln!(out, "</tbody></table></div>")
}
