//! DATA.csv: `t_s,pressure_kpa,c0,c1,...`, one row a scan, plain or gzipped. That of a session has two columns more and rows of
//! figures ([`Figure`]).

use std::io::Read;
use std::path::Path;

use anyhow::{Context, bail};
use taxel_engine::calibration::export::LAST_COLUMNS;
use taxel_engine::calibration::fit::Scans;
use taxel_files::open;
use taxel_files::say::error_line;
use taxel_skin::printable;

/// Most bad rows that are told one by one.
const TOLD_MAX: usize = 5;

/// Longest piece of a file that a message shows, in characters.
const SHOWN_CHARS_MAX: usize = 60;

/// With it some editors begin a file.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// Beyond this no number is a time, a pressure or a count.
const NUMBER_MAX: f64 = 1e15;

/// A recording, column by column. A cell that is empty or no number is NaN.
#[derive(Debug, Default)]
pub struct Recording {
    /// Time of each scan in seconds.
    pub time_s: Vec<f64>,
    /// The line of the file that each scan stands in, from 1.
    pub lines: Vec<u64>,
    /// Pressure in kPa; `None` if the file has no such column.
    pub pressure_kpa: Option<Vec<f64>>,
    /// One column per taxel.
    pub counts: Vec<Vec<f64>>,
    /// The ramp of each scan, from 1, where the file is an export of a session.
    pub ramps: Option<Vec<u16>>,
    /// What the session says beside its scans.
    pub figures: Vec<Figure>,
    /// Rows that were left out, and cells that were not numbers.
    pub refused: Refused,
}

/// A row of an exported session that is no scan; `taxel_engine::calibration::export` has what each is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// What it is.
    pub name: String,
    /// The ramp that it is of, from 1; 0 if it is of all.
    pub ramp: u16,
    /// Its cell under `pressure_kpa`; NaN if that is empty.
    pub kpa: f64,
    /// One per taxel; NaN if the cell is empty.
    pub cells: Vec<f64>,
}

/// What of a file could not be used.
#[derive(Debug, Default)]
pub struct Refused {
    /// Rows left out.
    pub rows: u64,
    /// Cells that are not finite numbers; they count as missing.
    pub cells: u64,
    /// The first few, with their places.
    pub told: Vec<String>,
}

impl Refused {
    fn tell(&mut self, why: String) {
        if self.told.len() < TOLD_MAX {
            self.told.push(why);
        }
    }
}

