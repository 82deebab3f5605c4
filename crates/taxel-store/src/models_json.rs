//! MODELS.json: a model set as text, for export and import, for files, and as the blob in the store.
//!
//! Every finite f64 comes back bit for bit. The id is the hash of the content, so a file that was changed by accident is
//! refused; one that was changed on purpose has to drop its `id` and gets a new one. When a set was made, and the number of
//! its session, are no part of that content: the same samples fitted with the same options give the same id whenever and
//! wherever that is done.
//!
//! A text is read once, straight into the set that it describes, and every string and list of it has a bound: what a
//! hostile text can cost is a few times its own size.

pub(crate) mod limits;
mod recalibrated;
mod recorded;
mod taxel;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::model_set::{Maker, ModelSet};
use taxel_model::bounded::{List, Text};
use thiserror::Error;

use limits::{SETTINGS_MAX, TAXELS_MAX, WORDS_BYTES_MAX, check_length, shown};

/// The word by which a file of this kind is known.
pub const FORMAT: &str = "taxeld-models";

/// The version that is written and read.
pub const VERSION: u64 = 1;

/// Why a text is no model set, or a model set cannot be written.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ModelsJsonError {
    /// It is no JSON; the parser's words, with line and column.
    #[error("not JSON: {0}")]
    Syntax(String),
    /// More than is read: what, where, and the limit.
    #[error("{0}")]
    TooLarge(String),
    /// It is JSON, but not a file of this kind.
    #[error("`format` is {0}, expected \"{FORMAT}\"")]
    Format(String),
    /// Another version of this format.
    #[error("`version` is {0}, this programme reads version {VERSION}")]
    Version(String),
    /// A field of the set is missing or cannot be so.
    #[error("{0}")]
    Set(String),
    /// Something about one taxel is missing or cannot be so.
    #[error("taxel {taxel}: {problem}")]
    Taxel {
        /// Its number.
        taxel: usize,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// The content is not the one that the id was made for.
    #[error("`id` is {given}, but the content's id is {content}: it was changed; remove `id` if that was meant")]
    Id {
        /// The id in the file.
        given: String,
        /// The id that the content has.
        content: String,
    },
}

/// A string of a set.
type Words = Text<WORDS_BYTES_MAX>;

/// The file, field by field.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: Words,
    version: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    id: Option<Words>,
    patch: Words,
    created_wall_ns: i64,
    session: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fitted_by: Option<Words>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    simulated: bool,
    method: Words,
    board_settings: List<Words, SETTINGS_MAX>,
    /// `null` for a taxel that never gave a value at rest; NaN in memory.
    baseline: List<Option<Baseline>, TAXELS_MAX>,
    pressure_max_kpa: f64,
    gauge_gain_rel: f64,
    gauge_offset_kpa: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    recorded: Option<recorded::Part>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    recalibrated: Option<recalibrated::Part>,
    taxels: List<taxel::Entry, TAXELS_MAX>,
}

