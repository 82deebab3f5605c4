//! No file of a crate imports in a circle with another: a reader of one file never needs a second one that needs the first.
//! Files are read as text: paths are what a `use` names and what has `::` elsewhere, without comments and tests.

use std::collections::{BTreeMap, BTreeSet};

use crate::house::{code, crates, members, sources};

/// Where a module stands: the names on the way from the root.
type Place = Vec<String>;

/// The text of each file of a crate.
type Files = BTreeMap<Place, String>;

/// `a/b.rs` and `a/b/mod.rs` are the module `a::b`.
fn place_of(file: &str) -> Place {
    let path = file.trim_end_matches(".rs").trim_end_matches("/mod");
    let path = if ["lib", "main"].contains(&path) { "" } else { path };
    path.split('/').filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// A tree of a `use` as paths, each with the name that it makes known.
fn expand(tree: &str) -> Vec<(String, String)> {
    let tree = tree.trim();
    if let Some((head, tail)) = tree.split_once('{') {
        let (inner, mut depth) = (tail.trim_end_matches('}'), 0);
        let parts = inner.split(|c: char| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == ',' && depth == 0
        });
        let parts: Vec<&str> = parts.filter(|part| !part.trim().is_empty()).collect();
        let itself = head.trim_end_matches("::").rsplit("::").next().unwrap_or_default();
        let named = |name: String| if name == "self" { itself.to_owned() } else { name };
        return parts.into_iter().flat_map(expand).map(|(path, name)| (format!("{head}{path}"), named(name))).collect();
    }
    let (path, name) = tree.split_once(" as ").unwrap_or((tree, tree.trim_end_matches("::self")));
    vec![(path.to_owned(), name.rsplit("::").next().unwrap_or_default().trim().to_owned())]
}

/// A text without what stands from each `begin` to the next `end`.
fn without(text: &str, begin: &str, end: &str) -> String {
    let mut parts = text.split(begin);
    let first = parts.next().unwrap_or_default();
    std::iter::once(first).chain(parts.map(|part| part.split_once(end).map_or("", |(_, rest)| rest))).collect()
}

/// All paths of a text, and under which name the first ones are known in it.
fn paths(text: &str) -> (Vec<String>, BTreeMap<String, String>) {
    let in_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let live = without(&without(text, "#[cfg(test)]", ";"), "pub(in ", ")");
    let (mut all, mut known) = (Vec::new(), BTreeMap::new());
    let mut before = "no";
    for part in live.split("use ") {
        let is_use = before.is_empty() || before.ends_with(char::is_whitespace);
        let (tree, rest) = if is_use { part.split_once(';').unwrap_or((part, "")) } else { ("", part) };
        before = part;
        for (path, name) in expand(tree) {
            known.insert(name, path.clone());
            all.push(path);
        }
        all.extend(rest.split(|c| !in_path(c)).filter(|word| word.contains("::")).map(str::to_owned));
    }
    (all, known)
}

/// The deepest module with a file that a path of the module at `place` leads to.
fn resolve(files: &Files, place: &[String], path: &str, known: &BTreeMap<String, String>) -> Option<Place> {
    let (first, rest) = path.split_once("::").unwrap_or((path, ""));
    let child = |place: &[String], name: &str| -> Place { place.iter().cloned().chain([name.to_owned()]).collect() };
    let mut found = match first {
        "crate" => Vec::new(),
        "self" => place.to_vec(),
        "super" => place[..place.len().checked_sub(1)?].to_vec(),
        _ if files.contains_key(&child(place, first)) => child(place, first),
        _ => {
            let whole = known.get(first).filter(|whole| !whole.starts_with(first))?;
            return resolve(files, place, &format!("{whole}::{rest}").replace("::self", ""), known);
        }
    };
    for name in rest.split("::") {
        match name {
            "super" => drop(found.pop()),
            _ if files.contains_key(&child(&found, name)) => found = child(&found, name),
            _ => break,
        }
    }
    Some(found)
}

/// Each file that is in a circle, with what it names of the others.
fn circles(files: &Files) -> Vec<String> {
    let mut named: BTreeMap<&Place, BTreeMap<Place, String>> = BTreeMap::new();
    for (place, text) in files {
        let (all, known) = paths(text);
        for path in all {
            let to = resolve(files, place, &path, &known).filter(|to| to != place && files.contains_key(to));
            named.entry(place).or_default().extend(to.map(|to| (to, path)));
        }
    }
    let reachable = |from: &Place| {
        let (mut seen, mut open) = (BTreeSet::<&Place>::new(), vec![from]);
        while let Some(next) = open.pop() {
            open.extend(named.get(next).into_iter().flat_map(BTreeMap::keys).filter(|to| seen.insert(*to)));
        }
        seen.into_iter().cloned().collect::<BTreeSet<Place>>()
    };
    let back = |place: &Place, to: &Place| reachable(to).contains(place);
    let told = named.iter().flat_map(|(place, all)| all.iter().map(move |(to, path)| (*place, to, path)));
    let told = told.filter(|(place, to, _)| back(place, to));
    told.map(|(place, _, path)| format!("{} names `{path}`", place.join("/"))).collect()
}

#[test]
fn no_file_of_a_crate_imports_in_a_circle() {
    for name in members() {
        let root = crates().join(&name).join("src");
        let place = |path: &std::path::Path| place_of(&path.strip_prefix(&root).unwrap().to_string_lossy());
        let beside_lib = |path: &std::path::PathBuf| path.ends_with("src/main.rs") && root.join("lib.rs").is_file();
        let all = sources(&root).into_iter().filter(|path| !beside_lib(path));
        let files: Files = all.map(|path| (place(&path), code(&path))).collect();
        assert_eq!(circles(&files), [""; 0], "{name}");
    }
    let both = [("a.rs", "use crate::b::{self, B as Other};"), ("b.rs", "fn f() { let _ = crate::a::A; }")];
    let files = both.into_iter().map(|(path, text)| (place_of(path), text.to_owned())).collect();
    assert_eq!(circles(&files), ["a names `crate::b::B`", "b names `crate::a::A`"], "the search finds what is there");
}
