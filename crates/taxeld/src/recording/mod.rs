//! DATA.csv: `t_s,pressure_kpa,c0,c1,...`, one row a scan, plain or gzipped. That of a session has two columns more and rows of
//! figures ([`Figure`]).

mod blocks;
mod column;

use std::io::{self, BufReader, Read};
use std::path::Path;
use std::sync::OnceLock;

use anyhow::{Context, bail};
use flate2::read::MultiGzDecoder;
use taxel_engine::calibration::export::LAST_COLUMNS;
use taxel_model::parse_decimal;
use taxel_skin::printable;

use crate::files;
use crate::recording::blocks::{Blocks, lines_in, parts};
pub use crate::recording::column::Column;
use crate::say::{error_line, short};
use crate::threads;

/// How a file is cut, to be parsed on several threads.
#[derive(Clone, Copy)]
struct Parts {
    /// A block is parsed at once, bytes.
    block_bytes: usize,
    /// Less is not worth a thread, bytes.
    least_bytes: usize,
}

/// A thread parses so much of a file at a time, bytes.
const PART_BYTES: usize = 1 << 20;
/// A line that is as long is none of a recording: a row of 6,500 taxels has 60 kB.
const LINE_BYTES_MAX: usize = PART_BYTES;
const PARTS: Parts = Parts { block_bytes: PART_BYTES, least_bytes: 1 << 16 };

/// Most bad rows that are told one by one.
const TOLD_MAX: usize = 5;

/// A recording, column by column. A cell that is empty or not finite is NaN.
#[derive(Debug, Default)]
pub struct Recording {
    /// Time of each scan in seconds.
    pub time_s: Vec<f64>,
    /// The line of the file that each scan stands in, from 1.
    pub lines: Vec<u64>,
    /// Pressure in kPa; `None` if the file has no such column.
    pub pressure_kpa: Option<Column>,
    /// One column per taxel.
    pub counts: Vec<Column>,
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
    fn tell(&mut self, what: impl FnOnce() -> String) {
        if self.told.len() < TOLD_MAX {
            self.told.push(what());
        }
    }

    fn append(&mut self, other: Self) {
        self.rows += other.rows;
        self.cells += other.cells;
        self.told.extend(other.told);
        self.told.truncate(TOLD_MAX);
    }
}

/// Longest piece of a file that a message shows, in characters.
const SHOWN_CHARS_MAX: usize = 60;

/// Opens a file, plain or gzipped by its first bytes; `-` is the standard input.
///
/// # Errors
/// The file's path and the system's reason.
pub fn open(path: &Path) -> anyhow::Result<Box<dyn Read>> {
    let mut file = BufReader::with_capacity(1 << 16, files::reader(path)?);
    let begin = std::io::BufRead::fill_buf(&mut file).with_context(|| path.display().to_string())?;
    let gzipped = begin.starts_with(&[0x1F, 0x8B]);
    Ok(if gzipped { Box::new(MultiGzDecoder::new(file)) } else { Box::new(file) })
}

