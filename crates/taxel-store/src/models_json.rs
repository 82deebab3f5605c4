//! MODELS.json: a model set as text, for export and import, for files, and as it lies in the store.
//!
//! Every finite f64 comes back bit for bit. The id is the hash of the content, so a file that was changed by accident is
//! refused; one that was changed on purpose has to drop its `id` and gets a new one. When a set was made, by what, and the
//! number of its session are no part of that content: the same samples fitted with the same options give the same id
//! whenever and wherever that is done.
//!
//! The names of fields here, in `taxel_engine::model_set` and in `taxel_model` are the format.

use std::collections::BTreeMap;
use std::fmt::Display;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::model_set::{EARLIER_MAX, Maker, ModelSet, Recalibrated, Recorded};
use taxel_engine::recalibration::{LoadPoint, POINTS_MAX};
use taxel_model::{Curve, Flag, GaugeUncertainty, Points, Quality, SigmaProfile, Sign, Status, TaxelModel, figure};
use thiserror::Error;

/// The word by which a file of this kind is known, and the version that is written and read.
const FORMAT: &str = "taxeld-models";
const VERSION: u64 = 1;

/// Longest text that is read or written. 2,880 taxels, all that fit on one bus, take 20 MB with every figure there is.
const TEXT_BYTES_MAX: usize = 32 << 20;

/// Longest string of a set, which lists show: the settings of a board with 16 modules take 800 bytes.
const WORDS_BYTES_MAX: usize = 2 << 10;

/// So many characters of a text that is not understood are shown.
const SHOWN_CHARS_MAX: usize = 200;

/// How the status of a taxel is written.
const STATUS_KEYS: [&str; 2] = ["status", "figures"];

/// Why a text is no model set, or a model set cannot be written: what, where, and what was expected.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct ModelsJsonError(String);

/// The file, field by field.
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
    #[serde(default)]
    fitted_by: String,
    #[serde(default)]
    simulated: bool,
    method: String,
    board_settings: Vec<String>,
    /// `null` for a taxel that never gave a value without a load; NaN in memory.
    baseline: Vec<Option<TaxelBaseline>>,
    pressure_max_kpa: f64,
    gauge_gain_rel: f64,
    gauge_offset_kpa: f64,
    #[serde(default)]
    dead_zone_kpa: f64,
    recorded: Option<Recorded>,
    recalibrated: Option<Recalibrated>,
    taxels: Vec<Entry>,
}

/// A taxel's model. `points`, else `curve`, is what the daemon serves from; `coefficients` are in ascending powers of the raw count.
#[derive(Serialize, Deserialize)]
struct Entry {
    taxel: usize,
    #[serde(flatten)]
    status: Status,
    /// The status in words, for people; not read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    order: u8,
    coefficients: Vec<f64>,
    range: Option<[f64; 2]>,
    sign: Sign,
    curve: Option<Curve>,
    /// The curve of a skin fit, served in place of `curve`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points: Option<Points>,
    sigma: Option<SigmaProfile>,
    gauge: GaugeUncertainty,
    quality: Quality,
    flags: Vec<Flag>,
    /// Keys that are none of these, which are refused: a key that nobody reads may be one that was meant otherwise.
    #[serde(flatten, skip_serializing)]
    others: BTreeMap<String, IgnoredAny>,
}

/// What tells the kind of a file, whatever else it holds.
#[derive(Deserialize)]
struct Kind {
    #[serde(default)]
    format: Value,
    #[serde(default)]
    version: Value,
}

/// Writes a model set: one line of what concerns all, then one line per taxel.
///
/// # Errors
/// [`ModelsJsonError`] if it contradicts itself or holds a number that is not finite: it could not be read again.
pub fn to_json(set: &ModelSet) -> Result<String, ModelsJsonError> {
    let text = text_of(&File { id: Some(set.id.clone()), ..File::of(set) }, set);
    from_json(&text)?;
    Ok(text)
}

