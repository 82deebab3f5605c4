//! Section A: what precision of a fit costs what time, for ours and for what else one could take.
//!
//! Every method is compared with the exact solution of its own least-squares problem, so that the error here is that of
//! arithmetic alone; how well a model predicts pressures is section B.

mod aims;
mod contenders;
mod panel;
pub(crate) mod taxels;

use crate::document::{Cell, Section, Table, row};
use crate::numbers::three_digits;
use crate::options::Options;
use crate::peers::Peers;
use contenders::{Contender, DEFAULT};
use panel::{Measured, Panel};
use taxels::Bits;

/// Measures section A.
///
/// # Errors
/// Python ended in the middle of it. Python without numpy is no error: the section says so.
pub fn section(options: &Options) -> anyhow::Result<Section> {
    let mut peers = Peers::start(options);
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
    text.extend(measured.iter().filter_map(time_in_words));
    text.push(
        "What the time of ours buys: the same bits in whatever order the samples come, a verdict on the taxel, the \
         uncertainty of each reading, and a curve that is exact on skins that are stiff, noisy or clipped (section E), \
         where others have none. Who needs none of these, and has a sound taxel at order 5 or less, is well served by \
         Chebyshev polynomials or numpy's Polynomial.fit."
            .to_owned(),
    );
    text.extend(ours_in_words(&measured));
    text.extend(measured.iter().map(others_in_words));
    Ok(Section {
        id: "a-fit".to_owned(),
        title: "A. Fit: error against run time".to_owned(),
        text,
        aims,
        figures: measured.iter().map(Measured::figure).collect(),
        tables: vec![orders_table(&measured)],
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

/// Where the shipped default is slower and where it is faster than others, at its own order.
fn time_in_words(panel: &Measured) -> Option<String> {
    const ORDER: usize = 5;
    let cell = |(contender, cells): (&Contender, &Vec<panel::Cell>)| {
        cells[ORDER - 1].is_measured().then(|| (*contender, cells[ORDER - 1].median_us(), cells[ORDER - 1].error_pa()))
    };
    let all: Vec<_> = panel.contenders.iter().zip(&panel.cells).filter_map(cell).collect();
    let (_, us, pa) = *all.iter().find(|(contender, ..)| contender.name == DEFAULT)?;
    let name = |(other, other_us, other_pa): &(Contender, f64, f64)| {
        let ratio = (us / other_us).max(other_us / us);
        format!("{} ({} times, {})", other.name, three_digits(ratio), off_by(*other_pa))
    };
    let others = || all.iter().filter(|(contender, ..)| !contender.is_ours());
    let join = |faster: bool| match others().filter(|other| (other.1 < us) == faster).map(name).collect::<Vec<_>>() {
        names if names.is_empty() => "none".to_owned(),
        names => names.join(", "),
    };
    Some(format!(
        "{}, order {ORDER}: the shipped default takes {} us a taxel, {}. Faster: {}. Slower: {}.",
        panel.panel.name(),
        three_digits(us),
        off_by(pa),
        join(true),
        join(false)
    ))
}

fn off_by(pa: f64) -> String {
    if pa.is_finite() { format!("off by {} Pa", three_digits(pa)) } else { "not always with a solution".to_owned() }
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

/// From which order on the other methods are useless.
fn others_in_words(panel: &Measured) -> String {
    let others = panel.contenders.iter().enumerate().filter(|(_, contender)| !contender.is_ours());
    let words = others.filter_map(|(k, contender)| {
        panel.first_useless_order(k).map(|order| format!("{} from order {order}", contender.name))
    });
    let (words, name) = (words.collect::<Vec<_>>(), panel.panel.name());
    if words.is_empty() {
        return format!("{name}: no method is off by more than half a count at any order.");
    }
    format!("{name}: off by more than half a count, or without a solution: {}.", words.join("; "))
}

/// Times and errors at orders 5 and 9.
fn orders_table(measured: &[Measured]) -> Table {
    let mut rows = Vec::new();
    for panel in measured {
        for (contender, cells) in panel.contenders.iter().zip(&panel.cells).filter(|(_, cells)| cells[0].is_measured())
        {
            let mut row = row![panel.panel.name(), contender.name];
            for cell in [5, 9].map(|order| &cells[order - 1]) {
                row.push(cell.median_us().into());
                row.push(match cell.failed() {
                    0 => Cell::Number(cell.error_pa()),
                    failed => format!("no solution for {failed} taxels of {}", panel.panel.taxels).into(),
                });
            }
            rows.push(row);
        }
    }
    let columns = ["data", "method", "order 5, us", "order 5, Pa", "order 9, us", "order 9, Pa"];
    Table::new("a-fit-orders", "Median time per taxel and worst error at orders 5 and 9.", columns, rows)
}
