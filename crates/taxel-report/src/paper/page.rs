//! `index.html` of the paper's figures: no script, no other file, readable on a phone, in the dark and on paper.

use std::fmt::{Result, Write};

use crate::markup::escape;
use crate::paper::chart::{Chart, svg};
use crate::paper::table::{Errors, Tables};

const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#222;--faint:#555;--rule:#ccc;--paper:#fff}
@media(prefers-color-scheme:dark){:root{--ink:#e6e6e6;--faint:#aaa;--rule:#444;--paper:#161616}}
body{font:16px/1.5 Helvetica,Arial,sans-serif;color:var(--ink);background:var(--paper);max-width:860px;margin:2em auto;padding:0 1em}
h1{font-size:1.6em}h2{font-size:1.25em;margin-top:2em;border-top:1px solid var(--rule);padding-top:.8em}
figure{margin:1.6em 0}svg{width:100%;height:auto;border:1px solid var(--rule)}
figcaption{font-size:.9em;color:var(--faint)}a{color:inherit}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.9em;margin:1em 0}
th,td{border-bottom:1px solid var(--rule);padding:.25em .7em;text-align:left}td.n{text-align:right;font-variant-numeric:tabular-nums}
@media print{svg{max-height:100mm}figure,tr{break-inside:avoid}}
";

/// The page of all charts and tables.
pub(super) fn page(charts: &[Chart], tables: &Tables) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write_page(&mut out, charts, tables);
    out
}

fn write_page(out: &mut String, charts: &[Chart], tables: &Tables) -> Result {
    writeln!(out, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">")?;
    writeln!(out, "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">")?;
    writeln!(out, "<title>The paper's figures and table</title>\n<style>\n{STYLE}</style></head><body>")?;
    writeln!(out, "<h1>The paper's figures and table</h1>")?;
    writeln!(
        out,
        "<p>What J. Kangro, S. Traversaro, D. Pucci and F. Nori show in \u{201c}Skin Normal Force Calibration Using \
         Vacuum Bags\u{201d}, drawn from these data: {}. The models are the paper's: the polynomial of order 5 with \
         the least squares over all samples of rising pressure, left as it is. Taxels are excluded by their swing \
         alone.</p>",
        escape(&tables.source)
    )?;
    writeln!(out, "<p>The tables: <a href=\"table.md\">table.md</a>, <a href=\"table.json\">table.json</a>.</p>")?;
    write_errors(out, tables)?;
    writeln!(out, "<h2>Figures</h2>")?;
    for chart in charts {
        let (id, caption) = (chart.id, escape(&chart.caption));
        writeln!(out, "<figure id=\"{id}\">\n{}", svg(chart))?;
        writeln!(out, "<figcaption>{caption} <a href=\"{id}.svg\">SVG</a></figcaption>\n</figure>")?;
    }
    if !tables.left_out.is_empty() {
        writeln!(out, "<h2>Left out, because the data cannot draw it</h2>\n<ul>")?;
        for left_out in &tables.left_out {
            writeln!(out, "<li>{}: {}</li>", escape(left_out.figure), escape(&left_out.why))?;
        }
        writeln!(out, "</ul>")?;
    }
    writeln!(out, "<h2>Calibration</h2>\n<div class=\"scroll\"><table>")?;
    for (what, value) in tables.calibration_rows() {
        writeln!(out, "<tr><th>{what}</th><td>{}</td></tr>", escape(&value))?;
    }
    writeln!(out, "</table></div>\n</body></html>")
}

fn write_errors(out: &mut String, tables: &Tables) -> Result {
    if tables.errors.is_empty() {
        return Ok(());
    }
    writeln!(out, "<h2>Force error of known loads</h2>")?;
    for errors in &tables.errors {
        let by = escape(&errors.by);
        writeln!(out, "<p>{by}</p>\n<div class=\"scroll\"><table><tr>")?;
        Errors::COLUMNS.iter().try_for_each(|column| write!(out, "<th>{column}</th>"))?;
        writeln!(out, "</tr>")?;
        for row in errors.cells() {
            write!(out, "<tr>")?;
            row.iter().try_for_each(|cell| write!(out, "<td class=\"n\">{}</td>", escape(cell)))?;
            writeln!(out, "</tr>")?;
        }
        writeln!(out, "</table></div>")?;
    }
    Ok(())
}