impl Recording {
    /// Reads a recording.
    ///
    /// # Errors
    /// A missing file, a header that is not `t_s[,pressure_kpa],c0,...`, or not one usable row.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        Self::parse(open(path)?).with_context(|| path.display().to_string())
    }

    /// Reads a recording of anything that can be read.
    ///
    /// # Errors
    /// As [`Recording::read`].
    pub fn parse(input: impl Read) -> anyhow::Result<Self> {
        Self::parse_in(Parts { block_bytes: PART_BYTES * threads::count(), ..PARTS }, input)
    }

    fn parse_in(cut: Parts, input: impl Read) -> anyhow::Result<Self> {
        let mut blocks = Blocks::new(input, cut.block_bytes);
        let first = blocks.next(0)?.unwrap_or_default();
        check_line(&first, 1)?;
        let recording = if in_one_piece(&first) {
            let mut reader = reader(Lines::after(0, blocks.from(first)), true);
            let mut recording = Self::under(reader.byte_headers()?)?;
            recording.take_rows(reader, 0, &[])?;
            recording
        } else {
            let mut first = first;
            let mut reader = reader(first.as_slice(), true);
            let mut recording = Self::under(reader.byte_headers()?)?;
            let (begin, line) = (reader.position().byte() as usize, reader.position().line());
            first.drain(..begin);
            recording.take_blocks(cut, blocks, first, line - 1)?;
            recording
        };
        if recording.time_s.is_empty() {
            let reason = recording.refused.told.first().map_or("there is none", String::as_str);
            bail!("not one usable row: {reason}");
        }
        Ok(recording)
    }

    /// An empty recording with the columns of a header.
    fn under(header: &csv::ByteRecord) -> anyhow::Result<Self> {
        let (has_pressure, of_session, taxels) = check_header(header)?;
        Ok(Self::with_columns(has_pressure, of_session, taxels))
    }

    fn with_columns(has_pressure: bool, of_session: bool, taxels: usize) -> Self {
        Self {
            pressure_kpa: has_pressure.then(Column::default),
            ramps: of_session.then(Vec::new),
            counts: vec![Column::default(); taxels],
            ..Self::default()
        }
    }

    /// Takes a block of rows and those after it, whose first stands in the line after `lines_before`.
    fn take_blocks(
        &mut self,
        cut: Parts,
        mut blocks: Blocks<impl Read>,
        first: Vec<u8>,
        lines_before: u64,
    ) -> anyhow::Result<()> {
        let (mut block, mut lines) = (Some(first), lines_before);
        while let Some(text) = block {
            check_line(&text, lines + 1)?;
            if in_one_piece(&text) {
                return self.take_rows(reader(Lines::after(lines, blocks.from(text)), false), lines, &[]);
            }
            self.take_block(cut, &text, lines)?;
            lines += lines_in(&text);
            block = blocks.next(lines)?;
        }
        Ok(())
    }

    /// Takes the rows of a block, several at the same time.
    fn take_block(&mut self, cut: Parts, text: &[u8], lines_before: u64) -> anyhow::Result<()> {
        let parts = parts(text, threads::count(), cut.least_bytes);
        let found: Vec<OnceLock<anyhow::Result<Self>>> = parts.iter().map(|_| OnceLock::new()).collect();
        threads::each(parts.len(), &|number| {
            let (before, part) = parts[number];
            let mut recording =
                Self::with_columns(self.pressure_kpa.is_some(), self.ramps.is_some(), self.counts.len());
            let taken = recording.take_rows(reader(part, false), lines_before + before, part);
            let _ = found[number].set(taken.map(|()| recording));
        });
        found.into_iter().filter_map(OnceLock::into_inner).try_for_each(|part| part.map(|part| self.append(part)))
    }

    /// Takes all rows of a reader, whose text tells how many empty lines it skipped before a row; without it they are not counted.
    fn take_rows(&mut self, mut reader: csv::Reader<impl Read>, lines_before: u64, text: &[u8]) -> anyhow::Result<()> {
        let mut row = csv::ByteRecord::new();
        let line = |at: &csv::Position| {
            let rest = text.get(at.byte() as usize..).unwrap_or_default();
            let skipped = rest.iter().take_while(|byte| matches!(byte, b'\n' | b'\r')).filter(|byte| **byte == b'\n');
            lines_before + at.line() + skipped.count() as u64
        };
        loop {
            match reader.read_byte_record(&mut row) {
                Ok(true) => self.take_row(&row, row.position().map_or(0, line)),
                Ok(false) => return Ok(()),
                Err(error) if matches!(error.kind(), csv::ErrorKind::Io(_)) => return Err(error.into()),
                Err(error) => {
                    self.refused.rows += 1;
                    self.refused.tell(|| error.to_string());
                }
            }
        }
    }

    fn take_row(&mut self, row: &csv::ByteRecord, line: u64) {
        let own = 1 + usize::from(self.pressure_kpa.is_some()) + self.counts.len();
        let columns = own + if self.ramps.is_some() { LAST_COLUMNS.len() } else { 0 };
        if row.len() != columns {
            self.refused.rows += 1;
            let cells = row.len();
            return self.refused.tell(|| format!("line {line}: {cells} cells, the header has {columns}"));
        }
        let ramp = match self.last_columns(row, own) {
            Ok(Some(ramp)) => ramp,
            Ok(None) => return, // a figure
            Err(why) => {
                self.refused.rows += 1;
                return self.refused.tell(|| format!("line {line}: {why}"));
            }
        };
        let mut cells = row.iter().map(unquoted).take(own);
        let first = cells.next().unwrap_or_default();
        let Some((time, _)) = number(first) else {
            self.refused.rows += 1;
            let text = shown(first);
            return self.refused.tell(|| format!("line {line}: t_s is `{text}`, expected seconds"));
        };
        self.time_s.push(time);
        self.lines.push(line);
        self.ramps.iter_mut().for_each(|ramps| ramps.push(ramp));
        let pressure = self.pressure_kpa.as_mut().into_iter();
        for ((cell, column), number_of) in cells.zip(pressure.chain(&mut self.counts)).zip(2..) {
            let (hi, lo) = number(cell).unwrap_or((f64::NAN, 0.0));
            column.push(hi, lo);
            if hi.is_nan() && !cell.is_empty() {
                self.refused.cells += 1;
                let text = shown(cell);
                self.refused.tell(|| format!("line {line}: `{text}` (cell {number_of}) {}", why_no_number(cell)));
            }
        }
    }

    /// The ramp of a scan, by the cells after its own; `None` if the row is a figure of a session, which is kept.
    fn last_columns(&mut self, row: &csv::ByteRecord, own: usize) -> Result<Option<u16>, String> {
        if self.ramps.is_none() {
            return Ok(Some(0));
        }
        let cell = |position: usize| unquoted(row.get(position).unwrap_or_default());
        let (ramp, name) = (cell(own), cell(own + 1));
        // A tool that knows no empty integers writes 1.0.
        let ramp = match number(ramp) {
            Some((ramp, _)) if ramp.fract() == 0.0 && (1.0..=f64::from(u16::MAX)).contains(&ramp) => ramp as u16,
            None if ramp.is_empty() && !name.is_empty() => 0,
            _ => return Err(format!("ramp is `{}`, expected a number from 1", shown(ramp))),
        };
        if name.is_empty() {
            return Ok(Some(ramp));
        }
        let value = |position: usize| number(cell(position)).map_or(f64::NAN, |(value, _)| value);
        let (kpa, first) = if self.pressure_kpa.is_some() { (value(1), 2) } else { (f64::NAN, 1) };
        let name = String::from_utf8_lossy(name).into_owned();
        self.figures.push(Figure { name, ramp, kpa, cells: (first..own).map(value).collect() });
        Ok(None)
    }

    /// Goes on with the rows of another recording of the same columns.
    fn append(&mut self, other: Self) {
        self.time_s.extend(other.time_s);
        self.lines.extend(other.lines);
        let columns = self.pressure_kpa.as_mut().into_iter().chain(&mut self.counts);
        columns.zip(other.pressure_kpa.iter().chain(&other.counts)).for_each(|(column, other)| column.append(other));
        self.ramps.iter_mut().zip(other.ramps).for_each(|(ramps, other)| ramps.extend(other));
        self.figures.extend(other.figures);
        self.refused.append(other.refused);
    }

    /// How many scans.
    pub fn scans(&self) -> usize {
        self.time_s.len()
    }

    /// Keeps the scans that are marked, one mark a scan.
    pub fn retain(&mut self, kept: &[bool]) {
        keep(&mut self.time_s, kept);
        keep(&mut self.lines, kept);
        self.ramps.iter_mut().for_each(|ramps| keep(ramps, kept));
        for column in self.pressure_kpa.as_mut().into_iter().chain(&mut self.counts) {
            keep(&mut column.hi, kept);
            column.lo.iter_mut().for_each(|lo| keep(lo, kept));
        }
    }

    /// Prints what could not be used.
    pub fn report_refused(&self, path: &Path) {
        if self.refused.rows + self.refused.cells == 0 {
            return;
        }
        let (rows, cells) = (self.refused.rows, self.refused.cells);
        error_line(format_args!("{}: left out {rows} rows and {cells} cells that could not be read:", path.display()));
        for line in &self.refused.told {
            error_line(format_args!("  {line}"));
        }
    }
}

