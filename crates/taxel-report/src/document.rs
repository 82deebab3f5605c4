//! What a report consists of: sections with text, aims, figures and tables, as data. How they look is the business of
//! `page` and `draw`.

use crate::numbers::three_digits;
use serde::Serialize;
use taxel_model::figure;

/// One section of the report, for example "Fit".
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// Short and stable, lower case: it begins the names of the section's files, for example `fit`. Whoever measures a
    /// section leaves it and the title to the list of all sections.
    pub id: String,
    /// The heading.
    pub title: String,
    /// Paragraphs of plain text above the figures: what was asked, how it was measured, what came out.
    pub text: Vec<String>,
    /// What was promised; those with a verdict are on the first screen.
    pub aims: Vec<Aim>,
    /// Diagrams.
    pub figures: Vec<Figure>,
    /// Tables beside that of the aims.
    pub tables: Vec<Table>,
}

/// Something measured that may have been promised.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Aim {
    /// For who reads it without the section around it, with its unit.
    pub what: String,
    /// `None` if it could not be measured.
    pub measured: Option<f64>,
    /// What was promised, in words.
    pub aim: String,
    /// Whether that holds.
    pub met: Option<bool>,
}

/// One diagram with its title and caption.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// Short and stable, lower case, unique in the report: the name of its files.
    pub id: String,
    /// Above it.
    pub title: String,
    /// Says how to read it.
    pub caption: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// One line a method.
    pub lines: Vec<Line>,
    /// Levels of the vertical axis that mean something, for example half a count.
    pub bands: Vec<Level>,
    /// The same of the horizontal axis.
    pub levels: Vec<Level>,
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
    /// How it is drawn.
    pub look: Look,
    /// In the order in which they are joined.
    pub points: Vec<Point>,
}

/// How points are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Look {
    /// Joined, each with a sign.
    #[default]
    Signs,
    /// Joined.
    Plain,
    /// Joined by a dashed line.
    Dashed,
    /// Each for itself.
    Dots,
    /// Each for itself, large, beside those of the other lines.
    Marks,
    /// From zero up, this wide in the unit of the horizontal axis.
    Bars(f64),
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

/// A place on an axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Level {
    /// Where.
    pub at: f64,
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
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A figure; shown with three significant digits.
    Number(f64),
    /// Whether a criterion holds; shown as `pass` or `FAIL`.
    Verdict(bool),
}

/// Cells of anything that a [`Cell`] can be made of.
macro_rules! row {
    ($($cell:expr),* $(,)?) => { vec![$($crate::document::Cell::from($cell)),*] };
}
pub(crate) use row;

impl Aim {
    /// A promise and whether it is kept.
    fn new(what: &str, measured: f64, aim: String, met: bool) -> Self {
        Self { what: what.to_owned(), measured: Some(measured).filter(|m| !m.is_nan()), aim, met: Some(met) }
    }

    /// A promise of a value that is no greater than `most`.
    pub(crate) fn at_most(what: &str, measured: f64, most: f64) -> Self {
        Self::new(what, measured, format!("at most {}", figure(most)), measured <= most)
    }

    /// A promise of a value that is no less than `least`.
    pub(crate) fn at_least(what: &str, measured: f64, least: f64) -> Self {
        Self::new(what, measured, format!("at least {}", figure(least)), measured >= least)
    }

    /// What was measured beside the promises.
    pub(crate) fn beside(what: &str, measured: f64) -> Self {
        Self { what: what.to_owned(), measured: Some(measured), ..Self::default() }
    }
}

impl Section {
    /// All tables, that of the aims first, if there are any.
    pub(crate) fn all_tables(&self) -> impl Iterator<Item = Table> {
        let row = |aim: &Aim| {
            let met = aim.met.map_or_else(|| Cell::from(""), Cell::from);
            let measured = aim.measured.map_or_else(|| Cell::from("not measured"), Cell::from);
            vec![aim.what.as_str().into(), measured, aim.aim.as_str().into(), met]
        };
        let rows: Vec<_> = self.aims.iter().map(row).collect();
        let columns = ["what", "measured", "aim", "met"];
        let aims = Table::new(&format!("{}-aims", self.id), "Measured, and what was promised.", columns, rows);
        std::iter::once(aims).filter(|table| !table.rows.is_empty()).chain(self.tables.iter().cloned())
    }
}

impl Table {
    /// With these headings and rows.
    pub fn new<T: Into<String>>(
        id: &str,
        caption: impl Into<String>,
        columns: impl IntoIterator<Item = T>,
        rows: Vec<Vec<Cell>>,
    ) -> Self {
        let columns = columns.into_iter().map(Into::into).collect();
        Self { id: id.to_owned(), caption: caption.into(), columns, rows }
    }
}

impl Axis {
    /// Divided evenly.
    #[must_use]
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), log: false }
    }

    /// Divided into decades.
    #[must_use]
    pub fn log(label: &str) -> Self {
        Self { label: label.to_owned(), log: true }
    }
}

impl Figure {
    /// With evenly divided axes of these labels.
    pub(crate) fn linear(
        id: &str,
        title: impl Into<String>,
        caption: impl Into<String>,
        [x, y]: [&str; 2],
        lines: Vec<Line>,
    ) -> Self {
        let (id, title, caption) = (id.to_owned(), title.into(), caption.into());
        Self { id, title, caption, x: Axis::linear(x), y: Axis::linear(y), lines, ..Self::default() }
    }
}

impl Line {
    /// Of bare points; what is not finite is left out.
    pub(crate) fn new(name: impl Into<String>, look: Look, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let finite = points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite());
        let points = finite.map(|(x, y)| Point { x, y, ..Point::default() }).collect();
        Self { name: name.into(), ours: false, look, points }
    }
}

impl Level {
    /// At a place.
    pub fn new(at: f64, label: impl Into<String>) -> Self {
        Self { at, label: label.into() }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<bool> for Cell {
    fn from(holds: bool) -> Self {
        Self::Verdict(holds)
    }
}

impl Cell {
    /// For people.
    pub(crate) fn words(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value) => three_digits(*value),
            Self::Verdict(holds) => if *holds { "pass" } else { "FAIL" }.to_owned(),
        }
    }
}