impl Recording {
    /// Reads a recording.
    ///
    /// # Errors
    /// A missing file, a header that is not `t_s[,pressure_kpa],c0,...`, or not one usable row.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let recording = Self::parse(open(path)?).with_context(|| path.display().to_string())?;
        let Refused { rows, cells, told } = &recording.refused;
        if rows + cells > 0 {
            let path = path.display();
            error_line(format_args!("{path}: left out {rows} rows and {cells} cells that could not be read:"));
            told.iter().for_each(|line| error_line(format_args!("  {line}")));
        }
        Ok(recording)
    }

    /// Reads a recording of anything that can be read.
    ///
    /// # Errors
    /// As [`Recording::read`].
    pub fn parse(mut input: impl Read) -> anyhow::Result<Self> {
        let mut bytes = Vec::new();
        let read = input.read_to_end(&mut bytes);
        read.with_context(|| format!("after line {}", bytes.iter().filter(|byte| **byte == b'\n').count()))?;
        let text = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&bytes);
        let mut lines = (1..).zip(text.split(|byte| *byte == b'\n')).filter(|(_, line)| !line.trim_ascii().is_empty());
        let mut recording = Self::under(&lines.next().map(|(_, line)| cells(line)).unwrap_or_default())?;
        for (number, line) in lines {
            recording.take_row(&cells(line), number);
        }
        if recording.time_s.is_empty() {
            bail!("not one usable row: {}", recording.refused.told.first().map_or("there is none", String::as_str));
        }
        Ok(recording)
    }

    /// An empty recording with the columns of a header.
    fn under(columns: &[&[u8]]) -> anyhow::Result<Self> {
        let (has_pressure, taxels) = match columns {
            [b"t_s", b"pressure_kpa", taxels @ ..] => (true, taxels),
            [b"t_s", taxels @ ..] => (false, taxels),
            _ => bail!(
                "line 1: the header begins with `{}`, expected `t_s,pressure_kpa,c0,c1,...`",
                shown(&columns.join(&b","[..]))
            ),
        };
        let (taxels, of_session) = match taxels.strip_suffix(&LAST_COLUMNS.map(str::as_bytes)) {
            Some(taxels) => (taxels, true),
            None => (taxels, false),
        };
        if taxels.is_empty() {
            bail!("line 1: the header has no taxel column: expected `t_s,pressure_kpa,c0,c1,...`");
        }
        if let Some(i) = (0..taxels.len()).find(|&i| taxels[i] != format!("c{i}").as_bytes()) {
            let (column, name) = (i + 2 + usize::from(has_pressure), shown(taxels[i]));
            bail!("line 1: column {column} is `{name}`, expected `c{i}`");
        }
        Ok(Self {
            pressure_kpa: has_pressure.then(Vec::new),
            ramps: of_session.then(Vec::new),
            counts: vec![Vec::new(); taxels.len()],
            ..Self::default()
        })
    }

    fn take_row(&mut self, row: &[&[u8]], line: u64) {
        if let Err(why) = self.try_row(row, line) {
            self.refused.rows += 1;
            self.refused.tell(format!("line {line}: {why}"));
        }
    }

    fn try_row(&mut self, row: &[&[u8]], line: u64) -> Result<(), String> {
        let own = 1 + usize::from(self.pressure_kpa.is_some()) + self.counts.len();
        let columns = own + self.ramps.as_ref().map_or(0, |_| LAST_COLUMNS.len());
        if row.len() != columns {
            return Err(format!("{} cells, the header has {columns}", row.len()));
        }
        let Some(ramp) = self.last_columns(row, own)? else { return Ok(()) };
        let time = number(row[0]).ok_or_else(|| format!("t_s is `{}`, expected seconds", shown(row[0])))?;
        self.time_s.push(time);
        self.lines.push(line);
        self.ramps.iter_mut().for_each(|ramps| ramps.push(ramp));
        let columns = self.pressure_kpa.as_mut().into_iter().chain(&mut self.counts);
        for ((cell, column), position) in row[1..].iter().zip(columns).zip(2..) {
            let value = number(cell).unwrap_or(f64::NAN);
            column.push(value);
            if value.is_nan() && !cell.is_empty() {
                self.refused.cells += 1;
                let why = "is no number from -1e15 to 1e15";
                self.refused.tell(format!("line {line}: `{}` (cell {position}) {why}", shown(cell)));
            }
        }
        Ok(())
    }

    /// The ramp of a scan, by the cells after its own; `None` if the row is a figure of a session, which is kept.
    fn last_columns(&mut self, row: &[&[u8]], own: usize) -> Result<Option<u16>, String> {
        if self.ramps.is_none() {
            return Ok(Some(0));
        }
        let (ramp, name) = (row[own], row[own + 1]);
        // A tool that knows no empty integers writes 1.0.
        let ramp = match number(ramp) {
            Some(ramp) if ramp.fract() == 0.0 && (1.0..=f64::from(u16::MAX)).contains(&ramp) => ramp as u16,
            None if ramp.is_empty() && !name.is_empty() => 0,
            _ => return Err(format!("ramp is `{}`, expected a number from 1", shown(ramp))),
        };
        if name.is_empty() {
            return Ok(Some(ramp));
        }
        let value = |position: usize| number(row[position]).unwrap_or(f64::NAN);
        let (kpa, first) = if self.pressure_kpa.is_some() { (value(1), 2) } else { (f64::NAN, 1) };
        let name = String::from_utf8_lossy(name).into_owned();
        self.figures.push(Figure { name, ramp, kpa, cells: (first..own).map(value).collect() });
        Ok(None)
    }

    /// How many scans.
    #[must_use]
    pub fn scans(&self) -> usize {
        self.time_s.len()
    }

    /// The scans as the engine takes them.
    #[must_use]
    pub fn as_scans(&self) -> Scans<'_> {
        Scans {
            time_s: &self.time_s,
            pressure_kpa: self.pressure_kpa.as_deref(),
            counts: self.counts.iter().map(Vec::as_slice).collect(),
        }
    }

    /// Keeps the scans that are marked, one mark a scan.
    pub fn retain(&mut self, kept: &[bool]) {
        keep(&mut self.time_s, kept);
        keep(&mut self.lines, kept);
        self.ramps.iter_mut().for_each(|ramps| keep(ramps, kept));
        self.pressure_kpa.iter_mut().chain(&mut self.counts).for_each(|column| keep(column, kept));
    }

    /// The figure of this name, if the recording is of a session that has it.
    #[must_use]
    pub fn figure(&self, name: &str) -> Option<&Figure> {
        self.figures.iter().find(|figure| figure.name == name)
    }
}