/// What tells the kind of a file, whatever else it holds.
#[derive(Deserialize)]
struct Kind {
    #[serde(default)]
    format: Value,
    #[serde(default)]
    version: Value,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Baseline {
    mean: f64,
    noise: f64,
}

/// Writes a model set: one line of what concerns all, then one line per taxel.
///
/// # Errors
/// [`ModelsJsonError`] if it contradicts itself or holds a number that is not finite: it could not be read again.
pub fn to_json(set: &ModelSet) -> Result<String, ModelsJsonError> {
    let (head, mut content) = (head(set, Some(&set.id), Origin::of(set)), Id::begin(set));
    let mut text = head.strip_suffix("]}").unwrap_or(&head).to_owned();
    for (taxel, model) in set.taxels.iter().enumerate() {
        let line = to_text(&taxel::mirror(taxel, model));
        content.add(&line);
        text += if taxel == 0 { "\n" } else { ",\n" };
        text += &line;
    }
    text += "\n]}\n";
    // What cannot be read again is not written: all limits, and that a number that is not finite is `null`, show there.
    read(&text)?;
    let content = content.end();
    if content == set.id {
        return Ok(text);
    }
    Err(ModelsJsonError::Id { given: set.id.clone(), content })
}

/// Reads a model set. The order of keys and white space do not matter.
///
/// # Errors
/// [`ModelsJsonError`], with the place and what was expected.
pub fn from_json(text: &str) -> Result<ModelSet, ModelsJsonError> {
    let (mut set, given) = read(text)?;
    let mut content = Id::begin(&set);
    for (taxel, model) in set.taxels.iter().enumerate() {
        content.add(&to_text(&taxel::mirror(taxel, model)));
    }
    let content = content.end();
    set.id = match given {
        Some(given) if content == given => given,
        Some(given) => return Err(ModelsJsonError::Id { given, content }),
        None => content,
    };
    Ok(set)
}

/// Reads a model set that comes from elsewhere. Which session it says it was made in counts for nothing: the sessions there
/// are not those here, and nothing proves it.
///
/// # Errors
/// As [`from_json`].
pub fn from_elsewhere(text: &str) -> Result<ModelSet, ModelsJsonError> {
    from_json(text).map(of_no_session)
}

/// The same models of no session.
#[must_use]
pub fn of_no_session(set: ModelSet) -> ModelSet {
    ModelSet { session: None, ..set }
}

/// The set, without an id, and the id that the text gives.
fn read(text: &str) -> Result<(ModelSet, Option<String>), ModelsJsonError> {
    // Some editors put the mark of an encoding before a text.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    check_length(text.len()).map_err(ModelsJsonError::TooLarge)?;
    check_kind(text)?;
    let file: File =
        serde_path_to_error::deserialize(&mut serde_json::Deserializer::from_str(text)).map_err(located)?;
    let taxels: Result<Vec<_>, _> = file
        .taxels
        .0
        .into_iter()
        .enumerate()
        .map(|(taxel, entry)| taxel::read(taxel, entry).map_err(|problem| ModelsJsonError::Taxel { taxel, problem }))
        .collect();
    let absent = TaxelBaseline { mean: f64::NAN, noise: f64::NAN };
    let baseline =
        |rest: Option<Baseline>| rest.map_or(absent, |Baseline { mean, noise }| TaxelBaseline { mean, noise });
    let set = ModelSet {
        id: String::new(),
        patch: file.patch.0,
        created_wall_ns: file.created_wall_ns,
        session: file.session,
        method: file.method.0,
        board_settings: file.board_settings.0.into_iter().map(|line| line.0).collect(),
        baseline: file.baseline.0.into_iter().map(baseline).collect(),
        pressure_max_kpa: file.pressure_max_kpa,
        gauge_gain_rel: file.gauge_gain_rel,
        gauge_offset_kpa: file.gauge_offset_kpa,
        taxels: taxels?,
        recorded: file.recorded.map(recorded::Part::read),
        recalibrated: file.recalibrated.map(|part| part.0),
        maker: Maker { software: file.fitted_by.map(|words| words.0).unwrap_or_default(), simulated: file.simulated },
    };
    check(&set)?;
    Ok((set, file.id.map(|id| id.0)))
}

/// An error of the parser with the place in the file, which is JSON; one in the list of taxels names the taxel.
fn located(error: serde_path_to_error::Error<serde_json::Error>) -> ModelsJsonError {
    let path = error.path().to_string();
    let words = shown(&error.into_inner().to_string());
    let of_taxel = path.strip_prefix("taxels[").and_then(|rest| rest.split_once(']'));
    match of_taxel.and_then(|(taxel, rest)| Some((taxel.parse().ok()?, rest.trim_start_matches('.')))) {
        Some((taxel, "")) => ModelsJsonError::Taxel { taxel, problem: words },
        Some((taxel, field)) => ModelsJsonError::Taxel { taxel, problem: format!("{words}, in `{}`", shown(field)) },
        None => ModelsJsonError::Set(format!("{words}, in `{}`", shown(&path))),
    }
}

/// The id of a set's content: `m-` and the first 16 hexadecimal digits of a SHA-256. Hashed are the compact JSON without
/// `id`, with 0 for `created_wall_ns`, `null` for `session`, without what made it (`fitted_by`, `simulated`), and with an empty list of taxels, and then that of each taxel.
#[must_use]
pub fn content_id(set: &ModelSet) -> String {
    let mut content = Id::begin(set);
    for (taxel, model) in set.taxels.iter().enumerate() {
        content.add(&to_text(&taxel::mirror(taxel, model)));
    }
    content.end()
}

/// When, in which session and by what a set was made.
#[derive(Clone, Copy)]
struct Origin<'a> {
    wall_ns: i64,
    session: Option<u64>,
    maker: Option<&'a Maker>,
}

impl<'a> Origin<'a> {
    /// What stands in its place where it must not matter.
    const NONE: Self = Self { wall_ns: 0, session: None, maker: None };

