//! The list of a board's modules, as a person writes it: `"0-3, 7"`, or with kinds `"0-4 fingertip, 8-11 palm"`.

use crate::ids::Module;
use crate::layout::ModuleKind;

/// What modules are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KindWord {
    /// Ten taxels, two thermal pads.
    Triangle,
    /// Twelve taxels: all generations of fingertips send the same.
    Fingertip,
    /// Twelve taxels of whatever shape.
    Twelve,
    /// iCub's palm: the four modules 8 to 11, each with one thermal pad.
    Palm,
    /// A palm module with its pad at value 11.
    PalmPad11,
    /// A palm module with its pad at value 7.
    PalmPad7,
}

impl KindWord {
    /// A word as the configuration has it.
    ///
    /// # Errors
    /// The words that there are.
    pub fn from_word(word: &str) -> Result<Self, String> {
        Ok(match word {
            "triangle" => Self::Triangle,
            "fingertip" => Self::Fingertip,
            "twelve" => Self::Twelve,
            "palm" => Self::Palm,
            "palm-pad11" => Self::PalmPad11,
            "palm-pad7" => Self::PalmPad7,
            _ => {
                return Err(format!(
                    "kind `{word}`: expected triangle, fingertip, twelve, palm, palm-pad11 or palm-pad7"
                ));
            }
        })
    }

    /// What it is at this place of a board.
    ///
    /// # Errors
    /// If a palm has no such module.
    pub fn at(self, module: Module) -> Result<ModuleKind, String> {
        Ok(match (self, module.get()) {
            (Self::Triangle, _) => ModuleKind::Triangle,
            (Self::Fingertip | Self::Twelve, _) => ModuleKind::Fingertip,
            (Self::PalmPad11, _) | (Self::Palm, 8..=10) => ModuleKind::PalmPad11,
            (Self::PalmPad7, _) | (Self::Palm, 11) => ModuleKind::PalmPad7,
            (Self::Palm, _) => {
                return Err(format!(
                    "module {module} cannot be `palm`, whose modules are 8 to 11: say `palm-pad11` or `palm-pad7`"
                ));
            }
        })
    }
}

/// Reads a list of modules; those without a kind of their own are triangles.
///
/// # Errors
/// What is wrong and what was expected.
pub fn parse_modules(text: &str) -> Result<Vec<(Module, ModuleKind)>, String> {
    let wrong = || {
        format!(
            "modules = \"{text}\": expected ascending numbers or ranges of 0 to 15, each with a kind of its own where \
             it has one, as in \"0-3, 7\" or \"0-4 fingertip, 8-11 palm\""
        )
    };
    let mut list: Vec<(Module, ModuleKind)> = Vec::new();
    for part in text.split(',').map(str::trim) {
        let (range, kind) = match part.split_once(|c: char| c.is_ascii_alphabetic()) {
            Some((range, _)) => (range.trim(), KindWord::from_word(part[range.len()..].trim())?),
            None => (part, KindWord::Triangle),
        };
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let parse = |word: &str| word.trim().parse::<u8>().ok().filter(|m| *m < 16).ok_or_else(wrong);
        let (first, last) = (parse(first)?, parse(last)?);
        if first > last || list.last().is_some_and(|(m, _)| m.get() >= first) {
            return Err(wrong());
        }
        for module in (first..=last).map(Module::from_nibble) {
            list.push((module, kind.at(module)?));
        }
    }
    Ok(list)
}

/// Modules as a configuration writes them: `0-4 fingertip, 8-11 palm`. Triangles have no word.
#[must_use]
pub fn written_modules(modules: &[(Module, ModuleKind)]) -> String {
    let word = |(module, kind): &(Module, ModuleKind)| match kind {
        ModuleKind::Triangle => "",
        ModuleKind::Fingertip => " fingertip",
        kind if KindWord::Palm.at(*module) == Ok(*kind) => " palm",
        ModuleKind::PalmPad11 => " palm-pad11",
        ModuleKind::PalmPad7 => " palm-pad7",
        ModuleKind::Cells(_) => "", // of a foreign array, which has no boards of iCub
    };
    let runs = modules.chunk_by(|a, b| a.0.get() + 1 == b.0.get() && word(a) == word(b));
    let written = runs.filter_map(|run| {
        let (first, last) = (run.first()?, run.last()?);
        let range = if first.0 == last.0 { first.0.to_string() } else { format!("{}-{}", first.0, last.0) };
        Some(range + word(first))
    });
    written.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        for text in
            ["0-15", "1, 5, 8-10, 12-13", "0-4 fingertip, 8-11 palm", "5-7 palm-pad11, 9 palm", "0, 1 palm-pad7"]
        {
            let read = parse_modules(text).unwrap();
            assert_eq!(parse_modules(&written_modules(&read)).unwrap(), read, "{text}");
        }
        let hand = parse_modules("0-4 fingertip, 8-11 palm").unwrap();
        assert_eq!(written_modules(&hand), "0-4 fingertip, 8-11 palm");
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_was_expected() {
        for (text, says) in [
            ("0-4 fingertop", "kind `fingertop`: expected triangle, fingertip"),
            ("5 palm", "module 5 cannot be `palm`"),
            ("3, 1", "expected ascending numbers"),
            ("0-16", "0 to 15"),
            ("fingertip", "expected ascending numbers"),
            ("", "expected ascending numbers"),
        ] {
            let message = parse_modules(text).unwrap_err();
            assert!(message.contains(says), "{text}: {message}");
        }
    }
}
