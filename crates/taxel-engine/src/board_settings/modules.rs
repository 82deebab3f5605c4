//! Which modules of a board belong to the patch, in the words of its line: `0-3, 5 fingertip`. Triangles have no word.
//!
//! They number the taxels: models of other modules would be applied to taxels that they say nothing of, and nothing at rest
//! would tell.

use std::fmt;

use taxel_skin::{Module, ModuleKind};

/// The enabled modules of a board, ascending.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Modules(Vec<(Module, ModuleKind)>);

impl Modules {
    /// Of a board that has these enabled.
    pub fn of(modules: &[(Module, ModuleKind)]) -> Self {
        Self(modules.to_vec())
    }

    /// What the words tell; `None` if they are none of its own.
    pub fn read(text: &str) -> Option<Self> {
        let mut all = Vec::new();
        for run in text.split(", ") {
            let (numbers, kind) = run.split_once(' ').map_or((run, Some(ModuleKind::Triangle)), |(n, w)| (n, kind(w)));
            let (first, last) = numbers.split_once('-').unwrap_or((numbers, numbers));
            let (first, last): (u8, u8) = (first.parse().ok()?, last.parse().ok()?);
            for number in first..=last {
                all.push((Module::new(number).ok()?, kind?));
            }
        }
        (!all.is_empty()).then_some(Self(all))
    }
}

impl fmt::Display for Modules {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs = self.0.chunk_by(|a, b| a.0.get() + 1 == b.0.get() && a.1 == b.1);
        for (n, run) in runs.enumerate() {
            let (first, last, kind) = (run[0].0, run[run.len() - 1].0, run[0].1);
            let comma = if n > 0 { ", " } else { "" };
            let numbers = if first == last { first.to_string() } else { format!("{first}-{last}") };
            write!(f, "{comma}{numbers}{}", word(kind))?;
        }
        Ok(())
    }
}

/// The word behind the numbers of modules of this kind, with the blank before it.
fn word(kind: ModuleKind) -> String {
    match kind {
        ModuleKind::Triangle => String::new(),
        ModuleKind::Fingertip => " fingertip".to_owned(),
        ModuleKind::PalmPad11 => " palm-pad11".to_owned(),
        ModuleKind::PalmPad7 => " palm-pad7".to_owned(),
        ModuleKind::Cells(taxels) => format!(" of {taxels} taxels"),
    }
}

fn kind(word: &str) -> Option<ModuleKind> {
    match word {
        "fingertip" => Some(ModuleKind::Fingertip),
        "palm-pad11" => Some(ModuleKind::PalmPad11),
        "palm-pad7" => Some(ModuleKind::PalmPad7),
        _ => word.strip_prefix("of ")?.strip_suffix(" taxels")?.parse().ok().map(ModuleKind::Cells),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_as_the_same() {
        let module = |number| Module::new(number).unwrap();
        let hand = [
            (module(0), ModuleKind::Fingertip),
            (module(1), ModuleKind::Fingertip),
            (module(3), ModuleKind::Triangle),
            (module(8), ModuleKind::PalmPad11),
            (module(9), ModuleKind::PalmPad7),
            (module(15), ModuleKind::Cells(16)),
        ];
        let told = Modules::of(&hand).to_string();
        assert_eq!(told, "0-1 fingertip, 3, 8 palm-pad11, 9 palm-pad7, 15 of 16 taxels");
        for part in 1..=hand.len() {
            let modules = Modules::of(&hand[..part]);
            assert_eq!(Modules::read(&modules.to_string()), Some(modules));
        }
    }

    #[test]
    fn what_no_version_has_written_is_not_known() {
        for odd in ["", " ", "0-", "-3", "16", "0-16", "3-1", "0 thumb", "0 of 300 taxels", "0,1", "0, "] {
            assert_eq!(Modules::read(odd), None, "{odd}");
        }
    }
}
