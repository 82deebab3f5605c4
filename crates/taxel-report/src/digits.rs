//! Section D: correct digits on the polynomial sets of NIST's Statistical Reference Datasets.
//!
//! The measure is the log relative error of the worst coefficient in powers of the raw abscissa, against the exact
//! solution for the decimals as they are written.

mod sets;

use crate::document::{Cell, Section, Table};
use crate::markup::three_digits;
use crate::numpy::Numpy;
use crate::options::Options;
use crate::peers::{Polynomial, fit_chebyshev_qr, fit_raw_normal, fit_raw_qr, fit_raw_svd};
use crate::reference::{Reference, exact, to_f64};
use crate::work_precision::start_numpy;
use num_bigint::BigInt;
use num_rational::BigRational;
use sets::{Set, correct_digits};
use taxel_model::{Dd, FitOptions, Order, Samples, Shape, fit, parse_decimal};

/// Measures section D.
///
/// # Errors
/// A file of a set cannot be read as one, or Python ended in the middle of it.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let folder = options.data.as_ref().map(|data| data.join("strd"));
    let sets = sets::all(folder.as_deref())?;
    let (mut numpy, numpy_text) = start_numpy(options);
    let mut rows: Vec<(&'static str, Vec<Option<f64>>)> = Vec::new();
    for (at, set) in sets.iter().enumerate() {
        for (k, (method, digits)) in digits_of_all(set, &mut numpy)?.into_iter().enumerate() {
            if at == 0 {
                rows.push((method, Vec::new()));
            }
            rows[k].1.push(digits);
        }
    }
    let text = vec![
        "How many digits of the worst coefficient are correct, in powers of the raw abscissa? An f64 holds 16. Decimals \
         such as 0.1 are not exact as f64: the row `limit` is the exact solution of the decimals so rounded, which no \
         method that takes f64 can beat but by luck. Ours can also take the decimals as they are written."
            .to_owned(),
        numpy_text,
        agreement(&sets),
        worst_in_words(&rows),
    ];
    Ok(Section {
        id: "d-digits".to_owned(),
        title: "D. Digits: certified regression sets".to_owned(),
        text,
        figures: Vec::new(),
        tables: vec![table(&sets, &rows)],
    })
}

/// All methods on one set, `None` where one finds no solution.
fn digits_of_all(set: &Set, numpy: &mut Option<Numpy>) -> anyhow::Result<Vec<(&'static str, Option<f64>)>> {
    let (x, y) = set.rounded()?;
    let parts = |texts: &[String]| -> Option<(Vec<f64>, Vec<f64>)> {
        texts.iter().map(|text| parse_decimal(text).map(|Dd { hi, lo }| (hi, lo))).collect()
    };
    let as_written = |exact| {
        let (x, y) = (parts(&set.x)?, parts(&set.y)?);
        let (counts_low, pressure_low) = (Some(x.1.as_slice()), Some(y.1.as_slice()));
        ours(set, Samples { counts_low, pressure_low, ..Samples::new(&x.0, &y.0) }, exact)
    };
    let score = |polynomial: Option<Polynomial>| correct_digits(&raw_coefficients(&polynomial?)?, &set.exact);
    let limit = || {
        let rounded: Vec<f64> = Reference::fit(&x, &y, None, set.order)?.coefficients().iter().map(to_f64).collect();
        correct_digits(&rounded, &set.exact)
    };
    let mut all = vec![
        ("ours, decimals as written", as_written(false)),
        ("ours, exact, decimals as written", as_written(true)),
        ("ours, decimals rounded to f64", ours(set, Samples::new(&x, &y), false)),
        ("limit of decimals rounded to f64", limit()),
        ("scaled Chebyshev, nalgebra QR", score(fit_chebyshev_qr(&x, &y, None, set.order))),
        ("nalgebra QR, raw powers", score(fit_raw_qr(&x, &y, None, set.order))),
        ("nalgebra SVD, raw powers", score(fit_raw_svd(&x, &y, None, set.order))),
        ("normal equations, raw powers", score(fit_raw_normal(&x, &y, None, set.order))),
    ];
    if let Some(numpy) = numpy {
        numpy.load(&y, &[&x])?;
        let coefficients = numpy.fit(0, set.order)?.coefficients();
        all.push(("numpy.polyfit", coefficients.and_then(|c| correct_digits(&c, &set.exact))));
    }
    Ok(all)
}

/// The plain least-squares solution of ours.
fn ours(set: &Set, samples: Samples<'_>, exact: bool) -> Option<f64> {
    let order = Order::Fixed(set.order as u8);
    let model = fit(&samples, &FitOptions { order, exact, shape: Shape::Report, ..FitOptions::default() });
    correct_digits(&model.raw_coefficients, &set.exact)
}

