//! Rows for people, as Markdown.

use taxel_report::daemon::process::Used;

use crate::crowd::Seen;
use crate::histogram::Histogram;

pub fn head() {
    println!("| case | delay | p50, us | p99 | p99.9 | most | messages | timer p50, us | p99 | p99.9 | most |");
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
}

/// What a crowd saw, and how late a bare timer was meanwhile.
pub fn seen(case: &str, seen: &Seen, timer: &Histogram) {
    let timer = timer.cells();
    if seen.from_due.total() == 0 {
        println!("| {case} | frame to client | {} | {} | {timer} |", seen.way.cells(), seen.messages);
    } else {
        let came = format!("{}: {:.2} % of those due", seen.messages, 100.0 * seen.messages as f64 / seen.due);
        println!("| {case} | message made to client | {} | {came} | {timer} |", seen.way.cells());
        println!("| {case} | due to client | {} | | |", seen.from_due.cells());
    }
    if seen.no_force > 0 {
        println!("| | {} messages of {} had no force | | | | | | | | | |", seen.no_force, seen.messages);
    }
}

pub fn waits(case: &str, waits: &Histogram) {
    println!("| {case} | connecting and a first force | {} | {} | | | | |", waits.cells(), waits.total());
}

/// How much one is of the other, where it matters.
pub fn ratio(what: &str, [this, that]: [&Histogram; 2]) {
    let of = |share| this.quantile_us(share) / that.quantile_us(share);
    println!("{what}: p50 {:.2}, p99 {:.2}", of(0.5), of(0.99));
}

/// What the process was at the beginning and at the end.
pub fn process(case: &str, [begin, end]: &[Used; 2], seconds: f64) {
    let used = end.processor.saturating_sub(begin.processor).as_secs_f64();
    println!(
        "{case}, {seconds:.0} s: memory {:.1} MiB at the beginning, {:.1} MiB at the end; {} and {} threads; {} and {} \
         descriptors; {:.1} % of a processor without the simulation",
        begin.memory_mib,
        end.memory_mib,
        begin.threads,
        end.threads,
        begin.descriptors,
        end.descriptors,
        100.0 * used / seconds
    );
}
