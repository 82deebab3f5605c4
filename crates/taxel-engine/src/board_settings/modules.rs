//! Modules of a board in the words of its line: `0-3, 5 fingertip`. Triangles have no word.
//!
//! They number the taxels: models of other modules would be applied to taxels that they say nothing of, and nothing at rest
//! would tell.

use taxel_skin::{Module, ModuleKind};

/// Modules, ascending, with a word for each; those in a row that have the same word are told together.
pub fn in_words(modules: &[(Module, ModuleKind)], word: impl Fn(Module, ModuleKind) -> String) -> String {
    let told: Vec<(Module, String)> = modules.iter().map(|&(module, kind)| (module, word(module, kind))).collect();
    let runs = told.chunk_by(|a, b| a.0.get() + 1 == b.0.get() && a.1 == b.1);
    let in_words = runs.map(|run| match run {
        [(only, word)] => format!("{only}{word}"),
        [(first, word), .., (last, _)] => format!("{first}-{last}{word}"),
        [] => String::new(),
    });
    in_words.collect::<Vec<_>>().join(", ")
}

/// The word behind the numbers of modules of this kind, with the blank before it.
pub fn kind(_: Module, kind: ModuleKind) -> String {
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
        assert_eq!(in_words(&hand, kind), "0-1 fingertip, 3, 8 palm-pad11, 9 palm-pad7, 15 of 16 taxels");
    }
}
