//! MODELS.json: a model set as text, for export and import, for files, and as the blob in the store.
//!
//! Every finite f64 comes back bit for bit. The id is the hash of the content, so a file that was changed by accident is
//! refused; one that was changed on purpose has to drop its `id` and gets a new one.

mod recorded;
mod taxel;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::model_set::ModelSet;
use thiserror::Error;

/// The word by which a file of this kind is known.
pub const FORMAT: &str = "taxeld-models";

/// The version that is written and read.
pub const VERSION: u64 = 1;

/// Most taxels of a set: their numbers are 16 bit.
const TAXELS_MAX: usize = u16::MAX as usize;

/// Why a text is no model set, or a model set cannot be written.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ModelsJsonError {
    /// It is no JSON; the parser's words, with line and column.
    #[error("not JSON: {0}")]
    Syntax(String),
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

/// The file, field by field. Taxels are read one by one, so that an error names the taxel.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    version: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    id: Option<String>,
    patch: String,
    created_wall_ns: i64,
    session: Option<u64>,
    method: String,
    board_settings: Vec<String>,
    /// `null` for a taxel that never gave a value at rest; NaN in memory.
    baseline: Vec<Option<Baseline>>,
    pressure_max_kpa: f64,
    gauge_gain_rel: f64,
    gauge_offset_kpa: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    recorded: Option<recorded::Part>,
    taxels: Vec<Value>,
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
    check(set)?;
    let taxels = taxel_lines(set);
    let content = hash(set, &taxels);
    if set.id != content {
        return Err(ModelsJsonError::Id { given: set.id.clone(), content });
    }
    let head = head(set, Some(content));
    let head = head.strip_suffix("[]}").unwrap_or(&head);
    Ok(format!("{head}[\n{}\n]}}\n", taxels.join(",\n")))
}

/// Reads a model set. The order of keys and white space do not matter.
///
/// # Errors
/// [`ModelsJsonError`], with the place and what was expected.
pub fn from_json(text: &str) -> Result<ModelSet, ModelsJsonError> {
    let value: Value = serde_json::from_str(text).map_err(|error| ModelsJsonError::Syntax(error.to_string()))?;
    check_kind(&value)?;
    let file: File = serde_json::from_value(value).map_err(|error| ModelsJsonError::Set(error.to_string()))?;
    let taxels: Result<Vec<_>, _> = file
        .taxels
        .into_iter()
        .enumerate()
        .map(|(taxel, value)| taxel::read(taxel, value).map_err(|problem| ModelsJsonError::Taxel { taxel, problem }))
        .collect();
    let absent = TaxelBaseline { mean: f64::NAN, noise: f64::NAN };
    let mut set = ModelSet {
        id: String::new(),
        patch: file.patch,
        created_wall_ns: file.created_wall_ns,
        session: file.session,
        method: file.method,
        board_settings: file.board_settings,
        baseline: file
            .baseline
            .into_iter()
            .map(|rest| rest.map_or(absent, |Baseline { mean, noise }| TaxelBaseline { mean, noise }))
            .collect(),
        pressure_max_kpa: file.pressure_max_kpa,
        gauge_gain_rel: file.gauge_gain_rel,
        gauge_offset_kpa: file.gauge_offset_kpa,
        taxels: taxels?,
        recorded: file.recorded.map(recorded::Part::read),
    };
    check(&set)?;
    set.id = content_id(&set);
    match file.id {
        Some(given) if given != set.id => Err(ModelsJsonError::Id { given, content: set.id }),
        _ => Ok(set),
    }
}

/// The id of a set's content: `m-` and the first 16 hexadecimal digits of the SHA-256 of its compact JSON without `id`.
#[must_use]
pub fn content_id(set: &ModelSet) -> String {
    hash(set, &taxel_lines(set))
}

/// The id, given the lines of the taxels.
fn hash(set: &ModelSet, taxel_lines: &[String]) -> String {
    let mut hash = Sha256::new();
    hash.update(head(set, None));
    taxel_lines.iter().for_each(|line| hash.update(line));
    hash.finalize()[..8].iter().fold("m-".to_owned(), |id, byte| format!("{id}{byte:02x}"))
}

