//! Calibration length against held-out error on recordings of a real skin, where they are there.
//!
//! A 280-taxel insole in a pressure chamber (Belli et al., Sensors 2023, 23(9), 4501): fitted on `left_calibration`,
//! judged on `left_validation` and `left_steps`.

use std::fs::File;
use std::path::Path;

use anyhow::{Context, bail};
use flate2::read::MultiGzDecoder;
use taxel_engine::calibration::fit::{ApplyRecipe, Branch, FitRecipe, PlaysChoice, Scans, Score, apply, fit, judge};
use taxel_model::{Estimator, FitOptions, Order};

use crate::document::{Axis, Figure, Line, Point, Table, row};

/// Every so many scans are fitted: full and quick.
const STRIDES: [&[usize]; 2] = [&[64, 32, 16, 8, 4, 2, 1], &[32, 8]];

/// Every so many scans are judged, likewise: 49 or 16 scans a second.
const JUDGED_STRIDE: [usize; 2] = [1, 3];

/// What is judged.
const JUDGED: [&str; 2] = ["validation", "steps"];

/// One recording, column by column; an empty cell is NaN.
struct Recording {
    time_s: Vec<f64>,
    pressure_kpa: Vec<f64>,
    counts: Vec<Vec<f64>>,
}

/// One fit.
struct Entry {
    recipe: String,
    ours: bool,
    scans: usize,
    /// As [`JUDGED`].
    scores: [Score; JUDGED.len()],
    /// Whether a zero could be taken there: a calibration with too few scans at rest gives nothing to prove it by.
    tared: [bool; JUDGED.len()],
}

/// All that was measured.
pub struct Insole {
    entries: Vec<Entry>,
    /// Which scans were judged, in words.
    step: &'static str,
}

/// Fits and judges; `None` where `folder` is not there.
///
/// # Errors
/// A recording that cannot be read or has no pressure.
pub fn measure(folder: &Path, quick: bool) -> anyhow::Result<Option<Insole>> {
    if !folder.is_dir() {
        return Ok(None);
    }
    let read = |name: &str| Recording::read(&folder.join(format!("left_{name}.csv.gz")));
    let calibration = read("calibration")?;
    let every = JUDGED_STRIDE[usize::from(quick)];
    let judged = [read(JUDGED[0])?.every(every), read(JUDGED[1])?.every(every)];
    let mut entries = Vec::new();
    for (recipe, ours, how) in recipes(quick) {
        for &stride in STRIDES[usize::from(quick)] {
            let part = calibration.every(stride);
            let set = fit(&part.scans(), &how, &mut |_, _| {})?;
            let score = |recording: &Recording| -> anyhow::Result<(Score, bool)> {
                let applied = apply(&recording.scans(), &set, &ApplyRecipe::default())?;
                Ok((judge(&applied, &recording.pressure_kpa), applied.zero.is_tared()))
            };
            let [(validation, first), (steps, second)] = [score(&judged[0])?, score(&judged[1])?];
            let (scores, tared) = ([validation, steps], [first, second]);
            entries.push(Entry { recipe: recipe.clone(), ours, scans: part.time_s.len(), scores, tared });
        }
    }
    let step = if quick { "third scan" } else { "scan" };
    Ok(Some(Insole { entries, step }))
}

/// Name, whether it is the default of its kind, and recipe.
fn recipes(quick: bool) -> Vec<(String, bool, FitRecipe)> {
    let recipe = |estimator, order, branch, smooth_s| FitRecipe {
        options: FitOptions { estimator, order, ..FitOptions::default() },
        branch,
        plays: PlaysChoice::Off,
        smooth_s,
        ..FitRecipe::default()
    };
    let paper = |order| recipe(Estimator::PerSample, Order::Fixed(order), Branch::Rising, 0.0);
    let binned = |order| recipe(Estimator::PressureBinned, order, Branch::Both, 0.5);
    let mut all = vec![
        ("per sample, rising branch, order 5".to_owned(), false, paper(5)),
        ("binned, both branches, order 5".to_owned(), false, binned(Order::Fixed(5))),
        ("the same with plays (shipped default)".to_owned(), true, FitRecipe::default()),
    ];
    if !quick {
        all.push(("per sample, rising branch, order 3".to_owned(), false, paper(3)));
        all.push(("binned, both branches, order 3".to_owned(), false, binned(Order::Fixed(3))));
        all.push(("binned, both branches, order 9".to_owned(), false, binned(Order::Fixed(9))));
        all.push(("binned, both branches, auto".to_owned(), false, binned(Order::Auto)));
    }
    all
}

impl Recording {
    /// Reads `t_s,pressure_kpa,c0,c1,...`, gzipped.
    fn read(path: &Path) -> anyhow::Result<Self> {
        let named = || path.display().to_string();
        Self::parse(MultiGzDecoder::new(File::open(path).with_context(named)?)).with_context(named)
    }

