//! Section `fit`: what precision of a fit costs what time, for ours and for what else one could take.
//!
//! Every method is compared with the exact solution of its own least-squares problem, so that the error here is that of
//! arithmetic alone; how well a model predicts pressures is section `force`.

mod aims;
mod contenders;
mod panel;
pub(crate) mod taxels;

use crate::document::{Cell, Section, Table, row};
use crate::numbers::three_digits;
use crate::options::Options;
use crate::peers::Peers;
use panel::{Measured, Panel};
use taxels::Bits;

/// Measures the section.
///
/// # Errors
/// Python ended in the middle of it. Python without numpy is no error: the section says so.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let mut peers = Peers::start(&options.python);
    let measured: anyhow::Result<Vec<Measured>> =
        panels(options.quick).into_iter().map(|panel| panel.measure(options.seed, &mut peers)).collect();
    let measured = measured?;
    let aims = aims::aims(options, &mut peers)?;
    let mut text = vec![
        "How long does a fit take, and how far is it from the exact solution? Each method goes from the samples of a taxel \
         to its curve and is compared with the exact solution, in integers without limit, of its own least-squares \
         problem: all samples, or means in bins of pressure (the shipped default). All methods have one thread and take \
         turns, each fits twice and the second time counts."
            .to_owned(),
        peers.said.clone(),
    ];
    let panels: Vec<String> = measured.iter().filter_map(in_words).collect();
    text.push(format!(
        "At order {ORDER}, the shipped default's, and only of methods within half a count: {}.",
        panels.join("; ")
    ));
    text.push(
        "What the time of ours buys: the same bits in whatever order the samples come, a verdict on the taxel, the \
         uncertainty of each reading, and a curve that is exact on skins that are stiff, noisy or clipped (section Stability), \
         where others have none. Who needs none of these, and has a sound taxel at order 5 or less, is well served by \
         Chebyshev polynomials or numpy's Polynomial.fit."
            .to_owned(),
    );
    text.extend(ours_in_words(&measured));
    Ok(Section {
        text,
        aims,
        figures: measured.iter().map(Measured::figure).collect(),
        tables: vec![orders_table(&measured)],
        ..Section::default()
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

/// The order that is shipped.
const ORDER: usize = 5;

/// The time of the shipped default, and which useful method is fastest beside it; `None` where there is none.
fn in_words(panel: &Measured) -> Option<String> {
    let all = || panel.contenders.iter().zip(&panel.cells).map(|(contender, cells)| (contender, &cells[ORDER - 1]));
    // Too few scans are never binned: then the default is what stands before it.
    let mut ours = all().filter(|(contender, cell)| contender.is_ours() && !contender.is_exact() && cell.is_measured());
    let us = ours.next_back()?.1.median_us();
    let useful = all().filter(|(contender, cell)| !contender.is_ours() && panel.is_useful(cell));
    let (other, cell) = useful.min_by(|a, b| a.1.median_us().total_cmp(&b.1.median_us()))?;
    let (name, other_us) = (panel.panel.name(), cell.median_us());
    let verdict = if other_us < us { "slower" } else { "faster" };
    let ratio = three_digits((us / other_us).max(other_us / us));
    let [us, other_us] = [us, other_us].map(three_digits);
    Some(format!(
        "{name}, {us} us a taxel, {ratio} times {verdict} than the fastest other, {} ({other_us} us)",
        other.name
    ))
}

fn ours_in_words(measured: &[Measured]) -> Option<String> {
    let cells = measured.iter().flat_map(|panel| panel.contenders.iter().zip(&panel.cells));
    let ours = cells.filter(|(contender, _)| contender.is_ours()).flat_map(|(_, cells)| cells);
    let worst = ours.map(panel::Cell::error_pa).reduce(f64::max)?;
    Some(format!(
        "Ours is within {} Pa of the exact solution in all diagrams, at every order and with every estimator.",
        three_digits(worst)
    ))
}

/// Times and errors at orders 5 and 9.
fn orders_table(measured: &[Measured]) -> Table {
    let mut rows = Vec::new();
    for panel in measured {
        let measured = panel.contenders.iter().zip(&panel.cells).filter(|(_, cells)| cells[0].is_measured());
        for (contender, cells) in measured {
            let mut row = row![panel.panel.name(), contender.name];
            for cell in [5, 9].map(|order| &cells[order - 1]) {
                row.push(cell.median_us().into());
                row.push(match cell.failed() {
                    0 => Cell::Number(cell.error_pa()),
                    failed => format!("no solution for {failed} taxels of {}", panel.panel.taxels).into(),
                });
            }
            let useless = cells.iter().position(|cell| !panel.is_useful(cell));
            row.push(useless.map_or_else(|| "".into(), |at| Cell::from((at + 1) as f64)));
            rows.push(row);
        }
    }
    let columns = [
        "data",
        "method",
        "order 5, us",
        "order 5, Pa",
        "order 9, us",
        "order 9, Pa",
        "off by half a count from order",
    ];
    let caption = "Median time per taxel and worst error at orders 5 and 9, and the first order at which the method is off by \
                   more than half a count or has no solution.";
    Table::new("fit-orders", caption, columns, rows)
}