/// Reads a model set. The order of keys and white space do not matter.
///
/// # Errors
/// [`ModelsJsonError`], with the place and what was expected.
pub fn from_json(text: &str) -> Result<ModelSet, ModelsJsonError> {
    // Some editors put the mark of an encoding before a text.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    ensure(text.len() <= TEXT_BYTES_MAX, || {
        format!("the text takes {} bytes, the limit is {TEXT_BYTES_MAX}", text.len())
    })?;
    // Of a file of another kind nothing else means anything.
    let kind: Kind = serde_json::from_str(text).map_err(|error| wrong(format!("not JSON: {error}")))?;
    ensure(kind.format == FORMAT && kind.version == VERSION, || {
        let Kind { format, version } = kind;
        format!("`format` is {format} and `version` is {version}, expected \"{FORMAT}\" and {VERSION}")
    })?;
    let file = serde_path_to_error::deserialize(&mut serde_json::Deserializer::from_str(text));
    let file: File = file.map_err(|error| wrong(format!("`{}`: {}", error.path(), error.inner())))?;
    let given = file.id.clone();
    let mut set = file.read()?;
    set.id = content_id(&set);
    match given {
        Some(given) if given != set.id => Err(wrong(format!(
            "`id` is {given}, but the content's id is {}: it was changed; remove `id` if that was meant",
            set.id
        ))),
        _ => Ok(set),
    }
}

/// Reads a model set that comes from elsewhere. Which session it says it was made in counts for nothing: the sessions there
/// are not those here, and nothing proves it.
///
/// # Errors
/// As [`from_json`].
pub fn from_elsewhere(text: &str) -> Result<ModelSet, ModelsJsonError> {
    from_json(text).map(|set| ModelSet { session: None, ..set })
}

/// The id of a set's content: `m-` and the first 16 hexadecimal digits of the SHA-256 of its text without `id`, with 0 for
/// `created_wall_ns`, `null` for `session`, and without what made it.
#[must_use]
pub fn content_id(set: &ModelSet) -> String {
    let content =
        File { created_wall_ns: 0, session: None, fitted_by: String::new(), simulated: false, ..File::of(set) };
    let hash = Sha256::digest(text_of(&content, set));
    hash[..8].iter().fold("m-".to_owned(), |id, byte| format!("{id}{byte:02x}"))
}

/// The text of a file with the set's taxels. Compact JSON of strings, numbers and lists: there is no error to lose.
fn text_of(head: &File, set: &ModelSet) -> String {
    let head = serde_json::to_string(head).unwrap_or_default();
    let line = |(taxel, model)| serde_json::to_string(&Entry::of(taxel, model)).unwrap_or_default();
    let lines: Vec<_> = set.taxels.iter().enumerate().map(line).collect();
    format!("{}\n{}\n]}}\n", head.strip_suffix("]}").unwrap_or(&head), lines.join(",\n"))
}

impl File {
    /// All but the id and the taxels.
    fn of(set: &ModelSet) -> Self {
        let baseline = |rest: &TaxelBaseline| (!rest.mean.is_nan() || !rest.noise.is_nan()).then_some(*rest);
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            id: None,
            patch: set.patch.clone(),
            created_wall_ns: set.created_wall_ns,
            session: set.session,
            fitted_by: set.maker.software.clone(),
            simulated: set.maker.simulated,
            method: set.method.clone(),
            board_settings: set.board_settings.clone(),
            baseline: set.baseline.iter().map(baseline).collect(),
            pressure_max_kpa: set.pressure_max_kpa,
            gauge_gain_rel: set.gauge_gain_rel,
            gauge_offset_kpa: set.gauge_offset_kpa,
            dead_zone_kpa: set.dead_zone_kpa,
            recorded: set.recorded.clone(),
            recalibrated: set.recalibrated.clone(),
            taxels: Vec::new(),
        }
    }

    /// The set, without its id.
    fn read(self) -> Result<ModelSet, ModelsJsonError> {
        let misplaced = self.taxels.iter().enumerate().find(|(taxel, entry)| entry.taxel != *taxel);
        ensure(misplaced.is_none(), || {
            format!("`taxels`: entry {} says that it is another `taxel`", misplaced.map_or(0, |of| of.0))
        })?;
        for (taxel, entry) in self.taxels.iter().enumerate() {
            let unknown = entry.others.keys().find(|key| !STATUS_KEYS.contains(&key.as_str()));
            ensure(unknown.is_none(), || {
                format!("`taxels[{taxel}]`: unknown field `{}`", unknown.map_or("", String::as_str))
            })?;
        }
        let set = ModelSet {
            id: String::new(),
            patch: self.patch,
            created_wall_ns: self.created_wall_ns,
            session: self.session,
            method: self.method,
            board_settings: self.board_settings,
            baseline: self.baseline.into_iter().map(|rest| rest.unwrap_or(TaxelBaseline::UNKNOWN)).collect(),
            pressure_max_kpa: self.pressure_max_kpa,
            gauge_gain_rel: self.gauge_gain_rel,
            gauge_offset_kpa: self.gauge_offset_kpa,
            dead_zone_kpa: self.dead_zone_kpa,
            taxels: self.taxels.into_iter().map(Entry::read).collect(),
            recorded: self.recorded,
            recalibrated: self.recalibrated,
            maker: Maker { software: self.fitted_by, simulated: self.simulated },
        };
        check(&set).map(|()| set)
    }
}

