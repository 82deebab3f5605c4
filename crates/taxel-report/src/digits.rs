//! Section `digits`: correct digits on the polynomial sets of NIST's Statistical Reference Datasets.
//!
//! The measure is the log relative error of the worst coefficient in powers of the raw abscissa, against the exact
//! solution for the decimals as they are written.

use std::path::Path;

use anyhow::Context as _;
use num_rational::BigRational;
use taxel_model::reference::{Reference, correct_digits, exact, integer, to_f64};
use taxel_model::stability::strd::{Set, built_in};
use taxel_model::{FitOptions, Order, Samples, fit};

use crate::document::{Cell, Section, Table};
use crate::numbers::three_digits;
use crate::options::Options;
use crate::peers::{self, Basis, Peers, Polynomial};

/// A method with its digits by set, `None` where it finds no solution.
type Row = (&'static str, Vec<Option<f64>>);

/// Measures the section.
///
/// # Errors
/// A file of a set cannot be read as one, or Python ended in the middle of it.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let folder = options.data.as_ref().map(|data| data.join("strd"));
    let sets = sets(folder.as_deref())?;
    let mut peers = Peers::start(&options.python);
    let columns = sets.iter().map(|set| digits_of_all(set, &mut peers)).collect::<anyhow::Result<Vec<_>>>()?;
    let row = |k: usize| (columns[0][k].0, columns.iter().map(|column| column[k].1).collect());
    let rows: Vec<Row> = (0..columns[0].len()).map(row).collect();
    let text = vec![
        "How many digits of the worst coefficient are correct, in powers of the raw abscissa? An f64 holds 16. Decimals \
         such as 0.1 are not exact as f64: the row `limit` is the exact solution of the decimals so rounded, which no \
         method that takes f64 can beat but by luck. Ours can also take the decimals as they are written."
            .to_owned(),
        peers.said.clone(),
        agreement(&sets, folder.as_deref()),
        worst_in_words(&rows),
    ];
    Ok(Section { text, tables: vec![table(&sets, &rows)], ..Section::default() })
}

/// All sets that are at hand: those that need no file always, others from `folder`.
fn sets(folder: Option<&Path>) -> anyhow::Result<Vec<Set>> {
    let mut sets = Vec::new();
    for (name, order) in [("norris", 1), ("pontius", 2)] {
        let Some(text) = read(folder, &format!("{name}.csv")) else { continue };
        sets.push(Set::parse(name, order, &text).with_context(|| format!("{name}.csv is no set of decimals x,y"))?);
    }
    sets.extend(built_in());
    Ok(sets)
}

fn read(folder: Option<&Path>, name: &str) -> Option<String> {
    std::fs::read_to_string(folder?.join(name)).ok()
}

/// All methods on one set.
fn digits_of_all(set: &Set, peers: &mut Peers) -> anyhow::Result<Vec<(&'static str, Option<f64>)>> {
    let (x, y) = set.parts();
    let rounded = Samples::new(&x.0, &y.0);
    let as_written = Samples { counts_low: Some(&x.1), pressure_low: Some(&y.1), ..rounded };
    // A short set is never binned: this is what the shipped default does with it, but for the order.
    let ours = |samples: &Samples<'_>, exact: bool| {
        let options = FitOptions { order: Order::Fixed(set.order as u8), exact, ..FitOptions::default() };
        correct_digits(&fit(samples, &options).raw_coefficients, &set.exact)
    };
    let limit = || {
        let exact = Reference::fit(&x.0, &y.0, None, set.order)?.coefficients();
        correct_digits(&exact.iter().map(to_f64).collect::<Vec<_>>(), &set.exact)
    };
    let mut all = vec![
        ("ours, decimals as written (shipped default)", ours(&as_written, false)),
        ("ours, exact, decimals as written", ours(&as_written, true)),
        ("ours, decimals rounded to f64", ours(&rounded, false)),
        ("limit of decimals rounded to f64", limit()),
    ];
    for name in peers.names() {
        let curve = peers.fit(name, &peers::Samples { x: &x.0, y: &y.0, w: None }, set.order)?.curve;
        let raw = curve.and_then(|curve| raw_coefficients(&curve));
        all.push((name, raw.and_then(|raw| correct_digits(&raw, &set.exact))));
    }
    Ok(all)
}

