//! iCub's position files as they are in the wild.
//!
//! Such a file has header lines (`name`, `spatial_sampling`, `taxel2Repr (...)`), a line `[calibration]` and then one row
//! a port index: `x y z nx ny nz` in metres, in the link's frame. Six zeros mean "no such taxel". Files differ in how
//! `taxel2Repr` is written and in whether thermal pads have coordinates, so neither decides what a taxel is: the
//! patch's layout does.

use thiserror::Error;

use crate::layout::VALUES_PER_MODULE;

/// Position and outward unit normal of a taxel, metres, in the frame of the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelPose {
    /// Position in metres.
    pub position: [f64; 3],
    /// Outward unit normal; zero if the file has none for this taxel.
    pub normal: [f64; 3],
}

/// A position file that cannot be read.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum GeometryError {
    /// There is no `[calibration]` line and no row.
    #[error("no line `[calibration]` and no row of six numbers: the rows of positions must follow that line")]
    NoSection,
    /// A row is not six finite numbers.
    #[error("line {line}: `{text}`: expected six finite numbers x y z nx ny nz")]
    Row {
        /// Line in the file, from 1.
        line: usize,
        /// The row, shortened.
        text: String,
    },
    /// A coordinate cannot be on a robot.
    #[error("line {line}: position {value} m is beyond 10 m: the file must be in metres")]
    NotMetres {
        /// Line in the file, from 1.
        line: usize,
        /// The coordinate.
        value: String,
    },
    /// Too few rows for the patch.
    #[error("{rows} rows of positions, but taxel {taxel} of the patch is row {row}")]
    TooFewRows {
        /// Rows in the file.
        rows: usize,
        /// First taxel without a row.
        taxel: usize,
        /// Where its row would be.
        row: usize,
    },
    /// No taxel of the patch has a position.
    #[error("none of the {taxels} taxels of the patch has a position in the file")]
    NothingPlaced {
        /// Taxels of the patch.
        taxels: usize,
    },
}

/// A position file, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionFile {
    name: Option<String>,
    rows: Vec<Option<TaxelPose>>,
}

impl PositionFile {
    /// Reads a position file. Carriage returns, tabs, `#` comments, blank lines, a byte order mark and missing header
    /// lines are tolerated.
    ///
    /// # Errors
    /// [`GeometryError`] with the line.
    pub fn parse(text: &str) -> Result<Self, GeometryError> {
        let text = text.trim_start_matches('\u{feff}');
        let contents = || text.lines().map(content).enumerate();
        let section = contents().position(|(_, line)| is_section(line));
        let first_row = || contents().position(|(line, row)| parse_row(row, line + 1).is_ok());
        let first = section.map(|line| line + 1).or_else(first_row).ok_or(GeometryError::NoSection)?;
        let header = |line: &str| Some(line.strip_prefix("name")?.strip_prefix([' ', '\t'])?.trim().to_owned());
        let name = contents().take(first).find_map(|(_, line)| header(line)).filter(|name| !name.is_empty());
        let rows = contents().skip(first).take_while(|(_, line)| !line.starts_with('['));
        let rows = rows.filter(|(_, line)| !line.is_empty()).map(|(line, row)| parse_row(row, line + 1));
        Ok(Self { name, rows: rows.collect::<Result<_, _>>()? })
    }

    /// The link that the file names in its header, for example `l_forearm`.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// One entry per port index, 192 x board position + 12 x module + value; `None` for six zeros.
    #[must_use]
    pub fn rows(&self) -> &[Option<TaxelPose>] {
        &self.rows
    }

    /// The modules of which a row has a position, numbered over all boards: 16 x board position + module.
    #[must_use]
    pub fn modules(&self) -> Vec<usize> {
        let modules = self.rows.chunks(VALUES_PER_MODULE).enumerate();
        modules.filter(|(_, rows)| rows.iter().any(Option::is_some)).map(|(module, _)| module).collect()
    }
}

/// A line without its comment.
fn content(line: &str) -> &str {
    line.split('#').next().unwrap_or("").trim()
}

fn is_section(line: &str) -> bool {
    let inside = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    inside.is_some_and(|word| word.trim().eq_ignore_ascii_case("calibration"))
}

fn parse_row(content: &str, line: usize) -> Result<Option<TaxelPose>, GeometryError> {
    let wrong = || GeometryError::Row { line, text: content.chars().take(60).collect() };
    let mut numbers = [0.0; 6];
    let mut words = content.split_whitespace();
    for number in &mut numbers {
        *number = words.next().and_then(|w| w.parse().ok()).filter(|v: &f64| v.is_finite()).ok_or_else(wrong)?;
    }
    if words.next().is_some() {
        return Err(wrong());
    }
    let [x, y, z, nx, ny, nz] = numbers;
    if let Some(value) = [x, y, z].into_iter().find(|v| v.abs() > 10.0) {
        return Err(GeometryError::NotMetres { line, value: value.to_string() });
    }
    let somewhere = [x, y, z] != [0.0; 3];
    Ok(somewhere.then_some(TaxelPose { position: [x, y, z], normal: [nx, ny, nz] }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sloppy_files_are_read() {
        let plain = "name l_hand\nspatial_sampling taxel\n[calibration]\n0 0 0 0 0 0\n0.1 0.2 0.3 0 0 1\n";
        let expected = PositionFile::parse(plain).unwrap();
        assert_eq!((expected.name(), expected.rows().len(), expected.modules()), (Some("l_hand"), 2, vec![0]));
        for sloppy in [
            plain.replace('\n', "\r\n"),
            plain.replace(' ', "\t \t"),
            plain.replace("[calibration]", " [ Calibration ]  # rows"),
            format!("\u{feff}{plain}"),
            plain.replace("\n0", "\n\n# a comment\n  0"),
            format!("{plain}[other]\nnot numbers\n"),
            plain.replace("[calibration]\n", ""),
            plain.replace("0.1", "+1.0e-1"),
        ] {
            assert_eq!(PositionFile::parse(&sloppy).unwrap(), expected, "{sloppy:?}");
        }
        let bare = PositionFile::parse("0.1 0.2 0.3 0 0 1\n").unwrap();
        assert_eq!((bare.name(), bare.rows().len()), (None, 1));
    }
}
