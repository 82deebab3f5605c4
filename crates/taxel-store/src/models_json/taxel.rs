//! One taxel's entry in MODELS.json.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use taxel_model::bounded::{List, Text};
use taxel_model::{
    Curve, Estimator, Flag, GaugeUncertainty, MAX_ORDER, Quality, SigmaProfile, Sign, Status, TERMS_MAX, TaxelModel,
    figure,
};

use super::limits::{FLAGS_MAX, WORDS_BYTES_MAX, shown};

/// A string of an entry.
type Words = Text<WORDS_BYTES_MAX>;

/// The entry, field by field; the names are the format. `curve` is what the daemon serves from.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    taxel: usize,
    /// `ok`, or the word for why the curve may not be used.
    status: Words,
    /// The status in words, for people; not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reason: Option<Words>,
    /// The numbers that belong to the status.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    figures: Map<String, Value>,
    order: u8,
    /// Ascending powers of the raw count, a + b C + c C^2 + ...; `null` without a curve.
    coefficients: Option<List<f64, TERMS_MAX>>,
    range: Option<[f64; 2]>,
    sign: Words,
    curve: Option<Curve>,
    sigma: Option<SigmaProfile>,
    estimator: Words,
    repaired: bool,
    gauge: GaugeUncertainty,
    quality: Quality,
    flags: List<Flag, FLAGS_MAX>,
}

/// The entry of a model.
pub(super) fn mirror(taxel: usize, model: &TaxelModel) -> Entry {
    Entry {
        taxel,
        status: Text(model.status.code().to_owned()),
        reason: (!model.status.is_ok()).then(|| Text(model.status.to_string())),
        figures: status_figures(&model.status),
        order: model.order,
        coefficients: (!model.raw_coefficients.is_empty()).then(|| List(model.raw_coefficients.clone())),
        range: model.range,
        sign: Text(sign_name(model.sign).to_owned()),
        curve: model.curve.clone(),
        sigma: model.sigma.clone(),
        estimator: Text(model.estimator.name().to_owned()),
        repaired: model.repaired,
        gauge: model.gauge,
        quality: model.quality.clone(),
        flags: List(model.flags.clone()),
    }
}

/// The model of an entry, which must be the one of `taxel`. What [`check`] looks at is not looked at here.
pub(super) fn read(taxel: usize, entry: Entry) -> Result<TaxelModel, String> {
    if entry.taxel != taxel {
        return Err(format!("its entry says `taxel` {}, expected {taxel}", entry.taxel));
    }
    Ok(TaxelModel {
        status: status(&entry.status.0, entry.figures)?,
        flags: entry.flags.0,
        estimator: named("estimator", &entry.estimator.0, &Estimator::ALL, Estimator::name)?,
        order: entry.order,
        sign: named("sign", &entry.sign.0, &[Sign::Rising, Sign::Falling], sign_name)?,
        range: entry.range,
        curve: entry.curve,
        raw_coefficients: entry.coefficients.map(|list| list.0).unwrap_or_default(),
        sigma: entry.sigma,
        gauge: entry.gauge,
        quality: entry.quality,
        repaired: entry.repaired,
    })
}

const fn sign_name(sign: Sign) -> &'static str {
    match sign {
        Sign::Rising => "rising",
        Sign::Falling => "falling",
    }
}

/// The one of `all` that `word` names.
fn named<T: Copy>(field: &str, word: &str, all: &[T], name: impl Fn(T) -> &'static str) -> Result<T, String> {
    all.iter().copied().find(|&one| name(one) == word).ok_or_else(|| {
        let known: Vec<_> = all.iter().map(|&one| name(one)).collect();
        format!("`{field}` is \"{word}\", expected {}", known.join(" or "))
    })
}

/// The numbers of a status, by name: what its own serialisation holds beside the name of the variant.
fn status_figures(status: &Status) -> Map<String, Value> {
    match serde_json::to_value(status) {
        Ok(Value::Object(variant)) => match variant.into_iter().next() {
            Some((_, Value::Object(figures))) => figures,
            _ => Map::new(),
        },
        _ => Map::new(),
    }
}

