//! What a report consists of: sections with text, figures and tables, as data. How they look is the business of `page`.

use serde::Serialize;

/// One section of the report, for example "A. Fit".
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// Short and stable, lower case: it begins the names of the section's files, for example `a-fit`.
    pub id: String,
    /// The heading.
    pub title: String,
    /// Paragraphs of plain text above the figures: what was asked, how it was measured, what came out.
    pub text: Vec<String>,
    /// Diagrams.
    pub figures: Vec<Figure>,
    /// Tables.
    pub tables: Vec<Table>,
}

/// One diagram with its caption.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// Short and stable, lower case, unique in the report: the name of its SVG, CSV and JSON files.
    pub id: String,
    /// Says how to read it.
    pub caption: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// One line a method.
    pub lines: Vec<Line>,
    /// Levels of the vertical axis that mean something, for example half a count.
    pub bands: Vec<Band>,
}

/// An axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Axis {
    /// Quantity and unit, for example `us per taxel`.
    pub label: String,
    /// Whether it is logarithmic; values that are not above 0 are then drawn at the edge and say so.
    pub log: bool,
}

/// One method in a diagram.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Line {
    /// As the legend shows it.
    pub name: String,
    /// Whether it is ours: drawn stronger.
    pub ours: bool,
    /// In the order in which they are joined.
    pub points: Vec<Point>,
}

/// One measurement.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Point {
    /// On the horizontal axis: the median, if there were several runs.
    pub x: f64,
    /// 5 and 95 % points of the runs, if there were several.
    pub x_spread: Option<(f64, f64)>,
    /// On the vertical axis.
    pub y: f64,
    /// The knob's value here, for example the order; empty for none.
    pub mark: String,
}

/// A level of the vertical axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Band {
    /// Where.
    pub y: f64,
    /// What it means.
    pub label: String,
}

/// A table.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Table {
    /// Short and stable, lower case, unique in the report: the name of its CSV and JSON files.
    pub id: String,
    /// Says how to read it.
    pub caption: String,
    /// Headings with units.
    pub columns: Vec<String>,
    /// As many cells as columns.
    pub rows: Vec<Vec<Cell>>,
}

/// What stands in a table.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A figure; shown with three significant digits.
    Number(f64),
    /// Whether a criterion holds; shown as `pass` or `FAIL`.
    Verdict(bool),
}
