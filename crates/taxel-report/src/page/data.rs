//! Figures and tables as CSV, with all digits.

use crate::document::{Cell, Figure, Table};

/// One row a point, and one a band with an empty `x`.
pub(super) fn figure_csv(figure: &Figure) -> anyhow::Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(["line", "mark", "x", "x_p5", "x_p95", "y", "x_label", "y_label"])?;
    let number = |value: f64| value.to_string();
    for line in &figure.lines {
        for point in &line.points {
            let (low, high) = point.x_spread.map_or_else(Default::default, |(low, high)| (number(low), number(high)));
            let (x, y) = (number(point.x), number(point.y));
            csv.write_record([&line.name, &point.mark, &x, &low, &high, &y, &figure.x.label, &figure.y.label])?;
        }
    }
    for band in &figure.bands {
        csv.write_record([band.label.as_str(), "band", "", "", "", &number(band.y), "", &figure.y.label])?;
    }
    Ok(csv.into_inner().map_err(csv::IntoInnerError::into_error)?)
}

/// Headings, then the rows.
pub(super) fn table_csv(table: &Table) -> anyhow::Result<Vec<u8>> {
    // Flexible: a row of the wrong length is still all there.
    let mut csv = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    csv.write_record(&table.columns)?;
    for row in &table.rows {
        csv.write_record(row.iter().map(|cell| match cell {
            Cell::Text(text) => text.clone(),
            Cell::Number(value) => value.to_string(),
            Cell::Verdict(pass) => verdict(*pass).to_owned(),
        }))?;
    }
    Ok(csv.into_inner().map_err(csv::IntoInnerError::into_error)?)
}

/// A verdict in words.
pub(super) fn verdict(pass: bool) -> &'static str {
    if pass { "pass" } else { "FAIL" }
}
