//! What a page consists of: sections with text, aims, figures and tables, as data. How they look is the business of
//! `page` and `svg`.

use serde::Serialize;
use taxel_model::figure;

use crate::numbers::three_digits;

/// One section of a page, for example "Fit".
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// Short, stable, lower case, for example `fit`.
    pub id: String,
    /// The heading.
    pub title: String,
    /// Paragraphs of plain text above the figures: what was asked, how it was measured, what came out.
    pub text: Vec<String>,
    /// What was promised; those with a verdict are on the first screen.
    pub aims: Vec<Aim>,
    /// Diagrams.
    pub figures: Vec<Figure>,
    /// Tables.
    pub tables: Vec<Table>,
}

/// Something measured that may have been promised.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Aim {
    /// For who reads it without the section around it, with its unit.
    pub what: String,
    /// What came out.
    pub measured: f64,
    /// What was promised, in words; empty for nothing.
    pub aim: String,
    /// Whether that holds.
    pub met: Option<bool>,
}

/// One diagram with its title and caption.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// Short, stable, lower case, unique on the page: the name of its file.
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
    /// Whether it is logarithmic.
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
    pub points: Vec<(f64, f64)>,
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
    /// From zero up, this wide in the unit of the horizontal axis.
    Bars(f64),
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
    /// Short, stable, lower case, unique on the page.
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
    /// A promise of a value that is no greater than `most`.
    pub(crate) fn at_most(what: &str, measured: f64, most: f64) -> Self {
        Self { what: what.to_owned(), measured, aim: format!("at most {}", figure(most)), met: Some(measured <= most) }
    }

    /// A promise of a value that is no less than `least`.
    pub(crate) fn at_least(what: &str, measured: f64, least: f64) -> Self {
        let (aim, met) = (format!("at least {}", figure(least)), Some(measured >= least));
        Self { what: what.to_owned(), measured, aim, met }
    }

    /// What was measured beside the promises.
    pub(crate) fn beside(what: &str, measured: f64) -> Self {
        Self { what: what.to_owned(), measured, ..Self::default() }
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

impl Line {
    /// Of these points.
    pub(crate) fn new(name: impl Into<String>, look: Look, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.into(), ours: false, look, points: points.into_iter().collect() }
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