/// Keeps the values that are marked.
fn keep<T>(values: &mut Vec<T>, kept: &[bool]) {
    let mut marks = kept.iter();
    values.retain(|_| marks.next().is_none_or(|mark| *mark));
}

/// The cells of a line. A quote is a sign like any other, so that a stray one spoils its cell and not all rows up to the
/// next one.
fn cells(line: &[u8]) -> Vec<&[u8]> {
    line.split(|byte| *byte == b',').map(unquoted).collect()
}

/// A cell without blanks and quotes around it.
fn unquoted(cell: &[u8]) -> &[u8] {
    let cell = cell.trim_ascii();
    let inner = cell.strip_prefix(b"\"").and_then(|cell| cell.strip_suffix(b"\""));
    inner.map_or(cell, <[u8]>::trim_ascii)
}

/// A cell as a message shows it: on one line, short, and nothing that a terminal acts upon.
fn shown(cell: &[u8]) -> String {
    let text = printable(&String::from_utf8_lossy(cell)).to_string();
    match text.char_indices().nth(SHOWN_CHARS_MAX) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

fn number(cell: &[u8]) -> Option<f64> {
    let value: f64 = std::str::from_utf8(cell).ok()?.parse().ok()?;
    (value.abs() <= NUMBER_MAX).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> anyhow::Result<Recording> {
        Recording::parse(text.as_bytes())
    }

    #[test]
    fn a_recording_is_read_column_by_column_and_what_is_no_number_is_told_with_its_place() {
        let read =
            parse("\u{feff}t_s,pressure_kpa,c0,c1\r\n0.0,1.5,240,\"239\"\r\n0.1,,x,1e99\n0.2,3\n\n0.3,2,238,237\n")
                .unwrap();
        assert_eq!((read.time_s.as_slice(), read.lines.len()), ([0.0, 0.1, 0.3].as_slice(), 3));
        assert_eq!(read.counts[1][0], 239.0);
        assert!(read.counts[0][1].is_nan() && read.pressure_kpa.unwrap()[1].is_nan());
        let told = read.refused.told;
        assert_eq!((read.refused.rows, read.refused.cells), (1, 2));
        assert!(told[0].contains("line 3: `x` (cell 3)") && told[2] == "line 4: 2 cells, the header has 4", "{told:?}");
    }

    #[test]
    fn the_rows_of_a_session_are_scans_and_figures() {
        let read =
            parse("t_s,pressure_kpa,c0,ramp,figure\n,0.5,240.25,1,zero\n,,,,patch palm\n0,0.5,240,1,\n").unwrap();
        assert_eq!(read.ramps.as_deref(), Some([1].as_slice()));
        let zero = read.figure("zero").unwrap();
        assert_eq!((zero.ramp, zero.kpa, zero.cells.as_slice()), (1, 0.5, [240.25].as_slice()));
        assert_eq!(read.figures[1].name, "patch palm");
    }

    #[test]
    fn a_header_of_something_else_is_refused_with_what_was_expected() {
        for (text, says) in [
            ("x,y\n1,2\n", "expected `t_s,pressure_kpa,c0,c1,...`"),
            ("t_s,pressure_kpa\n1,2\n", "no taxel column"),
            ("t_s,c0,c2\n1,2,3\n", "column 3 is `c2`, expected `c1`"),
            ("t_s,c0\nx,2\n", "not one usable row: line 2: t_s is `x`"),
        ] {
            let error = format!("{:#}", parse(text).unwrap_err());
            assert!(error.contains(says), "{text:?}: {error}");
        }
    }
}