/// The status of a word and its numbers. The word is the variant's name in small letters with `_` between its parts.
fn status(code: &str, figures: Map<String, Value>) -> Result<Status, String> {
    let variant: String = code
        .split('_')
        .filter_map(|part| part.split_at_checked(1))
        .map(|(first, rest)| first.to_ascii_uppercase() + rest)
        .collect();
    let given = figures.clone();
    let value = if figures.is_empty() { json!(variant) } else { json!({ variant: figures }) };
    let status: Status = serde_json::from_value(value)
        .map_err(|error| format!("`status` \"{code}\" and its `figures`: {}", shown(&error.to_string())))?;
    if status.code() != code {
        return Err(format!("`status` is \"{code}\", expected \"{}\"", status.code()));
    }
    match given.keys().find(|name| !status_figures(&status).contains_key(*name)) {
        Some(name) => Err(format!("`figures` of status \"{code}\" has no `{name}`")),
        None => Ok(status),
    }
}

/// Everything that a model's types cannot say.
pub(super) fn check(model: &TaxelModel) -> Result<(), String> {
    if model.order > MAX_ORDER {
        return Err(format!("`order` is {}, expected 0 to {MAX_ORDER}", model.order));
    }
    if let Some([low, high]) = model.range
        && low > high
    {
        return Err(format!("`range` goes from {} to {}, expected it ascending", figure(low), figure(high)));
    }
    if let Some(sigma) = &model.sigma {
        if sigma.step_counts <= 0.0 {
            let step = figure(sigma.step_counts);
            return Err(format!("`step_counts` of `sigma` is {step}, expected a positive number"));
        }
        if sigma.sigma_kpa.is_empty() || sigma.sigma_kpa.iter().any(|sigma| *sigma < 0.0) {
            return Err("`sigma_kpa` of `sigma` is empty or negative somewhere, expected 0 or more".to_owned());
        }
    }
    match (&model.curve, model.range) {
        (Some(curve), Some(range)) => check_curve(model, curve, range)?,
        (Some(_), None) => return Err("it has a `curve` but no `range`".to_owned()),
        (None, _) if !model.raw_coefficients.is_empty() || model.order != 0 => {
            return Err("it has `coefficients` or an `order` but no `curve`".to_owned());
        }
        (None, _) => {}
    }
    if model.status.is_ok() && (model.curve.is_none() || model.sigma.is_none()) {
        return Err("its `status` is \"ok\", but `curve`, `range` or `sigma` is missing".to_owned());
    }
    Ok(())
}

fn check_curve(model: &TaxelModel, curve: &Curve, [low, high]: [f64; 2]) -> Result<(), String> {
    let terms = usize::from(model.order) + 1;
    if curve.half_width <= 0.0 {
        let half_width = figure(curve.half_width);
        return Err(format!("`half_width` of `curve` is {half_width}, expected a positive number"));
    }
    if curve.chebyshev.len() != terms {
        let given = curve.chebyshev.len();
        return Err(format!("`curve` has {given} terms, expected {terms} for `order` {}", model.order));
    }
    if model.raw_coefficients.len() != terms {
        let given = model.raw_coefficients.len();
        return Err(format!("`coefficients` has {given} entries, expected {terms} for `order` {}", model.order));
    }
    // Two polynomials that agree at one place more than their order are the same.
    for place in 0..=terms {
        let count = low + (high - low) * place as f64 / terms as f64;
        let (printed, error) = horner(&model.raw_coefficients, count);
        let served = curve.evaluate(count);
        if !served.is_finite() {
            return Err(format!("`curve` gives {served} kPa at count {}, expected a finite number", figure(count)));
        }
        let error = error + ROUNDING * curve.chebyshev.iter().map(|c| c.abs()).sum::<f64>();
        // Of what overflows nothing can be told, and it agrees with nothing.
        if !error.is_finite() || (printed - served).abs() > error {
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