/// A peer's coefficients in powers of the raw abscissa; the conversion itself is exact, so that only the result is
/// rounded.
fn raw_coefficients(polynomial: &Polynomial) -> Option<Vec<f64>> {
    let (centre, half_width, series) = match polynomial {
        Polynomial::Raw { coefficients } => return Some(coefficients.clone()),
        Polynomial::Chebyshev { centre, half_width, coefficients } => {
            (exact(*centre)?, exact(*half_width)?, coefficients)
        }
    };
    let zero = BigRational::from_integer(BigInt::ZERO);
    // t times a polynomial in x, where t = (x - centre) / half_width.
    let times_t = |p: &[BigRational]| -> Vec<BigRational> {
        let shifted = std::iter::once(&zero).chain(p);
        shifted.zip(p.iter().chain([&zero])).map(|(up, same)| (up - &centre * same) / &half_width).collect()
    };
    let mut sum = vec![zero.clone(); series.len()];
    let (mut last, mut now) = (Vec::new(), vec![BigRational::from_integer(BigInt::from(1))]);
    for (k, c) in series.iter().enumerate() {
        let c = exact(*c)?;
        sum.iter_mut().zip(&now).for_each(|(sum, term)| *sum += &c * term);
        // T_{k+1} = 2 t T_k - T_{k-1}, but T_1 = t.
        let factor = BigRational::from_integer(BigInt::from(if k == 0 { 1 } else { 2 }));
        let mut next: Vec<BigRational> = times_t(&now).iter().map(|term| term * &factor).collect();
        next.iter_mut().zip(&last).for_each(|(next, last)| *next -= last);
        (last, now) = (now, next);
    }
    Some(sum.iter().map(to_f64).collect())
}

/// How well the exact solutions agree with what NIST certified.
fn agreement(sets: &[Set]) -> String {
    let digits = sets.iter().filter_map(|set| correct_digits(set.certified.as_deref()?, &set.exact));
    let digits: Vec<f64> = digits.collect();
    let definitions = "Wampler's sets are computed from their published definition.";
    match digits.iter().copied().reduce(f64::min) {
        None => format!("{definitions} No certified values are at hand to compare the exact solutions with."),
        Some(worst) => format!(
            "{definitions} The exact solutions agree with NIST's certified values, which have 15 digits, to {} digits or \
             more in all {} sets whose certified values are at hand.",
            three_digits(worst),
            digits.len()
        ),
    }
}

fn worst_in_words(rows: &[(&'static str, Vec<Option<f64>>)]) -> String {
    let worst = |digits: &[Option<f64>]| digits.iter().map(|d| d.unwrap_or(0.0)).reduce(f64::min).unwrap_or(f64::NAN);
    let words: Vec<String> =
        rows.iter().map(|(method, digits)| format!("{method}: {}", three_digits(worst(digits)))).collect();
    format!("Digits on the hardest set of each: {}.", words.join("; "))
}

fn table(sets: &[Set], rows: &[(&'static str, Vec<Option<f64>>)]) -> Table {
    let name = |set: &Set| format!("{} ({})", set.name, set.order);
    let cell = |digits: &Option<f64>| digits.map_or_else(|| Cell::Text("no solution".to_owned()), Cell::Number);
    let row = |(method, digits): &(&'static str, Vec<Option<f64>>)| {
        std::iter::once(Cell::Text((*method).to_owned())).chain(digits.iter().map(cell)).collect()
    };
    Table {
        id: "d-digits-strd".to_owned(),
        caption: "Correct digits of the worst coefficient, 0 to 16. Sets with their order in brackets.".to_owned(),
        columns: std::iter::once("method".to_owned()).chain(sets.iter().map(name)).collect(),
        rows: rows.iter().map(row).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chebyshev_series_becomes_powers() {
        // 1 + 2 t + 3 (2 t^2 - 1), t = (x - 4) / 2.
        let series = Polynomial::Chebyshev { centre: 4.0, half_width: 2.0, coefficients: vec![1.0, 2.0, 3.0] };
        assert_eq!(raw_coefficients(&series).unwrap(), [18.0, -11.0, 1.5]);
    }

    #[test]
    fn ours_has_all_digits_of_every_set_that_needs_no_file() {
        for set in sets::all(None).unwrap() {
            let digits = digits_of_all(&set, &mut None).unwrap();
            for (method, digits) in &digits[..2] {
                assert!(digits.unwrap() > 15.6, "{} {method} {digits:?}", set.name);
            }
            // Rounded decimals limit everybody.
            let (rounded, limit) = (digits[2].1.unwrap(), digits[3].1.unwrap());
            assert!(rounded > limit - 0.5, "{} {rounded} {limit}", set.name);
        }
    }
}
