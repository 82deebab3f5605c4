//! Decimal text to double-double, so that data are used as they are written and not as an f64 stores them.

use crate::dd::Dd;

/// Digits that an exact integer of 106 bits holds.
const EXACT_DIGITS: usize = 31;

/// Reads a decimal number (`-12.5`, `0.486e-3`, no `inf` or `nan`) to about 31 digits.
///
/// `hi` is the correctly rounded f64 and also that of `hi + lo`, which is within 2^-100 of the text relatively. `None` if
/// the text is not a finite decimal number of magnitude below 1e120.
#[must_use]
pub fn parse_decimal(text: &str) -> Option<Dd> {
    let text = text.trim();
    let hi: f64 = text.parse().ok()?;
    if !hi.is_finite() || hi.abs() >= 1e120 {
        return None;
    }
    if hi == 0.0 || hi.abs() < 1e-120 {
        return Some(Dd::from(hi));
    }
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], text[at + 1..].parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (value, exponent) = integer_and_exponent(mantissa, exponent);
    let value = if mantissa.starts_with('-') { -value } else { value };
    let exact = times_power_of_ten(value, exponent);
    let rest = exact - Dd::from(hi);
    Some(Dd { hi, lo: within_half_a_step(hi, rest.hi) })
}

/// A rest that does not change `hi`. That of the first 31 digits may, where the text lies just within half a step of `hi`.
fn within_half_a_step(hi: f64, rest: f64) -> f64 {
    if hi + rest == hi {
        return rest;
    }
    let next = if rest > 0.0 { hi.next_up() } else { hi.next_down() };
    ((next - hi).abs() / 2.0).next_down().copysign(rest)
}

/// The first 31 significant digits as an integer, and the power of ten that goes with it.
fn integer_and_exponent(mantissa: &str, exponent: i32) -> (Dd, i32) {
    let mut digits: i128 = 0;
    let mut used = 0;
    let mut exponent = exponent;
    let mut fraction = false;
    for byte in mantissa.bytes() {
        match byte {
            b'.' => fraction = true,
            b'0'..=b'9' => {
                let kept = used < EXACT_DIGITS;
                if kept {
                    digits = digits * 10 + i128::from(byte - b'0');
                    used += usize::from(digits != 0);
                }
                exponent += i32::from(!kept) - i32::from(fraction);
            }
            _ => {}
        }
    }
    (integer(digits), exponent)
}

/// An integer; exact up to 106 bits.
fn integer(n: i128) -> Dd {
    let hi = n as f64;
    // The rounded value may exceed the type's range only for inputs near its end, which saturate.
    Dd::from(hi) + Dd::from(n.saturating_sub(hi as i128) as f64)
}

/// `value * 10^exponent`; powers up to 10^22 are exact f64.
fn times_power_of_ten(mut value: Dd, exponent: i32) -> Dd {
    let mut left = exponent.unsigned_abs();
    while left > 0 {
        let step = left.min(22);
        let power = (0..step).fold(1.0, |power: f64, _| power * 10.0);
        value = if exponent < 0 { value.div_f64(power) } else { value.scale(power) };
        left -= step;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_bigint::BigInt;
    use num_rational::BigRational;
    use proptest::prelude::*;

    #[test]
    fn integers_of_a_hundred_bits_are_exact() {
        let ends = [i64::MAX.into(), i64::MIN.into(), (1_i128 << 53) + 1, -(1 << 62) - 1, (1_i128 << 100) + 12_345];
        for n in [0, 1, -1].into_iter().chain(ends) {
            let d = integer(n);
            assert_eq!(d.hi as i128 + d.lo as i128, n, "{n}");
            assert_eq!(d.hi, n as f64, "{n}");
        }
    }

    fn exact(d: Dd) -> BigRational {
        BigRational::from_float(d.hi).unwrap() + BigRational::from_float(d.lo).unwrap()
    }

    #[test]
    fn a_tenth_is_a_tenth() {
        let tenth = exact(parse_decimal("0.1").unwrap());
        let error = tenth - BigRational::new(BigInt::from(1), BigInt::from(10));
        let bound = BigRational::new(BigInt::from(1), BigInt::from(10).pow(31));
        assert!(error < bound.clone() && -error < bound);
    }

    /// The first 31 digits lie at exactly half a step, and those after them on the side of `hi`.
    #[test]
    fn what_lies_just_within_half_a_step_has_a_rest_that_does_not_change_the_nearest_double() {
        for text in ["34567801234567890.000000000000004", "-34567801234567890.000000000000004"] {
            let got = parse_decimal(text).unwrap();
            assert_eq!((got.hi, got.hi + got.lo), (text.parse().unwrap(), got.hi), "{text}");
            assert_eq!(got.lo.abs(), 2.0_f64.next_down(), "{text}");
        }
        let tie = parse_decimal("34567801234567890").unwrap();
        assert_eq!((tie.hi + tie.lo, tie.lo), (tie.hi, 2.0), "to the even one");
    }

    #[test]
    fn what_is_no_finite_number_is_refused() {
        for text in ["", "nan", "inf", "-inf", "1e400", "1.2.3", "x", "1e", "--1"] {
            assert_eq!(parse_decimal(text), None, "{text}");
        }
        assert_eq!(parse_decimal(" +7 ").unwrap().hi, 7.0);
        assert_eq!(parse_decimal("-0.0").unwrap().hi, 0.0);
    }

    proptest! {
        #[test]
        fn any_decimal_within_two_to_minus_hundred(
            digits in 1_i64..=i64::MAX, exponent in -60_i32..40, negative: bool, point in 1_usize..18,
        ) {
            let mut text = digits.to_string();
            if point < text.len() {
                text.insert(point, '.');
            }
            let text = format!("{}{text}e{exponent}", if negative { "-" } else { "" });
            let got = parse_decimal(&text).unwrap();
            let shift = exponent - if point < digits.to_string().len() {
                (digits.to_string().len() - point) as i32
            } else {
                0
            };
            let ten = BigRational::from_integer(BigInt::from(10));
            let mut want = BigRational::from_integer(BigInt::from(digits)) * ten.pow(shift);
            if negative {
                want = -want;
            }
            let relative = (exact(got) - &want) / want;
            let bound = BigRational::new(BigInt::from(1), BigInt::from(2).pow(100));
            prop_assert!(relative < bound.clone() && relative > -bound);
            prop_assert_eq!(got.hi, text.parse::<f64>().unwrap());
            prop_assert_eq!(got.hi + got.lo, got.hi);
        }
    }
}
