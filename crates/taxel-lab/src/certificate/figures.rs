//! The figures of a certificate: its loads, and the curves of its best, middle and worst taxel.

use serde_json::Value;
use taxel_model::Curve;

use crate::document::{Axis, Figure, Line, Look};

const CURVE_POINTS: u32 = 60;

/// What is drawn of the rows of a field.
pub(super) fn figures(field: &str, rows: &Value) -> Vec<Figure> {
    match (field, rows.as_array().filter(|rows| !rows.is_empty())) {
        ("loads", Some(rows)) => vec![loads(rows)],
        ("taxels", Some(rows)) => vec![curves(rows)],
        _ => Vec::new(),
    }
}

fn figure(id: &str, title: &str, x: &'static str, y: &'static str, lines: Vec<Line>) -> Figure {
    let [x, y] = [x, y].map(|label| Axis { label, log: false });
    Figure { id: id.to_owned(), title: title.to_owned(), x, y, lines, ..Figure::default() }
}

fn loads(rows: &[Value]) -> Figure {
    let sum = |row: &Value, k: f64| {
        Some((row["load"].as_f64()?, row["read_n"].as_f64()? + k * row["read_sigma_n"].as_f64()?))
    };
    let read = |name: &str, look, k| Line::new(name, look, rows.iter().filter_map(move |row| sum(row, k)));
    let laid_on = rows.iter().filter_map(|row| Some((row["load"].as_f64()?, row["force_n"].as_f64()?)));
    let lines = vec![
        Line::new("laid on", Look::Signs, laid_on),
        read("read", Look::Ours, 0.0),
        read("read - 2 sigma", Look::Dashed, -2.0),
        read("read + 2 sigma", Look::Dashed, 2.0),
    ];
    figure("loads-read", "Known loads as they were read", "number of the load", "N", lines)
}

fn curves(rows: &[Value]) -> Figure {
    let mut rows: Vec<&Value> = rows.iter().collect();
    rows.sort_by(|a, b| a["rmse_kpa"].as_f64().unwrap_or(0.0).total_cmp(&b["rmse_kpa"].as_f64().unwrap_or(0.0)));
    let line = |row: &&Value| {
        let number = |name: &str| row[name].as_f64().unwrap_or(f64::NAN);
        let chebyshev = row["chebyshev_kpa"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
        let curve = Curve { centre: number("centre"), half_width: number("half_width"), chebyshev };
        let count = |k| {
            number("count_min") + (number("count_max") - number("count_min")) * f64::from(k) / f64::from(CURVE_POINTS)
        };
        let name = format!("taxel {} ({:.2} kPa)", row["taxel"], number("rmse_kpa"));
        Line::new(name, Look::Plain, (0..=CURVE_POINTS).map(|k| (count(k), curve.evaluate(count(k)))))
    };
    let mut drawn = vec![rows[0], rows[rows.len() / 2], rows[rows.len() - 1]];
    drawn.dedup_by_key(|row| row["taxel"].as_u64());
    figure(
        "curves",
        "Curves with the least, middle and greatest error",
        "count",
        "kPa",
        drawn.iter().map(line).collect(),
    )
}