/// Keeps the values that are marked.
fn keep<T>(values: &mut Vec<T>, kept: &[bool]) {
    let mut marks = kept.iter();
    values.retain(|_| marks.next().is_none_or(|mark| *mark));
}

/// What is read in one piece, up to a line that no row of a recording has.
struct Lines<R> {
    input: R,
    line: u64,
    begun: usize,
}

impl<R: Read> Lines<R> {
    /// Of which so many lines were read before.
    const fn after(lines: u64, input: R) -> Self {
        Self { input, line: lines + 1, begun: 0 }
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let read = self.input.read(into)?;
        for part in into[..read].split_inclusive(|byte| *byte == b'\n') {
            self.begun += part.len();
            if self.begun > LINE_BYTES_MAX {
                return Err(io::Error::other(too_long(self.line)));
            }
            if part.ends_with(b"\n") {
                (self.line, self.begun) = (self.line + 1, 0);
            }
        }
        Ok(read)
    }
}

fn too_long(line: u64) -> String {
    format!("line {line} has {LINE_BYTES_MAX} bytes or more, which no row of a recording has")
}

/// Refuses a block in which no line ends: the rest of the file could be one.
fn check_line(block: &[u8], line: u64) -> anyhow::Result<()> {
    if block.len() >= LINE_BYTES_MAX && !block.contains(&b'\n') {
        bail!(too_long(line));
    }
    Ok(())
}

