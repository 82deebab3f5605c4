//! Which modules of a board belong to the patch, in the words of its line: `0-3, 5 fingertip`. Triangles have no word.
//!
//! They number the taxels: models of other modules would be applied to taxels that they say nothing of, and nothing at rest
//! would tell.

use taxel_skin::{Module, ModuleKind};

/// The enabled modules of a board, ascending.
pub fn in_words(modules: &[(Module, ModuleKind)]) -> String {
    let runs = modules.chunk_by(|a, b| a.0.get() + 1 == b.0.get() && a.1 == b.1);
    let told = |run: &[(Module, ModuleKind)]| {
        let (first, last, kind) = (run[0].0, run[run.len() - 1].0, run[0].1);
        let numbers = if first == last { first.to_string() } else { format!("{first}-{last}") };
        format!("{numbers}{}", word(kind))
    };
    runs.map(told).collect::<Vec<_>>().join(", ")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_are_told_in_runs_of_one_kind() {
        let module = |number| Module::new(number).unwrap();
        let hand = [
            (module(0), ModuleKind::Fingertip),
            (module(1), ModuleKind::Fingertip),
            (module(3), ModuleKind::Triangle),
            (module(8), ModuleKind::PalmPad11),
            (module(9), ModuleKind::PalmPad7),
            (module(15), ModuleKind::Cells(16)),
        ];
        assert_eq!(in_words(&hand), "0-1 fingertip, 3, 8 palm-pad11, 9 palm-pad7, 15 of 16 taxels");
    }
}