impl Entry {
    fn of(taxel: usize, model: &TaxelModel) -> Self {
        Self {
            taxel,
            status: model.status,
            reason: (!model.status.is_ok()).then(|| model.status.to_string()),
            order: model.order,
            coefficients: model.raw_coefficients.clone(),
            range: model.range,
            sign: model.sign,
            curve: model.curve.clone(),
            points: model.points.clone(),
            sigma: model.sigma.clone(),
            gauge: model.gauge,
            quality: model.quality.clone(),
            flags: model.flags.clone(),
            others: BTreeMap::new(),
        }
    }

    fn read(self) -> TaxelModel {
        TaxelModel {
            status: self.status,
            flags: self.flags,
            order: self.order,
            sign: self.sign,
            range: self.range,
            curve: self.curve,
            points: self.points,
            raw_coefficients: self.coefficients,
            sigma: self.sigma,
            gauge: self.gauge,
            quality: self.quality,
        }
    }
}

fn wrong(problem: impl Display) -> ModelsJsonError {
    let problem = problem.to_string();
    let end = problem.char_indices().nth(2 * SHOWN_CHARS_MAX).map(|(end, _)| format!("{}...", &problem[..end]));
    ModelsJsonError(end.unwrap_or(problem))
}

fn ensure(is_so: bool, problem: impl FnOnce() -> String) -> Result<(), ModelsJsonError> {
    if is_so { Ok(()) } else { Err(wrong(problem())) }
}

/// What is NaN is not there.
fn at_least(place: &str, value: f64, least: f64) -> Result<(), ModelsJsonError> {
    ensure(value.is_nan() || value >= least, || format!("`{place}` is {}, expected {least} or more", figure(value)))
}

/// Everything that a type cannot say. Numbers that are read are finite.
fn check(set: &ModelSet) -> Result<(), ModelsJsonError> {
    let taxels = set.taxels.len();
    ensure(!set.patch.is_empty(), || "`patch` is empty, expected the name of a patch".to_owned())?;
    ensure((1..=usize::from(u16::MAX)).contains(&taxels), || {
        format!("`taxels` has {taxels} entries, expected 1 to {}", u16::MAX)
    })?;
    for (list, given) in
        [("baseline", Some(set.baseline.len())), ("recorded.taxels", set.recorded.as_ref().map(|of| of.taxels.len()))]
    {
        ensure(given.is_none_or(|given| given == taxels), || {
            format!("`{list}` has {} entries, expected {taxels}, one per taxel", given.unwrap_or_default())
        })?;
    }
    for words in [&set.patch, &set.method].into_iter().chain(&set.board_settings) {
        ensure(words.len() <= WORDS_BYTES_MAX, || {
            format!("a text of {} bytes, the limit is {WORDS_BYTES_MAX}: {words}", words.len())
        })?;
    }
    at_least("gauge_gain_rel", set.gauge_gain_rel, 0.0)?;
    at_least("gauge_offset_kpa", set.gauge_offset_kpa, 0.0)?;
    at_least("dead_zone_kpa", set.dead_zone_kpa, 0.0)?;
    set.recorded.as_ref().map_or(Ok(()), check_recorded)?;
    set.recalibrated.as_ref().map_or(Ok(()), check_recalibrated)?;
    for (taxel, (rest, model)) in set.baseline.iter().zip(&set.taxels).enumerate() {
        at_least(&format!("baseline[{taxel}].noise"), rest.noise, 0.0)?;
        check_taxel(model).map_err(|problem| wrong(format!("taxel {taxel}: {problem}")))?;
    }
    Ok(())
}