/// Rows, or a header and rows, as a table. A quote is a sign like any other, so that a stray one spoils its cell and not
/// all rows up to the next one.
fn reader<R: Read>(input: R, headed: bool) -> csv::Reader<R> {
    let mut builder = csv::ReaderBuilder::new();
    builder.has_headers(headed).flexible(true).quoting(false).trim(csv::Trim::All).from_reader(input)
}

/// Whether what follows can only be read in one piece: a byte order mark (its first byte is EF) is one at the very
/// beginning alone, and without the end of a line there are no parts. Nothing at all is no piece: the first block may end
/// with the header.
fn in_one_piece(text: &[u8]) -> bool {
    text.contains(&0xEF) || !(text.is_empty() || text.contains(&b'\n'))
}

/// A cell without the quotes around it.
fn unquoted(cell: &[u8]) -> &[u8] {
    let inner = cell.strip_prefix(b"\"").and_then(|cell| cell.strip_suffix(b"\""));
    inner.map_or(cell, <[u8]>::trim_ascii)
}

/// Whether there is a pressure column, whether the table is one of a session, and how many taxels it has.
fn check_header(header: &csv::ByteRecord) -> anyhow::Result<(bool, bool, usize)> {
    let columns: Vec<&[u8]> = header.iter().map(unquoted).collect();
    let (has_pressure, taxels) = match columns.as_slice() {
        [b"t_s", b"pressure_kpa", taxels @ ..] => (true, taxels),
        [b"t_s", taxels @ ..] => (false, taxels),
        _ => bail!(
            "line 1: the header begins with `{}`, expected `t_s,pressure_kpa,c0,c1,...`",
            shown(&columns.join(&b","[..]))
        ),
    };
    let of_session = |taxels: &[&[u8]]| taxels.ends_with(&LAST_COLUMNS.map(str::as_bytes));
    let (of_session, taxels) = match of_session(taxels) {
        true => (true, &taxels[..taxels.len() - LAST_COLUMNS.len()]),
        false => (false, taxels),
    };
    if taxels.is_empty() {
        bail!("line 1: the header has no taxel column: expected `t_s,pressure_kpa,c0,c1,...`");
    }
    for (i, name) in taxels.iter().enumerate() {
        if *name != format!("c{i}").as_bytes() {
            let (column, name) = (i + 2 + usize::from(has_pressure), shown(name));
            bail!("line 1: column {column} is `{name}`, expected `c{i}`");
        }
    }
    Ok((has_pressure, of_session, taxels.len()))
}

/// A cell as a message shows it: on one line, and nothing that a terminal acts upon.
fn shown(cell: &[u8]) -> String {
    short(&printable(&String::from_utf8_lossy(cell)), SHOWN_CHARS_MAX)
}

/// What is wrong with a cell that is no number of a recording.
fn why_no_number(cell: &[u8]) -> &'static str {
    let text = std::str::from_utf8(cell).unwrap_or_default().trim();
    let has_digits = text.bytes().any(|byte| byte.is_ascii_digit());
    if has_digits && text.parse::<f64>().is_ok() {
        "is beyond what a pressure or a count can be, expected a number from -1e15 to 1e15"
    } else {
        "is not a finite number"
    }
}

/// A finite decimal; short integers, the bulk of all cells, without the long way.
fn number(cell: &[u8]) -> Option<(f64, f64)> {
    if !cell.is_empty() && cell.len() <= 6 && cell.iter().all(u8::is_ascii_digit) {
        let value = cell.iter().fold(0_u32, |v, d| v * 10 + u32::from(d - b'0'));
        return Some((f64::from(value), 0.0));
    }
    let value = parse_decimal(std::str::from_utf8(cell).ok()?)?;
    value.hi.is_finite().then_some((value.hi, value.lo))
}

#[cfg(test)]
mod tests;
