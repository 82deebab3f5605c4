//! Which file names a path into which other one.

use std::collections::BTreeMap;

use super::modules::{Module, Place, Sources, Walk, child, modules};
use super::tokens::{Token, is_word, tokens, without_tests};

/// One file names something of another one of the same crate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Import {
    /// The file that names.
    pub from: String,
    /// Its line, from 1.
    pub line: usize,
    /// The path as it is written, its groups taken apart.
    pub path: String,
    /// The deepest file that the path leads to.
    pub to: String,
}

/// A path as it is written.
#[derive(Clone, Debug)]
struct Path<'a> {
    segments: Vec<&'a str>,
    line: usize,
    /// The name under which a `use` makes its target known.
    name: Option<&'a str>,
}

/// Takes the tree of a `use` apart from `at` on. Returns the place after it.
fn use_tree<'a>(tokens: &[Token<'a>], mut at: usize, prefix: &[&'a str], found: &mut Vec<Path<'a>>) -> usize {
    let mut segments = prefix.to_vec();
    while let Some(&Token { text, line }) = tokens.get(at) {
        at += 1;
        match text {
            "::" => {}
            "{" => {
                while tokens.get(at).is_some_and(|token| token.text != "}") {
                    at = use_tree(tokens, at, &segments, found);
                    at += usize::from(tokens.get(at).is_some_and(|token| token.text == ","));
                }
                return at + 1;
            }
            _ => segments.push(text),
        }
        let next = tokens.get(at).map_or("", |token| token.text);
        if next == "::" || text == "::" {
            continue;
        }
        let last = segments.iter().rev().find(|segment| **segment != "self").copied();
        let renamed = (next == "as").then(|| tokens.get(at + 1).map_or("_", |token| token.text));
        found.push(Path { segments, line, name: renamed.or(last) });
        return at + if renamed.is_some() { 2 } else { 0 };
    }
    at
}

/// The path that begins at `at` in the midst of code, if it has more than one segment.
fn inline_path<'a>(tokens: &[Token<'a>], at: usize) -> Option<(Path<'a>, usize)> {
    let before = |back: usize| at.checked_sub(back).map_or("", |at| tokens[at].text);
    let visibility = before(1) == "in" && before(2) == "(" && before(3) == "pub";
    if before(1) == "::" || visibility || !is_word(tokens[at].text) {
        return None;
    }
    let (mut segments, mut end) = (vec![tokens[at].text], at + 1);
    while let [colons, word, ..] = tokens[end..] {
        if colons.text != "::" || !is_word(word.text) {
            break;
        }
        segments.push(word.text);
        end += 2;
    }
    (segments.len() > 1).then(|| (Path { segments, line: tokens[at].line, name: None }, end))
}

/// All paths of a file, each with the module that it stands in.
fn paths<'a>(tokens: &[Token<'a>], place: &Place) -> Vec<(Place, Path<'a>)> {
    let (mut walk, mut found, mut at) = (Walk::new(place.clone()), Vec::new(), 0);
    while let Some(token) = tokens.get(at) {
        let after = tokens.get(at + 1).map_or("", |token| token.text);
        // Where `<` follows, `use` lists what a return type captures.
        if token.text == "use" && after != "<" {
            let mut uses = Vec::new();
            at = use_tree(tokens, at + 1, &[], &mut uses);
            found.extend(uses.into_iter().map(|path| (walk.place().clone(), path)));
        } else if let Some((path, end)) = inline_path(tokens, at) {
            found.push((walk.place().clone(), path));
            at = end;
        } else {
            walk.step(tokens, at);
            at += 1;
        }
    }
    found
}

/// What leads from a path to a module.
struct Resolver<'m> {
    modules: &'m BTreeMap<Place, Module>,
    /// Modules that a `use` made known, by the module that it stands in and the name.
    known: BTreeMap<(Place, String), Place>,
}

impl Resolver<'_> {
    /// The deepest module on a path that is of this crate, and whether the path ends with it.
    fn resolve(&self, place: &Place, segments: &[&str]) -> Option<(Place, bool)> {
        let first = *segments.first()?;
        let named = child(place, first);
        let (mut found, mut rest) = match first {
            "crate" => (vec![place[0].clone()], &segments[1..]),
            "self" | "super" => (place.clone(), segments),
            _ if self.modules.contains_key(&named) => (named, &segments[1..]),
            _ => (self.known.get(&(place.clone(), first.to_owned()))?.clone(), &segments[1..]),
        };
        while let [segment, more @ ..] = rest {
            let next = child(&found, segment);
            match *segment {
                "self" => {}
                "super" => drop(found.pop()),
                _ if self.modules.contains_key(&next) => found = next,
                _ => return Some((found, false)),
            }
            rest = more;
        }
        Some((found, true))
    }
}

/// Every import of one file of a crate from another one, tests aside.
pub fn imports(sources: &Sources) -> Vec<Import> {
    let modules = modules(sources);
    let mut found = Vec::new();
    for (place, Module { file, .. }) in modules.iter().filter(|(_, module)| module.whole) {
        let tokens = without_tests(tokens(&sources[file]));
        let all = paths(&tokens, place);
        let mut resolver = Resolver { modules: &modules, known: BTreeMap::new() };
        for (at, path) in &all {
            if let (Some(name), Some((target, true))) = (path.name, resolver.resolve(at, &path.segments)) {
                resolver.known.insert((at.clone(), name.to_owned()), target);
            }
        }
        for (at, path) in &all {
            let Some((target, _)) = resolver.resolve(at, &path.segments) else { continue };
            let to = modules[&target].file.clone();
            if to != *file {
                found.push(Import { from: file.clone(), line: path.line, path: path.segments.join("::"), to });
            }
        }
    }
    found
}