/// Everything but the taxels, as one line that ends with an empty list of them.
fn head(set: &ModelSet, id: Option<String>) -> String {
    let baseline = |rest: &TaxelBaseline| {
        let known = !rest.mean.is_nan() || !rest.noise.is_nan();
        known.then_some(Baseline { mean: rest.mean, noise: rest.noise })
    };
    let file = File {
        format: FORMAT.to_owned(),
        version: VERSION,
        id,
        patch: set.patch.clone(),
        created_wall_ns: set.created_wall_ns,
        session: set.session,
        method: set.method.clone(),
        board_settings: set.board_settings.clone(),
        baseline: set.baseline.iter().map(baseline).collect(),
        pressure_max_kpa: set.pressure_max_kpa,
        gauge_gain_rel: set.gauge_gain_rel,
        gauge_offset_kpa: set.gauge_offset_kpa,
        recorded: set.recorded.as_ref().map(recorded::Part::mirror),
        taxels: Vec::new(),
    };
    to_text(&file)
}

fn taxel_lines(set: &ModelSet) -> Vec<String> {
    set.taxels.iter().enumerate().map(|(taxel, model)| to_text(&taxel::mirror(taxel, model))).collect()
}

/// Compact JSON. Strings, numbers and lists with text keys have one always; there is no error to lose.
fn to_text(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Kind and version come first: of a file of another kind nothing else means anything.
fn check_kind(value: &Value) -> Result<(), ModelsJsonError> {
    let found = |key: &str| value.get(key).map_or("missing".to_owned(), Value::to_string);
    if value.get("format").and_then(Value::as_str) != Some(FORMAT) {
        return Err(ModelsJsonError::Format(found("format")));
    }
    if value.get("version").and_then(Value::as_u64) != Some(VERSION) {
        return Err(ModelsJsonError::Version(found("version")));
    }
    Ok(())
}

/// Everything that a type cannot say: the same for what is read and what is written.
fn check(set: &ModelSet) -> Result<(), ModelsJsonError> {
    let wrong = |problem: String| Err(ModelsJsonError::Set(problem));
    if set.patch.is_empty() {
        return wrong("`patch` is empty, expected the name of a patch".to_owned());
    }
    if !(1..=TAXELS_MAX).contains(&set.taxels.len()) {
        return wrong(format!("`taxels` has {} entries, expected 1 to {TAXELS_MAX}", set.taxels.len()));
    }
    if set.baseline.len() != set.taxels.len() {
        let (given, expected) = (set.baseline.len(), set.taxels.len());
        return wrong(format!("`baseline` has {given} entries, expected {expected}, one per taxel"));
    }
    if !set.pressure_max_kpa.is_finite() {
        return wrong(format!("`pressure_max_kpa` is {}, expected a finite number", set.pressure_max_kpa));
    }
    for (name, value) in [("gauge_gain_rel", set.gauge_gain_rel), ("gauge_offset_kpa", set.gauge_offset_kpa)] {
        if !(value.is_finite() && value >= 0.0) {
            return wrong(format!("`{name}` is {value}, expected a finite number of 0 or more"));
        }
    }
    if let Some(recorded) = &set.recorded {
        recorded::check(recorded, set.taxels.len()).map_err(ModelsJsonError::Set)?;
    }
    for (taxel, (rest, model)) in set.baseline.iter().zip(&set.taxels).enumerate() {
        let known = rest.mean.is_finite() && rest.noise.is_finite() && rest.noise >= 0.0;
        let absent = rest.mean.is_nan() && rest.noise.is_nan();
        if !(known || absent) {
            let problem = format!("its baseline is {} with noise {}, expected finite numbers", rest.mean, rest.noise);
            return Err(ModelsJsonError::Taxel { taxel, problem });
        }
        taxel::check(model).map_err(|problem| ModelsJsonError::Taxel { taxel, problem })?;
    }
    Ok(())
}
