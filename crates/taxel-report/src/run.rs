//! The whole report: every section by name, measured one after the other, and the page of all of them.

use crate::document::Section;
use crate::machine::Machine;
use crate::options::Options;
use crate::{daemon, digits, force, held_out, page, stability, work_precision};
use anyhow::ensure;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

/// A section by name.
struct Part {
    /// As `--only` takes it: the section's id.
    name: &'static str,
    /// Its heading.
    title: &'static str,
    /// Measures it; id and title come from here.
    section: fn(&Options) -> anyhow::Result<Section>,
}

/// In the order of the page.
const PARTS: &[Part] = &[
    Part { name: "force", title: "Force: held-out error against run time", section: force::section },
    Part { name: "fit", title: "Fit: error against run time", section: work_precision::section },
    Part { name: "model", title: "Model: calibration length and held-out error", section: held_out::section },
    Part { name: "latency", title: "Latency: from the bus into a client's hands", section: daemon::latency },
    Part { name: "digits", title: "Digits: certified regression sets", section: digits::section },
    Part { name: "stability", title: "Stability: stiff, extreme and broken taxels", section: stability::section },
    Part { name: "scenes", title: "Scenes: what is left out costs nothing", section: daemon::scenes },
];

/// The names of all sections, in the order of the page.
#[must_use]
pub fn names() -> Vec<&'static str> {
    PARTS.iter().map(|part| part.name).collect()
}

/// Measures the sections named in `only`, or all if it is empty, and writes the report into `out`.
///
/// # Errors
/// A name that is no section's, a file that cannot be written, or a section that failed. The last leaves a whole report
/// behind, in which the failed section says why.
pub fn run(options: &Options, out: &Path, only: &[String]) -> anyhow::Result<()> {
    for name in only {
        ensure!(names().contains(&name.as_str()), "no section `{name}`; there are {}", names().join(", "));
    }
    let chosen: Vec<&Part> =
        PARTS.iter().filter(|part| only.is_empty() || only.iter().any(|name| name == part.name)).collect();
    let machine = Machine::here(options);
    let (mut sections, mut failed) = (Vec::new(), Vec::new());
    for part in chosen {
        tracing::info!("measuring `{}`", part.name);
        let start = Instant::now();
        let section = measure(part, options).unwrap_or_else(|error| {
            tracing::error!("`{}` failed: {error:#}", part.name);
            failed.push(part.name);
            failure(part, &error)
        });
        tracing::info!("`{}` took {:.1} s", part.name, start.elapsed().as_secs_f64());
        sections.push(section);
    }
    page::write(out, &machine, &sections)?;
    ensure!(failed.is_empty(), "sections that failed: {}; the report says why", failed.join(", "));
    Ok(())
}

/// A section that panics must not take the others with it: a full report is the work of many minutes.
fn measure(part: &Part, options: &Options) -> anyhow::Result<Section> {
    let measured = catch_unwind(AssertUnwindSafe(|| (part.section)(options))).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        Err(anyhow::anyhow!("it panicked: {}", text.unwrap_or("without a message")))
    });
    Ok(Section { id: part.name.to_owned(), title: part.title.to_owned(), ..measured? })
}

fn failure(part: &Part, error: &anyhow::Error) -> Section {
    Section {
        id: format!("{}-failed", part.name),
        title: format!("{}: FAILED", part.title),
        text: vec![format!("This section could not be measured: {error:#}.")],
        ..Section::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options() -> Options {
        let nowhere = std::path::PathBuf::from("nowhere");
        Options { quick: true, data: None, python: nowhere.clone(), taxeld: nowhere, seed: 1 }
    }

    #[test]
    fn a_section_that_fails_says_so_in_its_place() {
        let failing = [
            Part { name: "a", title: "First", section: |_| anyhow::bail!("no simulator") },
            Part { name: "b", title: "Second", section: |_| panic!("index 3") },
        ];
        for (part, why) in failing.iter().zip(["no simulator", "it panicked: index 3"]) {
            let error = measure(part, &options()).unwrap_err();
            let section = failure(part, &error);
            assert!(section.text[0].contains(why), "{:?}", section.text);
            assert_eq!(section.title, format!("{}: FAILED", part.title));
        }
    }

    #[test]
    fn an_unknown_section_is_refused_with_those_there_are() {
        let error = run(&options(), Path::new("nowhere"), &["fits".to_owned()]).unwrap_err().to_string();
        assert!(error.contains("`fits`") && error.contains("digits"), "{error}");
    }
}
