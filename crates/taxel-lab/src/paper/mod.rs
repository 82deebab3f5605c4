//! `taxel-lab paper`: every figure and table of the paper that given data can draw.
//!
//! J. Kangro, S. Traversaro, D. Pucci, F. Nori, "Skin Normal Force Calibration Using Vacuum Bags". The data are scans of a
//! skin under a rising and falling pressure and, where there are any, known loads: of the simulator or of a recording.

mod data;
mod figures;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, ensure};
use taxel_engine::calibration::fit::{Branch, FitRecipe, OneByOne, fit};

use self::data::{Data, Weighing, Weighings};
use self::figures::RUNS;
use crate::document::Section;
use crate::fit::parse_number;
use crate::forearm::{TARGET_KPA, Tried, Weighed};
use crate::page::Page;
use crate::recording::Recording;
use crate::soundness::{Purpose, check};

/// What can be asked of the paper's figures.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxel-lab paper --out figures                           # a simulated forearm\n  taxeld sessions export 3 --out session3.csv\n  taxel-lab paper session3.csv --out figures"
)]
pub struct PaperArgs {
    /// A recording (`t_s,pressure_kpa,c0,...`) or an exported session, plain or .gz [default: a simulated forearm].
    data: Option<PathBuf>,
    /// Folder for the page and its pictures; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Exclude taxels that move by less than this many counts, as the paper does.
    #[arg(long, value_name = "COUNTS", default_value_t = 10.0, value_parser = parse_number)]
    min_swing: f64,
    /// Which simulated skin.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

const INTRODUCTION: &str = "What J. Kangro, S. Traversaro, D. Pucci and F. Nori show in \u{201c}Skin Normal Force Calibration \
    Using Vacuum Bags\u{201d}, drawn from other data. The models are the paper's: the polynomial of order 5 with the least \
    squares over all samples of rising pressure, left as it is. Taxels are excluded by their swing alone.";

/// Draws the figures and writes the tables.
///
/// # Errors
/// Data that cannot be read or have no pressure, a folder that cannot be written. A figure that the data cannot draw is
/// no error: it is left out, and the page says why.
pub fn paper(args: &PaperArgs) -> anyhow::Result<()> {
    let data = match &args.data {
        None => simulate(args.seed, args.min_swing)?,
        Some(path) => recording(path).with_context(|| path.display().to_string())?,
    };
    let section = section(&data, args.min_swing);
    for line in section.text.iter().chain(section.tables.iter().map(|table| &table.caption)) {
        say!("{line}");
    }
    let (title, introduction) = ("The paper's figures and tables", [INTRODUCTION.to_owned()]);
    Page { title, introduction: &introduction, sections: &[section] }.write(&args.out, "paper")?;
    say!("{}", args.out.join("index.html").display());
    Ok(())
}

fn section(data: &Data, min_swing: f64) -> Section {
    let models = data.models(min_swing);
    let (mut figures, mut text) = (Vec::new(), vec![format!("The data: {}.", data.source)]);
    for (figure, drawn) in figures::Figures::new(data, &models, min_swing).all() {
        match drawn {
            Ok(drawn) => figures.push(drawn),
            Err(why) => text.push(format!("Left out, {figure}: {why}.")),
        }
    }
    let mut tables = vec![tables::calibration(data, &models, min_swing)];
    tables.extend(data.loads.iter().enumerate().map(|(at, loads)| tables::errors(at, loads)));
    let (id, title) = ("paper".to_owned(), "Figures".to_owned());
    Section { id, title, text, figures, tables, ..Section::default() }
}

/// The paper's experiment on a simulated forearm: three runs in the bag, then masses on the skin, with models that exclude taxels of less swing than this.
///
/// # Errors
/// A simulation that cannot be set up, which it can.
fn simulate(seed: u64, min_swing_counts: f64) -> anyhow::Result<Data> {
    let tried = Tried::new(&[], seed, RUNS, 0)?;
    let read = |by: &str, paper| -> anyhow::Result<Weighings> {
        let mut recipe = FitRecipe { branch: Branch::Rising, plays: false, ..FitRecipe::default() };
        recipe.options.paper = paper;
        recipe.options.min_swing_counts = min_swing_counts;
        let set = fit(&tried.calibration.as_scans(), &recipe, &OneByOne)?;
        let (forces, _) = tried.forces(Arc::new(set), &recipe);
        let weighing = |(measured_n, one): (f64, &Weighed)| {
            let (kilogram, true_n) = (Some(one.kilogram), one.true_n);
            Weighing { kilogram, true_n, measured_n }
        };
        Ok(Weighings { by: by.to_owned(), all: forces.into_iter().zip(&tried.weighings).map(weighing).collect() })
    };
    let loads = vec![
        read("the paper's recipe: its models, equal areas, active taxels only", true)?,
        read("the shipped default, excluded taxels filled", false)?,
    ];
    let source = format!("a simulated forearm, seed {seed}: {RUNS} runs to {TARGET_KPA} kPa");
    let kpa = tried.calibration.pressure_kpa.unwrap_or_default();
    let mut data = Data::new(source, kpa, tried.calibration.counts);
    data.loads = loads;
    Ok(data)
}

fn recording(path: &Path) -> anyhow::Result<Data> {
    let mut recording = Recording::read(path)?;
    for note in check(&mut recording, Purpose::Draw)? {
        say!("{note}");
    }
    let kpa = recording.pressure_kpa.context("there is no column `pressure_kpa`")?;
    ensure!(kpa.iter().any(|kpa| kpa.is_finite()), "the column `pressure_kpa` has no finite number");
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Ok(Data::new(format!("{name}, {} scans", kpa.len()), kpa, recording.counts))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::words;

    const ALL: [&str; 9] =
        ["raw", "mean-curve", "swing", "baseline", "repeatability", "loop", "fit-typical", "fit-weak", "force"];

    /// Twenty taxels that count 237 less a pressure of whole kPa, two of which hardly move; a count more on the way down.
    fn skin(runs: usize, falls: bool) -> Data {
        let mut kpa = vec![0.0; 40];
        for _ in 0..runs {
            kpa.extend((0..=700).map(|k| f64::from(k) / 10.0));
            kpa.extend((0..700).rev().filter(|_| falls).map(|k| f64::from(k) / 10.0));
            kpa.extend(vec![0.0; if falls { 40 } else { 0 }]);
        }
        let count = |taxel: usize| -> Vec<f64> {
            let gain = if taxel < 2 { 0.05 } else { 1.0 };
            let mut before = 0.0;
            let count = |&p: &f64| {
                let falling = p < before;
                before = p;
                (237.0 - gain * p).round() - if falling { 2.0 } else { 0.0 }
            };
            kpa.iter().map(count).collect()
        };
        let counts = (0..20).map(count).collect();
        Data::new("by hand".to_owned(), kpa, counts)
    }

    #[test]
    fn three_runs_with_loads_draw_every_figure() {
        let load = |measured_n| Weighing { kilogram: Some(0.2), true_n: 2.0, measured_n };
        let mut data = skin(3, true);
        data.loads = vec![Weighings { by: "by hand".to_owned(), all: vec![load(1.8), load(2.4)] }];
        let section = section(&data, 10.0);
        assert_eq!(section.figures.iter().map(|figure| figure.id.as_str()).collect::<Vec<_>>(), ALL);
        assert_eq!(section.text, ["The data: by hand."]);
        let cells = |table: usize, row: usize| section.tables[table].rows[row].iter().map(words).collect::<Vec<_>>();
        assert_eq!(cells(0, 0)[1], "20, 18 with a model");
        assert_eq!(cells(1, 0)[1..], ["2", "2", "2.100", "5.000", "15.00"].map(str::to_owned));
        assert!(section.figures.iter().flat_map(|figure| &figure.lines).all(|line| !line.points.is_empty()));
    }

    #[test]
    fn what_the_data_cannot_draw_is_left_out_and_told() {
        let section = section(&skin(1, false), 10.0);
        let drawn: Vec<&str> = section.figures.iter().map(|figure| figure.id.as_str()).collect();
        for id in ["repeatability", "loop", "force"] {
            assert!(!drawn.contains(&id), "{id}");
        }
        assert!(section.text.iter().any(|line| line.contains("no known load")), "{:?}", section.text);
        let nothing = Data::new(String::new(), vec![f64::NAN; 3], vec![vec![1.0; 3]; 2]);
        assert!(self::section(&nothing, 10.0).text.len() > 6);
    }
}
