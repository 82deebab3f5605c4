//! `taxeld paper`: every figure and table of the paper that data can draw.

mod from_log;
mod from_store;
mod session;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use taxel_report::paper::{Data, Weighing, Weighings};

use crate::files;
use crate::fit::parse_seconds;
use crate::paper::session::name;
use crate::recording::{Recording, open};
use crate::soundness::{Wanted, check};

/// The header of every SQLite file.
const SQLITE: &[u8] = b"SQLite format 3\0";
/// With it some editors begin a file.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// What can be asked of the paper's figures.
#[derive(Debug, clap::Args)]
pub struct PaperArgs {
    /// A recording (`t_s,pressure_kpa,c0,...`) or a log as candump -l writes it, both plain or .gz, a recording of the daemon
    /// (.mcap) or a folder of these, or a store [default: a simulated forearm].
    data: Option<PathBuf>,
    /// Folder for the page, its pictures and tables; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Exclude taxels that move by less than so many counts, as the paper does.
    #[arg(long, value_name = "COUNTS", default_value_t = 10.0, value_parser = parse_seconds)]
    min_swing: f64,
    /// Which simulated skin.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// For a log: its buses, boards and gauge.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// For a store: the number of the session [default: the newest].
    #[arg(long, value_name = "NUMBER")]
    session: Option<u64>,
    /// Known loads that were read under these models: a table `kilogram,true_n,measured_n`, one row a load, the
    /// kilogram may be empty. A store has its own.
    #[arg(long, value_name = "LOADS.csv")]
    loads: Option<PathBuf>,
}

/// Draws the figures and writes the table.
///
/// # Errors
/// Data that cannot be read or have no pressure, a folder that cannot be written. A figure that the data cannot draw is
/// no error: it is left out, and the page and the table say why.
pub fn paper(args: &PaperArgs) -> anyhow::Result<()> {
    let began = Instant::now();
    let mut data = match &args.data {
        None => taxel_report::paper::simulate(args.seed, args.min_swing)?,
        Some(path) => read(path, args).with_context(|| path.display().to_string())?,
    };
    if let Some(path) = &args.loads {
        data = data.with_loads(vec![loads(path).with_context(|| path.display().to_string())?]);
    }
    let tables = taxel_report::paper::write(&args.out, &data, args.min_swing)?;
    say!("{}", tables.markdown().trim_end());
    say!();
    say!("{} ({:.1} s)", args.out.join("index.html").display(), began.elapsed().as_secs_f64());
    Ok(())
}

/// What kind of file it is, by how it begins.
enum Kind {
    Recording,
    Log,
    Store,
}

impl Kind {
    fn of(path: &Path) -> anyhow::Result<Self> {
        if files::is_standard(path) {
            bail!("what kind of file it is, is looked at first: name a file and not the standard input");
        }
        if path.is_dir() {
            return Ok(Self::Log); // of recordings of the bus
        }
        let mut begin = Vec::new();
        open(path)?.take(SQLITE.len() as u64).read_to_end(&mut begin)?;
        let text = begin.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&begin).trim_ascii_start();
        match text {
            _ if begin == SQLITE => Ok(Self::Store),
            [b't', ..] | [b'"', b't', ..] => Ok(Self::Recording),
            // A frame, a comment before the first one, a frame of a screen without a time, which the log's reader explains;
            // and what an MCAP file begins with.
            [b'(' | b'#' | 0x89, ..] => Ok(Self::Log),
            _ if begin.starts_with(b"  ") => Ok(Self::Log),
            _ => bail!(
                "neither a recording `t_s,pressure_kpa,c0,...`, nor a candump log `(SECONDS) can0 ID#DATA`, nor a store"
            ),
        }
    }
}

fn read(path: &Path, args: &PaperArgs) -> anyhow::Result<Data> {
    match Kind::of(path)? {
        Kind::Recording => recording(path),
        Kind::Log => {
            let config = args.config.as_ref().context("a log needs --config FILE: its buses, boards and gauge")?;
            from_log::read(path, config)
        }
        Kind::Store => from_store::read(path, args.session),
    }
}

fn recording(path: &Path) -> anyhow::Result<Data> {
    let mut recording = Recording::read(path)?;
    recording.report_refused(path);
    for note in check(&mut recording, Wanted::JUDGE)? {
        say!("{note}");
    }
    let scans = recording.scans();
    let Some(pressure) = recording.pressure_kpa else { bail!("there is no column `pressure_kpa`") };
    if !pressure.hi.iter().any(|kpa| kpa.is_finite()) {
        bail!("the column `pressure_kpa` has no finite number");
    }
    let counts = recording.counts.into_iter().map(|column| column.hi).collect();
    let data = Data::of_scans(format!("{}, {scans} scans", name(path)), pressure.hi, counts);
    Ok(data.without_loads("a recording has no known loads; --loads gives them"))
}

/// Known loads from a table.
fn loads(path: &Path) -> anyhow::Result<Weighings> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(open(path)?);
    let expected = ["kilogram", "true_n", "measured_n"];
    if reader.headers()?.iter().ne(expected) {
        bail!("line 1: expected the header `{}`", expected.join(","));
    }
    let mut all = Vec::new();
    for row in reader.deserialize::<(Option<f64>, f64, f64)>() {
        let (kilogram, true_n, measured_n) = row?;
        if !(true_n > 0.0 && true_n.is_finite() && measured_n.is_finite()) {
            bail!("load {}: {true_n} N and {measured_n} N, expected a force above 0 and a finite one", all.len() + 1);
        }
        all.push(Weighing { kilogram, true_n, measured_n });
    }
    Ok(Weighings { by: format!("as given in {}", name(path)), all })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_loads_is_read_or_refused_with_the_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("loads.csv");
        std::fs::write(&path, "kilogram,true_n,measured_n\n0.2,1.96,2.1\n,5.0,4.5\n").unwrap();
        let read = loads(&path).unwrap().all;
        assert_eq!(read[1], Weighing { kilogram: None, true_n: 5.0, measured_n: 4.5 });
        for (text, says) in [
            ("mass,true\n", "expected the header"),
            ("kilogram,true_n,measured_n\n1,0,1\n", "load 1: 0 N"),
            ("kilogram,true_n,measured_n\n1,x,1\n", "invalid float"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = format!("{:#}", loads(&path).unwrap_err());
            assert!(error.contains(says), "{text:?}: {error}");
        }
    }
}
