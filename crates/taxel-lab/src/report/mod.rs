//! `taxel-lab report`: error against run time, stability on stiff and extreme cases, and what a configuration costs.
//!
//! Each section is a module with a function that measures and returns a `Section`.

mod args;
mod force;
mod scenes;
mod stability;

use std::time::{Instant, SystemTime};

use anyhow::ensure;
use taxel_proto::Timestamp;

pub use self::args::ReportArgs;
use crate::document::Section;
use crate::page::Page;

/// Name, heading and what measures it, in the order of the page.
type Part = (&'static str, &'static str, fn(&ReportArgs) -> anyhow::Result<Section>);

const PARTS: [Part; 3] = [
    ("force", "Force: held-out error against run time", force::section),
    ("stability", "Stability: stiff, extreme and broken taxels", stability::section),
    ("scenes", "Configurations: what is left out costs nothing", scenes::section),
];

const INTRODUCTION: &str = "taxeld turns the raw counts of a robot's skin into the force that presses on it. It learns how \
    from a vacuum bag: while the pressure in the bag rises, one curve from counts to pressure is fitted for each sensing \
    element (taxel). This page measures how well that predicts what no fit saw and how long it takes, how exact it is beside \
    other methods, and what a configuration costs.";

/// Measures and writes the report.
///
/// # Errors
/// A folder that cannot be written, or a section that failed: the page says why, and the others are there.
pub fn report(args: &ReportArgs) -> anyhow::Result<()> {
    let (mut sections, mut failed) = (Vec::new(), Vec::new());
    let chosen = |part: &&Part| args.only.is_empty() || args.only.iter().any(|name| name == part.0);
    for (name, title, measure) in PARTS.iter().filter(chosen) {
        let begun = Instant::now();
        let section = measure(args).unwrap_or_else(|error| {
            failed.push(*name);
            let text = vec![format!("FAILED: {error:#}.")];
            Section { text, ..Section::default() }
        });
        say!("{name}: {:.1} s", begun.elapsed().as_secs_f64());
        sections.push(Section { id: (*name).to_owned(), title: (*title).to_owned(), ..section });
    }
    let introduction = [INTRODUCTION.to_owned(), machine(args)];
    let page = Page { title: "taxeld: how right, and how fast", introduction: &introduction, sections: &sections };
    page.write(&args.out, "report")?;
    say!("{}", args.out.join("index.html").display());
    ensure!(failed.is_empty(), "sections that failed: {}; the page says why", failed.join(", "));
    Ok(())
}

/// What was measured on, in words.
fn machine(args: &ReportArgs) -> String {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or("unknown processor", |(_, name)| name.trim());
    let build = if cfg!(debug_assertions) { "NOT OPTIMISED, its times mean nothing" } else { "optimised" };
    format!(
        "Measured {} on {model}, {} cores; build: {build}; {}, seed {}.",
        Timestamp::from(SystemTime::now()),
        std::thread::available_parallelism().map_or(1, usize::from),
        if args.quick { "quick" } else { "full" },
        args.seed,
    )
}
