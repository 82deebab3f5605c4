//! Section A: what precision of a fit costs what time, for ours and for what else one could take.
//!
//! Every method is compared with the exact solution of its own least-squares problem, so that the error here is that of
//! arithmetic alone; how well a model predicts pressures is section B.

mod aims;
mod contenders;
mod exact;
mod panel;
mod taxels;

use crate::document::{Cell, Section, Table};
use crate::markup::three_digits;
use crate::numpy::Numpy;
use crate::options::Options;
use panel::{Measured, Panel};
use taxels::Bits;

/// Measures section A.
///
/// # Errors
/// Python ended in the middle of it. Python without numpy is no error: the section says so.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let (mut numpy, numpy_text) = start_numpy(options);
    let mut measured = Vec::new();
    for panel in panels(options.quick) {
        measured.push(panel.measure(options.seed, &mut numpy)?);
    }
    let aims = aims::table(options, &mut numpy)?;
    let mut text = vec![
        "How long does a fit take, and how far is it from the exact solution? Each method goes from the samples of a \
         taxel to its curve and is compared with the exact solution of its own least-squares problem: all samples, or \
         means in bins of pressure (the default). The exact solutions are made with integers of 256 fraction bits, their values have \
         more than 100 bits. All methods have one thread and take turns; ours also judges the taxel and tells its \
         uncertainty in the time shown."
            .to_owned(),
        numpy_text,
    ];
    text.extend(ours_in_words(&measured));
    text.extend(others_in_words(&measured));
    Ok(Section {
        id: "a-fit".to_owned(),
        title: "A. Fit: error against run time".to_owned(),
        text,
        figures: measured.iter().map(Measured::figure).collect(),
        tables: vec![aims, orders_table(&measured)],
    })
}

fn panels(quick: bool) -> Vec<Panel> {
    let (taxels, repetitions) = if quick { (5, 15) } else { (20, 30) };
    let new = |bits, scans| Panel { bits, scans, taxels, repetitions };
    if quick {
        return vec![new(Bits::Eight, 100), new(Bits::Eight, 10_000), new(Bits::Sixteen, 10_000)];
    }
    let sizes = [100, 10_000, 100_000];
    [Bits::Eight, Bits::Sixteen].into_iter().flat_map(|bits| sizes.map(|scans| new(bits, scans))).collect()
}

/// numpy, or why it takes no part; and both in words.
pub(crate) fn start_numpy(options: &Options) -> (Option<Numpy>, String) {
    match Numpy::start(&options.python) {
        Ok(numpy) => {
            let (python, version) = (&numpy.versions().python, &numpy.versions().numpy);
            let text = format!("numpy {version} on Python {python} takes part, timed by its own clock.");
            (Some(numpy), text)
        }
        Err(error) => (None, format!("numpy.polyfit takes no part: {error:#}.")),
    }
}

fn ours_in_words(measured: &[Measured]) -> Option<String> {
    let cells = measured.iter().flat_map(|panel| panel.contenders.iter().zip(&panel.cells));
    let ours: Vec<f64> = cells
        .filter(|(contender, _)| contender.is_ours())
        .flat_map(|(_, cells)| cells.iter().map(panel::Cell::error_pa))
        .collect();
    let worst = ours.iter().copied().reduce(f64::max)?;
    Some(format!(
        "Ours is within {} Pa of the exact solution in all diagrams, at every order and with every estimator.",
        three_digits(worst)
    ))
}

/// From which order on the other methods are useless, by diagram.
fn others_in_words(measured: &[Measured]) -> Vec<String> {
    measured
        .iter()
        .map(|panel| {
            let others = panel.contenders.iter().enumerate().filter(|(_, contender)| !contender.is_ours());
            let words: Vec<String> = others
                .filter_map(|(k, contender)| {
                    panel.first_useless_order(k).map(|order| format!("{} from order {order}", contender.name))
                })
                .collect();
            let name = panel.panel.name();
            if words.is_empty() {
                return format!("{name}: no method is off by more than half a count at any order.");
            }
            format!("{name}: off by more than half a count, or without a solution: {}.", words.join("; "))
        })
        .collect()
}

/// Times and errors at orders 5 and 9.
fn orders_table(measured: &[Measured]) -> Table {
    let mut rows = Vec::new();
    for panel in measured {
        for (contender, cells) in panel.contenders.iter().zip(&panel.cells) {
            if !cells[0].is_measured() {
                continue;
            }
            let mut row = vec![Cell::Text(panel.panel.name()), Cell::Text(contender.name.to_owned())];
            for order in [5, 9] {
                let cell = &cells[order - 1];
                row.push(Cell::Number(cell.median_us()));
                row.push(match cell.failed() {
                    0 => Cell::Number(cell.error_pa()),
                    failed => Cell::Text(format!("no solution for {failed} taxels of {}", panel.panel.taxels)),
                });
            }
            rows.push(row);
        }
    }
    let columns = ["data", "method", "order 5, us", "order 5, Pa", "order 9, us", "order 9, Pa"];
    Table {
        id: "a-fit-orders".to_owned(),
        caption: "Median time per taxel and worst error at orders 5 and 9.".to_owned(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
    }
}
