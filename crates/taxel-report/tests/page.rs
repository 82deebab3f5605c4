//! The files of a report.

use std::path::Path;
use taxel_report::document::{Aim, Axis, Cell, Figure, Level, Line, Point, Section, Table};
use taxel_report::machine::Machine;
use taxel_report::page;

fn section(id: &str) -> Section {
    let points =
        (0..30).map(|k| Point { x: f64::from(k), y: f64::from(k * k) - 0.125, mark: k.to_string(), x_spread: None });
    let figure = Figure {
        id: format!("{id}-figure"),
        title: "time < error".to_owned(),
        caption: "errors < 1 & \"times\" > 2 </figcaption><script>alert(1)</script>".to_owned(),
        x: Axis::log("x"),
        y: Axis::log("y <b>"),
        lines: vec![Line {
            name: "a, \"quoted\" <name>".to_owned(),
            ours: true,
            points: points.collect(),
            ..Line::default()
        }],
        bands: vec![Level::new(3.0, "half a count")],
        levels: Vec::new(),
    };
    let row = |pass| vec![Cell::Text("a < b, c".to_owned()), Cell::Number(1.0 / 3.0), Cell::Verdict(pass)];
    let table = Table::new(&format!("{id}-table"), "a <table>", ["case", "us", "holds"], vec![row(true), row(false)]);
    let aim = |what: &str, met| Aim { what: what.to_owned(), measured: Some(0.25), aim: "<= 1".to_owned(), met };
    Section {
        id: id.to_owned(),
        title: "A & B. Title".to_owned(),
        text: vec!["first <p>".to_owned(), "second".to_owned()],
        aims: vec![aim("kept & told", Some(true)), aim("missed", Some(false)), aim("unjudged", None)],
        figures: vec![figure],
        tables: vec![table],
    }
}

fn read(folder: &Path, name: &str) -> std::io::Result<String> {
    std::fs::read_to_string(folder.join(name))
}

#[test]
fn all_files_are_there_and_whole() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new/report");
    page::write(&out, &Machine::default(), &[section("a"), section("b")]).unwrap();
    for id in ["a", "b"] {
        let csv = read(&out, &format!("{id}-figure.csv")).unwrap();
        assert_eq!(csv.lines().count(), 1 + 30 + 1);
        assert!(csv.contains("\"a, \"\"quoted\"\" <name>\",29,29.0,,,840.875,"), "{csv}");
        let json: serde_json::Value = serde_json::from_str(&read(&out, &format!("{id}-figure.json")).unwrap()).unwrap();
        assert_eq!(json["lines"][0]["points"].as_array().unwrap().len(), 30);
        assert!(read(&out, &format!("{id}-figure.svg")).unwrap().starts_with("<svg "));
        let csv = read(&out, &format!("{id}-table.csv")).unwrap();
        assert_eq!(csv.lines().nth(2).unwrap(), "\"a < b, c\",0.3333333333333333,FAIL");
        serde_json::from_str::<serde_json::Value>(&read(&out, &format!("{id}-table.json")).unwrap()).unwrap();
    }
    let json: serde_json::Value = serde_json::from_str(&read(&out, "report.json").unwrap()).unwrap();
    assert_eq!(json["sections"].as_array().unwrap().len(), 2);
    let left_over = std::fs::read_dir(&out)
        .unwrap()
        .filter(|file| file.as_ref().unwrap().file_name().to_string_lossy().ends_with(".part"));
    assert_eq!(left_over.count(), 0);
}

#[test]
fn no_text_becomes_markup() {
    let folder = tempfile::tempdir().unwrap();
    page::write(folder.path(), &Machine::default(), &[section("a")]).unwrap();
    let page = read(folder.path(), "index.html").unwrap();
    for text in ["<script", "<name>", "<b>", "a < b", "<table>\n</caption", "errors < 1", "first <p>"] {
        assert!(!page.contains(text), "{text}");
    }
    assert!(page.contains("first &lt;p&gt;") && page.contains("<svg ") && page.contains("0.333"));
    assert!(page.contains(">FAIL<") && page.contains(">pass<"));
    // The first screen has what was promised, and nothing else.
    let first = page.split("<section").next().unwrap();
    assert!(first.contains("1 of 2 aims are met") && first.contains("kept &amp; told") && first.contains(">missed<"));
    assert!(!first.contains("unjudged") && read(folder.path(), "a-aims.json").unwrap().contains("unjudged"));
    // Self-contained: links to data are the only other files, and nothing is fetched.
    assert!(!page.contains("src=") && !page.contains("http-equiv") && !page.contains("<link"));
}

#[test]
fn ids_that_would_overwrite_each_other_are_told_and_lose_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let error = page::write(&out, &Machine::default(), &[section("a"), section("a"), section("../b")]).unwrap_err();
    for id in ["a-figure", "a-table", "../b-figure"] {
        assert!(error.to_string().contains(id), "{error}");
    }
    assert!(read(&out, "index.html").unwrap().contains("../b-figure") && read(&out, "a-figure.csv").is_ok());
    assert!(!folder.path().join("b-figure.csv").exists());
}
