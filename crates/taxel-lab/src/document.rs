//! What a page consists of: sections with text, aims, figures and tables, as data. How they look is the business of
//! `page` and `svg`.

use serde::Serialize;
use serde_json::Value;
use taxel_model::figure;

use crate::numbers::digits;

/// Figures of a table have so many significant digits.
const DIGITS: usize = 4;

/// One section of a page, for example "Force".
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// Short, stable, lower case, for example `force`.
    pub id: String,
    /// The heading.
    pub title: String,
    /// Paragraphs of plain text above the figures: what was asked, how it was measured, what came out.
    pub text: Vec<String>,
    /// What was promised; on the first screen.
    pub aims: Vec<Aim>,
    /// Diagrams.
    pub figures: Vec<Figure>,
    /// Tables.
    pub tables: Vec<Table>,
}

/// A promise and what was measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Aim {
    /// For who reads it without the section around it, with its unit.
    pub what: String,
    /// What came out.
    pub measured: f64,
    /// What was promised, in words.
    pub aim: String,
    /// Whether that holds.
    pub met: bool,
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
    /// Places on the horizontal axis that mean something, and what.
    pub levels: Vec<(f64, String)>,
}

/// An axis.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Axis {
    /// Quantity and unit, for example `us per taxel`.
    pub label: &'static str,
    /// Whether it is logarithmic.
    pub log: bool,
}

/// One method in a diagram.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Line {
    /// As the legend shows it.
    pub name: String,
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
    /// The same, stronger.
    Ours,
    /// Joined.
    Plain,
    /// Joined by a dashed line.
    Dashed,
    /// Each for itself.
    Dots,
    /// From zero up, this wide in the unit of the horizontal axis.
    Bars(f64),
    /// Discs of this colour on a map: both axes have one scale.
    Discs(&'static str),
    /// Crosses on a map.
    Crosses,
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
    /// Texts, numbers and verdicts.
    pub rows: Vec<Vec<Value>>,
}

/// Cells of anything that JSON has.
macro_rules! row {
    ($($cell:expr),* $(,)?) => { vec![$(::serde_json::Value::from($cell)),*] };
}
pub(crate) use row;

impl Aim {
    /// A promise of a value that is no greater than `most`.
    pub(crate) fn at_most(what: &str, measured: f64, most: f64) -> Self {
        Self { what: what.to_owned(), measured, aim: format!("at most {}", figure(most)), met: measured <= most }
    }
}

impl Table {
    /// With these headings and rows.
    pub(crate) fn new<T: Into<String>>(
        id: &str,
        caption: impl Into<String>,
        columns: impl IntoIterator<Item = T>,
        rows: Vec<Vec<Value>>,
    ) -> Self {
        let columns = columns.into_iter().map(Into::into).collect();
        Self { id: id.to_owned(), caption: caption.into(), columns, rows }
    }
}

impl Line {
    /// Of these points.
    pub(crate) fn new(name: impl Into<String>, look: Look, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.into(), look, points: points.into_iter().collect() }
    }
}

/// A cell for people; a number that is none (infinite, not a number) is `none`.
pub(crate) fn words(cell: &Value) -> String {
    match cell {
        Value::Null => "none".to_owned(),
        Value::Bool(holds) => if *holds { "pass" } else { "FAIL" }.to_owned(),
        Value::Number(value) => value.as_f64().map_or_else(String::new, |value| digits(value, DIGITS)),
        Value::String(text) => text.clone(),
        Value::Array(all) => all.iter().map(words).collect::<Vec<_>>().join(", "),
        Value::Object(_) => cell.to_string(),
    }
}