    const fn of(set: &'a ModelSet) -> Self {
        Self { wall_ns: set.created_wall_ns, session: set.session, maker: Some(&set.maker) }
    }
}

/// The id of a set on its way: the head, then the line of each taxel.
struct Id(Sha256);

impl Id {
    fn begin(set: &ModelSet) -> Self {
        Self(Sha256::new_with_prefix(head(set, None, Origin::NONE)))
    }

    fn add(&mut self, line: &str) {
        self.0.update(line);
    }

    fn end(self) -> String {
        self.0.finalize()[..8].iter().fold("m-".to_owned(), |id, byte| format!("{id}{byte:02x}"))
    }
}

/// Everything but the taxels, as one line that ends with an empty list of them.
fn head(set: &ModelSet, id: Option<&str>, origin: Origin<'_>) -> String {
    let words = |text: &str| Text(text.to_owned());
    let baseline = |rest: &TaxelBaseline| {
        let known = !rest.mean.is_nan() || !rest.noise.is_nan();
        known.then_some(Baseline { mean: rest.mean, noise: rest.noise })
    };
    let file = File {
        format: words(FORMAT),
        version: VERSION,
        id: id.map(words),
        patch: words(&set.patch),
        created_wall_ns: origin.wall_ns,
        session: origin.session,
        fitted_by: origin.maker.map(|maker| &maker.software).filter(|name| !name.is_empty()).map(|name| words(name)),
        simulated: origin.maker.is_some_and(|maker| maker.simulated),
        method: words(&set.method),
        board_settings: List(set.board_settings.iter().map(|line| words(line)).collect()),
        baseline: List(set.baseline.iter().map(baseline).collect()),
        pressure_max_kpa: set.pressure_max_kpa,
        gauge_gain_rel: set.gauge_gain_rel,
        gauge_offset_kpa: set.gauge_offset_kpa,
        recorded: set.recorded.as_ref().map(recorded::Part::mirror),
        recalibrated: set.recalibrated.clone().map(recalibrated::Part),
        taxels: List(Vec::new()),
    };
    to_text(&file)
}

/// Compact JSON. Strings, numbers and lists with text keys have one always; there is no error to lose.
fn to_text(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Kind and version come first: of a file of another kind nothing else means anything.
fn check_kind(text: &str) -> Result<(), ModelsJsonError> {
    let kind: Kind = serde_json::from_str(text).map_err(|error| ModelsJsonError::Syntax(shown(&error.to_string())))?;
    let found = |value: &Value| if value.is_null() { "missing".to_owned() } else { shown(&value.to_string()) };
    if kind.format != FORMAT {
        return Err(ModelsJsonError::Format(found(&kind.format)));
    }
    if kind.version != VERSION {
        return Err(ModelsJsonError::Version(found(&kind.version)));
    }
    Ok(())
}

/// Everything that a type cannot say. Numbers that are read are finite.
fn check(set: &ModelSet) -> Result<(), ModelsJsonError> {
    let wrong = |problem: String| Err(ModelsJsonError::Set(problem));
    if set.patch.is_empty() {
        return wrong("`patch` is empty, expected the name of a patch".to_owned());
    }
    if set.taxels.is_empty() {
        return wrong("`taxels` has 0 entries, expected 1 or more".to_owned());
    }
    if set.baseline.len() != set.taxels.len() {
        let (given, expected) = (set.baseline.len(), set.taxels.len());
        return wrong(format!("`baseline` has {given} entries, expected {expected}, one per taxel"));
    }
    for (name, value) in [("gauge_gain_rel", set.gauge_gain_rel), ("gauge_offset_kpa", set.gauge_offset_kpa)] {
        if value < 0.0 {
            return wrong(format!("`{name}` is {value}, expected 0 or more"));
        }
    }
    if let Some(recorded) = &set.recorded {
        recorded::check(recorded, set.taxels.len()).map_err(ModelsJsonError::Set)?;
    }
    if let Some(recalibrated) = &set.recalibrated {
        recalibrated::check(recalibrated).map_err(ModelsJsonError::Set)?;
    }
    for (taxel, (rest, model)) in set.baseline.iter().zip(&set.taxels).enumerate() {
        if rest.noise < 0.0 {
            let problem = format!("its baseline has noise {}, expected 0 or more", rest.noise);
            return Err(ModelsJsonError::Taxel { taxel, problem });
        }
        taxel::check(model).map_err(|problem| ModelsJsonError::Taxel { taxel, problem })?;
    }
    Ok(())
}
