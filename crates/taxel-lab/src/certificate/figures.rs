//! The figures of a certificate: its loads, the skin with the fit error of each taxel, and the curves of the best, middle and
//! worst one.

use serde_json::Value;
use taxel_model::Curve;

use crate::document::{Axis, Figure, Line, Look};
use crate::numbers::digits;
use crate::svg::nice_step;

const CURVE_POINTS: u32 = 60;

/// From little to much, also apart in grey.
const COLOURS: [&str; 8] = ["#dcebc2", "#b4dcbb", "#82c8b4", "#4fb0b4", "#3592b1", "#2f70a6", "#2c4c90", "#2c1e5c"];

/// What is drawn beside the rows of a field.
pub(super) fn figures(field: &str, certificate: &Value) -> Vec<Figure> {
    match (field, certificate[field].as_array().filter(|rows| !rows.is_empty())) {
        ("loads", Some(rows)) if rows.len() > 1 => vec![loads(rows)], // the table is enough for one
        ("taxels", Some(rows)) => map(rows, certificate).into_iter().chain([curves(rows)]).collect(),
        _ => Vec::new(),
    }
}

/// The skin laid flat: each taxel by its fit error, and those that are excluded. `None` where nobody says where they are.
fn map(rows: &[Value], certificate: &Value) -> Option<Figure> {
    let places: Vec<[f64; 2]> = serde_json::from_value(certificate["places_mm"].clone()).ok()?;
    let [across, down] = [0, 1].map(|axis| {
        let all = places.iter().map(move |place| place[axis]);
        (all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max))
    });
    // Turned by a quarter if it is higher than wide. What runs down there runs up here.
    let is_high = down.1 - down.0 > across.1 - across.0;
    let laid = |[x, y]: [f64; 2]| if is_high { (y - down.0, x - across.0) } else { (x - across.0, down.1 - y) };
    let place = |row: &Value| Some(laid(*places.get(usize::try_from(row["taxel"].as_u64()?).ok()?)?));
    let error = |row: &Value| row["rmse_kpa"].as_f64().unwrap_or(0.0);
    let step = nice_step(rows.iter().map(error).fold(0.1, f64::max));
    let class = |row: &Value| ((error(row) / step).ceil() as usize).clamp(1, COLOURS.len()) - 1;
    let of_class = |(at, colour): (usize, &&'static str)| {
        let name = format!("fit error {} to {} kPa", digits(at as f64 * step, 2), digits((at + 1) as f64 * step, 2));
        Line::new(name, Look::Discs(colour), rows.iter().filter(|row| class(row) == at).filter_map(place))
    };
    let mut lines: Vec<Line> = COLOURS.iter().enumerate().map(of_class).collect();
    lines.retain(|line| !line.points.is_empty());
    let excluded = certificate["excluded"].as_array().into_iter().flatten();
    lines.push(Line::new("excluded", Look::Crosses, excluded.filter_map(place)));
    Some(figure("map", "The skin laid flat, seen from outside: fit error of each taxel", "mm", "mm", lines))
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
