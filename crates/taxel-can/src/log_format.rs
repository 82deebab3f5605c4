//! Logs of other programs, known by their first bytes: how they become one of candump.

use std::fmt;

/// So many bytes are looked at.
pub(crate) const HEAD_BYTES: usize = 64;

/// A format that is not read here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ForeignLog {
    /// One that python-can reads; what it is, and how its names end.
    PythonCan(&'static str, &'static str),
    /// A table of SavvyCAN; the column of the bus, from 1.
    SavvyCan(usize),
}

impl ForeignLog {
    /// What a log with these first bytes is, where it is none of candump.
    pub(crate) fn of(head: &[u8]) -> Option<Self> {
        let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start();
        let begins =
            |with: &str| head.get(..with.len()).is_some_and(|bytes| bytes.eq_ignore_ascii_case(with.as_bytes()));
        let known = [
            ("LOGG", "a Vector BLF log", "blf"),
            ("date ", "a Vector ASC log", "asc"),
            ("base hex", "a Vector ASC log", "asc"),
            ("base dec", "a Vector ASC log", "asc"),
            (";", "a PEAK trace", "trc"),
            ("MDF ", "an MF4 measurement", "mf4"),
            ("timestamp,arbitration_id", "a table of python-can", "csv"),
            ("SQLite format 3", "a database of python-can", "db"),
        ];
        if begins("Time Stamp,ID,Extended") {
            let columns = head.split(|byte| *byte == b',').map(<[u8]>::trim_ascii);
            return Some(Self::SavvyCan(1 + columns.take_while(|column| *column != b"Bus").count()));
        }
        let found = known.into_iter().find(|(with, ..)| begins(with));
        found.map(|(_, what, ending)| Self::PythonCan(what, ending))
    }
}

impl fmt::Display for ForeignLog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PythonCan(what, ending) => write!(
                f,
                "it is {what}, which is not read. Convert it: `pip install python-can && can_logconvert IN.{ending} OUT.log`"
            ),
            Self::SavvyCan(bus) => write!(
                f,
                "it is a table of SavvyCAN, which is not read. Convert it: `awk -F, \
                 'NR>1{{i=$3==\"true\"?$2:substr($2,6);d=\"\";for(n=1;n<=${};n++)d=d $({}+n);\
                 printf \"(%.6f) can%d %s#%s\\n\",$1/1e6,${bus},i,d}}' IN.csv > OUT.log`",
                bus + 1,
                bus + 1
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_of_other_programs_are_refused_with_the_command_that_converts_them() {
        for (head, ending) in [
            ("LOGG\0\0\0", "blf"),
            ("date Sam Sep 13 12:26:40 2020\nbase hex  timestamps absolute\n", "asc"),
            ("base hex  timestamps absolute\n", "asc"),
            (";$FILEVERSION=1.1\n;$STARTTIME=43008.3\n", "trc"),
            ("timestamp,arbitration_id,extended,remote,error,dlc,data\n", "csv"),
        ] {
            let said = ForeignLog::of(head.as_bytes()).unwrap().to_string();
            assert!(said.contains(&format!("can_logconvert IN.{ending} OUT.log")), "{said}");
        }
        for (head, bus) in [
            ("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n", 5),
            ("Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n", 4),
        ] {
            let savvy = ForeignLog::of(head.as_bytes()).unwrap();
            assert_eq!(savvy, ForeignLog::SavvyCan(bus));
            let (length, command) = (bus + 1, savvy.to_string());
            assert!(command.contains(&format!("n<=${length};n++)d=d $({length}+n)")), "{command}");
        }
        for candump in ["(1.0) can0 301#\n", "# a comment\n", "", " (1.0)  can0  301   [0]\n"] {
            assert_eq!(ForeignLog::of(candump.as_bytes()), None);
        }
    }
}