/// A peer's coefficients in powers of the raw abscissa; the conversion itself is exact, so that only the result is
/// rounded.
fn raw_coefficients(polynomial: &Polynomial) -> Option<Vec<f64>> {
    let (centre, half_width) = (exact(polynomial.centre)?, exact(polynomial.half_width)?);
    let zero = integer(0);
    // t times a polynomial in x, where t = (x - centre) / half_width.
    let times_t = |p: &[BigRational]| -> Vec<BigRational> {
        let shifted = std::iter::once(&zero).chain(p);
        shifted.zip(p.iter().chain([&zero])).map(|(up, same)| (up - &centre * same) / &half_width).collect()
    };
    let mut sum = vec![zero.clone(); polynomial.coefficients.len()];
    let (mut last, mut now) = (Vec::new(), vec![integer(1)]);
    for (k, c) in polynomial.coefficients.iter().enumerate() {
        let c = exact(*c)?;
        sum.iter_mut().zip(&now).for_each(|(sum, term)| *sum += &c * term);
        let mut next = times_t(&now);
        // T_{k+1} = 2 t T_k - T_{k-1}, but T_1 = t.
        if polynomial.basis == Basis::Chebyshev && k > 0 {
            next.iter_mut().for_each(|term| *term *= integer(2));
            next.iter_mut().zip(&last).for_each(|(next, last): (_, &BigRational)| *next -= last);
        }
        (last, now) = (now, next);
    }
    Some(sum.iter().map(to_f64).collect())
}

/// How well the exact solutions agree with what NIST certified.
fn agreement(sets: &[Set], folder: Option<&Path>) -> String {
    let value = |line: &str| line.split(',').nth(1).and_then(|value| value.parse().ok());
    let digits = sets.iter().filter_map(|set| {
        let text = read(folder, &format!("{}.certified.csv", set.name))?;
        correct_digits(&text.lines().skip(1).map(value).collect::<Option<Vec<f64>>>()?, &set.exact)
    });
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

fn worst_in_words(rows: &[Row]) -> String {
    let worst = |digits: &[Option<f64>]| digits.iter().map(|d| d.unwrap_or(0.0)).reduce(f64::min).unwrap_or(f64::NAN);
    let words: Vec<String> =
        rows.iter().map(|(method, digits)| format!("{method}: {}", three_digits(worst(digits)))).collect();
    format!("Digits on the hardest set of each: {}.", words.join("; "))
}

fn table(sets: &[Set], rows: &[Row]) -> Table {
    let names = sets.iter().map(|set| format!("{} ({})", set.name, set.order));
    let cell = |digits: &Option<f64>| digits.map_or_else(|| "no solution".into(), Cell::from);
    let row = |(method, digits): &Row| std::iter::once((*method).into()).chain(digits.iter().map(cell)).collect();
    Table::new(
        "digits-strd",
        "Correct digits of the worst coefficient, 0 to 16. Sets with their order in brackets.",
        std::iter::once("method".to_owned()).chain(names),
        rows.iter().map(row).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_polynomials_become_powers() {
        // t = (x - 4) / 2, and 1 + 2 t + 3 (2 t^2 - 1) or 1 + 2 t + 3 t^2.
        let scaled = |basis| Polynomial { basis, centre: 4.0, half_width: 2.0, coefficients: vec![1.0, 2.0, 3.0] };
        assert_eq!(raw_coefficients(&scaled(Basis::Chebyshev)).unwrap(), [18.0, -11.0, 1.5]);
        assert_eq!(raw_coefficients(&scaled(Basis::Powers)).unwrap(), [9.0, -5.0, 0.75]);
    }

    #[test]
    fn rounded_decimals_limit_everybody() {
        let mut peers = Peers::start(Path::new("nowhere"));
        for set in built_in() {
            let digits = digits_of_all(&set, &mut peers).unwrap();
            let (rounded, limit) = (digits[2].1.unwrap(), digits[3].1.unwrap());
            assert!(rounded > limit - 0.5, "{} {rounded} {limit}", set.name);
        }
    }
}
