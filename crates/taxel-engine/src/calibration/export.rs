//! The samples of a session as text, the same wherever they are written and wherever their hash is made.
//!
//! The samples are a table that `taxeld fit` reads, with the pressures as the gauge read them. The zeros at which the ramps began
//! are a table of their own: counts of different ramps can only be compared by their distance from these, and pressures by that
//! from what the gauge read at rest.

use std::fmt::Write;

/// Header of the table of samples.
#[must_use]
pub fn samples_header(taxels: usize) -> String {
    format!("t_s,pressure_kpa{}\n", columns(taxels))
}

/// One scan: seconds since the first one, kPa, and a raw count per taxel.
#[must_use]
pub fn sample_row(since_first_ns: i64, pressure_kpa: f64, counts: impl Iterator<Item = u32>) -> String {
    let mut row = format!("{:.6},{pressure_kpa}", since_first_ns as f64 * 1e-9);
    for count in counts {
        let _ = write!(row, ",{count}"); // writing to a string cannot fail
    }
    row.push('\n');
    row
}

/// Header of the table of zeros.
#[must_use]
pub fn zeros_header(taxels: usize) -> String {
    format!("ramp,scans,figure{}\n", columns(taxels))
}

/// The zero of a ramp, as two rows: mean and noise at rest per taxel, in units; an empty cell where a taxel gave no value. A
/// third row has what the gauge read, kPa, in its first cell, if that is known. `ramp` counts from 1, `scans` is how many scans
/// of the session belong to it.
#[must_use]
pub fn zero_rows(
    ramp: u32,
    scans: usize,
    zero: impl Iterator<Item = (f64, f64)> + Clone,
    gauge_kpa: Option<f64>,
) -> String {
    let cells = |figure: fn((f64, f64)) -> f64| {
        let cell = |value: f64| if value.is_finite() { format!(",{value}") } else { ",".to_owned() };
        zero.clone().map(figure).map(cell).collect::<String>()
    };
    let (means, noises) = (cells(|(mean, _)| mean), cells(|(_, noise)| noise));
    let others = ",".repeat(zero.count().saturating_sub(1));
    let gauge = gauge_kpa.map_or_else(String::new, |kpa| format!("{ramp},{scans},gauge_kpa,{kpa}{others}\n"));
    format!("{ramp},{scans},mean{means}\n{ramp},{scans},noise{noises}\n{gauge}")
}

fn columns(taxels: usize) -> String {
    (0..taxels).map(|taxel| format!(",c{taxel}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressures_and_zeros_are_written_to_their_last_bit_and_unknown_ones_are_empty() {
        assert_eq!(samples_header(2), "t_s,pressure_kpa,c0,c1\n");
        assert_eq!(sample_row(1_500_000_000, 0.1 + 0.2, [240, 7].into_iter()), "1.500000,0.30000000000000004,240,7\n");
        let zero = [(240.25, 0.5), (f64::NAN, f64::NAN)];
        let of_taxels = "ramp,scans,figure,c0,c1\n1,20,mean,240.25,\n1,20,noise,0.5,\n";
        assert_eq!(zeros_header(2) + &zero_rows(1, 20, zero.into_iter(), None), of_taxels);
        let with_gauge = zeros_header(2) + &zero_rows(1, 20, zero.into_iter(), Some(5.75));
        assert_eq!(with_gauge, of_taxels.to_owned() + "1,20,gauge_kpa,5.75,\n");
    }
}