    fn parse(input: impl std::io::Read) -> anyhow::Result<Self> {
        let mut reader = csv::Reader::from_reader(input);
        let columns = reader.headers()?.len();
        if columns < 3 || reader.headers()?.get(1) != Some("pressure_kpa") {
            bail!("line 1: expected the header `t_s,pressure_kpa,c0,c1,...`");
        }
        let mut recording =
            Self { time_s: Vec::new(), pressure_kpa: Vec::new(), counts: vec![Vec::new(); columns - 2] };
        let mut row = csv::StringRecord::new();
        while reader.read_record(&mut row)? {
            let line = row.position().map_or(0, csv::Position::line);
            let mut cells = row.iter().map(|cell| match cell {
                "" => Ok(f64::NAN),
                text => text.parse().with_context(|| format!("line {line}: `{text}` is not a number")),
            });
            recording.time_s.extend(cells.next().transpose()?);
            recording.pressure_kpa.extend(cells.next().transpose()?);
            for (column, cell) in recording.counts.iter_mut().zip(cells) {
                column.push(cell?);
            }
        }
        Ok(recording)
    }

    /// Every so many scans.
    fn every(&self, stride: usize) -> Self {
        let every = |column: &[f64]| column.iter().copied().step_by(stride).collect();
        Self {
            time_s: every(&self.time_s),
            pressure_kpa: every(&self.pressure_kpa),
            counts: self.counts.iter().map(|column| every(column)).collect(),
        }
    }

    fn scans(&self) -> Scans<'_> {
        Scans {
            time_s: &self.time_s,
            pressure_kpa: Some(&self.pressure_kpa),
            counts: self.counts.iter().map(Vec::as_slice).collect(),
        }
    }
}

impl Insole {
    /// What came out, in words.
    pub fn sentences(&self) -> Vec<String> {
        let ours: Vec<&Entry> = self.entries.iter().filter(|entry| entry.ours).collect();
        let (Some(first), Some(last)) = (ours.first(), ours.last()) else { return Vec::new() };
        let words = |entry: &Entry| {
            let [a, b] = &entry.scores;
            format!(
                "{:.1} and {:.1} kPa (mean force {:.1} and {:.1} %)",
                a.taxel_rmse_kpa, b.taxel_rmse_kpa, a.area_percent, b.area_percent
            )
        };
        vec![format!(
            "On recordings of a real 280-taxel insole up to 339 kPa, `{}` fitted to {} scans is off by {} on the two \
             recordings that it never saw, and fitted to {} scans by {}.",
            last.recipe,
            first.scans,
            words(first),
            last.scans,
            words(last)
        )]
    }

    /// The pressure error of every recipe on both recordings.
    pub fn figure(&self) -> Figure {
        let mut lines: Vec<Line> = Vec::new();
        for (at, judged) in JUDGED.iter().enumerate() {
            for entry in &self.entries {
                let name = format!("{}; {judged}", entry.recipe);
                let mark = if entry.tared[at] { String::new() } else { "no zero".to_owned() };
                let (x, y) = (entry.scans as f64, entry.scores[at].taxel_rmse_kpa);
                let point = Point { x, y, mark, ..Point::default() };
                match lines.iter_mut().find(|line| line.name == name) {
                    Some(line) => line.points.push(point),
                    None => lines.push(Line { name, ours: entry.ours, points: vec![point], ..Line::default() }),
                }
            }
        }
        Figure {
            id: "b-insole".to_owned(),
            title: "A real insole: length of the calibration against the error of the pressure".to_owned(),
            caption: format!(
                "Fitted to every n-th scan of one recording to 339 kPa and back; judged on every {} of two others of other \
                 days, after a tare at rest where it could be proven.",
                self.step
            ),
            x: Axis::log("calibration length, scans"),
            y: Axis::linear("pressure error, mean over taxels of the RMSE, kPa"),
            lines,
            ..Figure::default()
        }
    }

    /// All figures.
    pub fn table(&self) -> Table {
        let columns = ["recipe", "scans", "judged on", "pressure, kPa", "median taxel, kPa", "mean force, %", "taxels"];
        let rows = self.entries.iter().flat_map(|entry| {
            JUDGED.iter().zip(&entry.scores).map(|(judged, score)| {
                let head = row![entry.recipe.as_str(), entry.scans as f64, *judged];
                let (mean, median) = (score.taxel_rmse_kpa, score.taxel_rmse_median_kpa);
                head.into_iter().chain(row![mean, median, score.area_percent, score.taxels as f64]).collect()
            })
        });
        let caption = "RMSE per taxel, mean and median over those that were read; mean force: error of the mean over all \
                       taxels above 30 kPa.";
        Table::new("b-insole-table", caption, columns, rows.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_read_column_by_column_and_thinned_out() {
        let text = "t_s,pressure_kpa,c0,c1\n0.0,1.5,240,239\n0.1,,238,\n0.2,2.5,237,236\n";
        let recording = Recording::parse(text.as_bytes()).unwrap();
        assert_eq!(recording.time_s, [0.0, 0.1, 0.2]);
        assert!(recording.pressure_kpa[1].is_nan() && recording.counts[1][1].is_nan());
        let half = recording.every(2);
        assert_eq!(half.time_s, [0.0, 0.2]);
        assert_eq!(half.counts, [[240.0, 237.0], [239.0, 236.0]]);
    }

    #[test]
    fn what_is_no_recording_is_refused_with_its_place() {
        let says = |text: &str| format!("{:#}", Recording::parse(text.as_bytes()).err().unwrap());
        assert!(says("x,y\n").contains("expected the header"));
        assert!(says("t_s,pressure_kpa,c0\n0,1,2\n0,1,many\n").contains("line 3: `many`"));
        assert!(measure(Path::new("no/such/folder"), true).unwrap().is_none());
    }
}