fn check_recorded(recorded: &Recorded) -> Result<(), ModelsJsonError> {
    ensure(recorded.module_size > 0, || "`recorded.module_size` is 0, expected 1 or more".to_owned())?;
    at_least("recorded.smooth_s", recorded.smooth_s, 0.0)?;
    at_least("recorded.plays_mean_s", recorded.plays_mean_s, 0.0)?;
    for (number, taxel) in recorded.taxels.iter().enumerate() {
        let Some(taxel) = taxel else { continue };
        let of = |name: &str| format!("recorded.taxels[{number}].{name}");
        at_least(&of("sensitivity"), taxel.sensitivity, f64::MIN_POSITIVE)?;
        let Some(plays) = &taxel.plays else { continue };
        for value in plays.radii_counts.iter().chain(&plays.weights_kpa).chain([&plays.slack_counts]) {
            at_least(&of("plays"), *value, 0.0)?;
        }
        at_least(&of("plays.range"), plays.range[1], plays.range[0])?;
    }
    Ok(())
}

fn check_recalibrated(of: &Recalibrated) -> Result<(), ModelsJsonError> {
    for (list, entries, most) in [("earlier", of.earlier.len(), EARLIER_MAX), ("points", of.points.len(), POINTS_MAX)] {
        ensure(entries <= most, || format!("`recalibrated.{list}` has {entries} entries, the limit is {most}"))?;
    }
    let (above, sigma) = (f64::MIN_POSITIVE, 0.0);
    for (name, value, least) in [
        ("gain", of.gain, above),
        ("gain_in_all", of.gain_in_all, above),
        ("area_mm2", of.area_mm2, above),
        ("gain_sigma", of.gain_sigma, sigma),
        ("place_rel", of.place_rel, sigma),
        ("relative_sigma", of.relative_sigma, sigma),
    ] {
        at_least(&format!("recalibrated.{name}"), value, least)?;
    }
    let problem = of.points.iter().find_map(LoadPoint::problem);
    problem.map_or(Ok(()), |problem| Err(wrong(format!("`recalibrated.points`: {problem}"))))
}

fn check_taxel(model: &TaxelModel) -> Result<(), String> {
    model.validate().map_err(|error| error.to_string())?;
    if model.status.is_ok() && model.sigma.is_none() {
        return Err("`sigma` has no values, which a model in use needs".to_owned());
    }
    let terms = model.curve.as_ref().map_or(0, |curve| curve.chebyshev.len());
    if (model.raw_coefficients.len(), usize::from(model.order)) != (terms, terms.saturating_sub(1)) {
        let (given, order) = (model.raw_coefficients.len(), model.order);
        return Err(format!("`curve` has {terms} terms, `coefficients` has {given}, and `order` is {order}"));
    }
    let of_points = model.points.as_ref().and(model.curve.as_ref());
    // The polynomial beside points has a range of its own.
    let own = of_points.map(|curve| [curve.centre - curve.half_width, curve.centre + curve.half_width]);
    match (&model.curve, own.or(model.range)) {
        (Some(curve), Some(range)) => check_coefficients(&model.raw_coefficients, curve, range),
        _ => Ok(()),
    }
}

/// Two polynomials that agree at one place more than their order are the same.
fn check_coefficients(coefficients: &[f64], curve: &Curve, [low, high]: [f64; 2]) -> Result<(), String> {
    let terms = coefficients.len();
    for place in 0..=terms {
        let count = low + (high - low) * place as f64 / terms as f64;
        let (printed, error) = horner(coefficients, count);
        let served = curve.evaluate(count);
        let error = error + ROUNDING * curve.chebyshev.iter().map(|c| c.abs()).sum::<f64>();
        // Of what overflows nothing can be told, and it agrees with nothing.
        if !error.is_finite() || !served.is_finite() || (printed - served).abs() > error {
            let [count, printed, served] = [count, printed, served].map(figure);
            return Err(format!(
                "at count {count} `coefficients` give {printed} kPa and `curve` gives {served} kPa: they are not the \
                 same polynomial (the daemon serves `curve`)"
            ));
        }
    }
    Ok(())
}

/// Bound on the relative rounding of an evaluation at order 10, with a factor in hand: 64 x 2^-52.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The polynomial in powers of the count, and what its evaluation may be off by: gamma_2n sum |a_k| |C|^k
/// (Higham, Accuracy and Stability of Numerical Algorithms, 2002, 5.1).
fn horner(coefficients: &[f64], count: f64) -> (f64, f64) {
    let value = coefficients.iter().rev().fold(0.0, |sum, a| sum * count + a);
    let size = coefficients.iter().rev().fold(0.0, |sum, a| sum * count.abs() + a.abs());
    (value, ROUNDING * size)
}
