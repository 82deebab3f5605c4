//! The tree of a crate's modules, and the file that each lies in.

use std::collections::BTreeMap;

use super::tokens::{Token, is_word, tokens, without_tests};

/// The text of every file of a crate, by its path below `src`.
pub type Sources = BTreeMap<String, String>;

/// Where a module stands: the crate's root file (`lib.rs`, `main.rs`), then the names on the way.
pub type Place = Vec<String>;

/// One module.
#[derive(Clone, Debug)]
pub struct Module {
    /// The file that holds its text, by its path below `src`.
    pub file: String,
    /// Whether its text is the whole file, not a part in braces.
    pub whole: bool,
}

/// Follows the braces of a file, and so knows the module that each token stands in.
pub struct Walk {
    place: Place,
    depth: usize,
    /// Depths outside of the inline modules that are open.
    open: Vec<usize>,
}

impl Walk {
    /// Starts at the top of the file whose module stands at `place`.
    pub fn new(place: Place) -> Walk {
        Walk { place, depth: 0, open: Vec::new() }
    }

    /// The module that the present token stands in.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// Goes over the token at `at`. Returns a module that is declared there, and whether it has a file of its own.
    pub fn step(&mut self, tokens: &[Token<'_>], at: usize) -> Option<(Place, bool)> {
        let text = |at: usize| tokens.get(at).map_or("", |token| token.text);
        match text(at) {
            "mod" if is_word(text(at + 1)) && text(at + 2) == "{" => {
                self.place.push(text(at + 1).to_owned());
                self.open.push(self.depth);
                return Some((self.place.clone(), false));
            }
            "mod" if is_word(text(at + 1)) && text(at + 2) == ";" => {
                return Some((child(&self.place, text(at + 1)), true));
            }
            "{" => self.depth += 1,
            "}" => {
                self.depth = self.depth.saturating_sub(1);
                if self.open.last() == Some(&self.depth) {
                    self.open.pop();
                    self.place.pop();
                }
            }
            _ => {}
        }
        None
    }
}

/// The place of a module's child.
pub fn child(place: &[String], name: &str) -> Place {
    place.iter().cloned().chain([name.to_owned()]).collect()
}

/// The file of the module at `place`: `a/b.rs` or `a/b/mod.rs`.
fn file_of(sources: &Sources, place: &Place) -> String {
    let path = place[1..].join("/");
    let files = [format!("{path}.rs"), format!("{path}/mod.rs")];
    let found = files.iter().find(|file| sources.contains_key(*file));
    found.unwrap_or_else(|| panic!("no file for the module {}", place.join("::"))).clone()
}

/// Every module of a crate that is not a test's.
pub fn modules(sources: &Sources) -> BTreeMap<Place, Module> {
    let mut found = BTreeMap::new();
    let roots = ["lib.rs", "main.rs"].into_iter().filter(|root| sources.contains_key(*root));
    let mut open: Vec<(Place, String)> = roots.map(|root| (vec![root.to_owned()], root.to_owned())).collect();
    assert!(!open.is_empty(), "the crate has no root");
    while let Some((place, file)) = open.pop() {
        let tokens = without_tests(tokens(&sources[&file]));
        let mut walk = Walk::new(place.clone());
        for at in 0..tokens.len() {
            match walk.step(&tokens, at) {
                Some((declared, true)) => open.push((declared.clone(), file_of(sources, &declared))),
                Some((declared, false)) => drop(found.insert(declared, Module { file: file.clone(), whole: false })),
                None => {}
            }
        }
        found.insert(place, Module { file, whole: true });
    }
    found
}
