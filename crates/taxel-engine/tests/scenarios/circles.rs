//! No file of a crate imports in a circle with another: whoever reads one file never needs a second one that needs
//! the first. The finder itself is tried on small made-up crates below.

mod imports;
mod modules;
mod tokens;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use imports::{Import, imports};
use modules::{Sources, modules};

use super::house::{code, crates, members, sources};

/// One circle: its files, and every import from one of them to another.
struct Circle {
    files: BTreeSet<String>,
    imports: Vec<Import>,
}

/// Every file that can be reached from each file by following imports.
fn reachable(imports: &[Import]) -> BTreeMap<&str, BTreeSet<&str>> {
    let mut direct: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for import in imports {
        direct.entry(&import.from).or_default().insert(&import.to);
    }
    let mut all = BTreeMap::new();
    for file in direct.keys() {
        let (mut seen, mut open) = (BTreeSet::new(), vec![*file]);
        while let Some(next) = open.pop() {
            let new = direct.get(next).into_iter().flatten().filter(|to| seen.insert(**to));
            open.extend(new.copied().collect::<Vec<_>>());
        }
        all.insert(*file, seen);
    }
    all
}

/// The circles of one crate: the groups of files of which each reaches every other one.
fn circles(crate_sources: &Sources) -> Vec<Circle> {
    let all = imports(crate_sources);
    let reach = reachable(&all);
    let mut found: Vec<Circle> = Vec::new();
    for (file, reached) in &reach {
        let known = found.iter().any(|circle| circle.files.contains(*file));
        if known || !reached.contains(file) {
            continue;
        }
        let back = |other: &&str| reach.get(other).is_some_and(|from_other| from_other.contains(file));
        let files: BTreeSet<String> = reached.iter().copied().filter(back).map(str::to_owned).collect();
        let inside = |import: &&Import| files.contains(&import.from) && files.contains(&import.to);
        let imports = all.iter().filter(inside).cloned().collect();
        found.push(Circle { files, imports });
    }
    found
}

/// A circle in words.
fn story(name: &str, circle: &Circle) -> String {
    let mut named: BTreeMap<(&str, &str), Vec<String>> = BTreeMap::new();
    for Import { from, line, path, to } in &circle.imports {
        named.entry((from, to)).or_default().push(format!("`{path}` in line {line}"));
    }
    let mut text = format!("{name}: {} files in a circle\n", circle.files.len());
    for ((from, to), paths) in named {
        text += &format!("    {from} names of {to}: {}\n", paths.join(", "));
    }
    text
}

/// All files of a crate, by their path below `src`.
fn read_crate(name: &str) -> Sources {
    let root = crates().join(name).join("src");
    let entry = |path: &std::path::PathBuf| {
        let relative = path.strip_prefix(&root).unwrap().to_string_lossy().into_owned();
        (relative, fs::read_to_string(path).unwrap())
    };
    sources(&root).iter().map(entry).collect()
}

#[test]
fn no_file_of_a_crate_imports_in_a_circle() {
    let mut found = String::new();
    for name in members().iter() {
        for circle in circles(&read_crate(name)) {
            found += &story(name, &circle);
        }
    }
    assert!(found.is_empty(), "\n{found}");
}

#[test]
fn the_search_for_circles_sees_every_file_that_is_not_a_test() {
    let mut files = 0;
    for name in members() {
        let crate_sources = read_crate(&name);
        let seen: BTreeSet<String> = modules(&crate_sources).into_values().map(|module| module.file).collect();
        let root = crates().join(&name).join("src");
        let live = crate_sources.into_keys().filter(|file| !code(&root.join(file)).is_empty());
        let missed: Vec<String> = live.filter(|file| !seen.contains(file)).collect();
        assert!(missed.is_empty(), "{name}: {missed:?}");
        files += seen.len();
    }
    assert!(files > 100, "only {files} files were looked at");
}

/// Sources of a made-up crate.
fn made_up(files: &[(&str, &str)]) -> Sources {
    files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect()
}

/// The files of each circle of a made-up crate.
fn found_in(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    circles(&made_up(files)).into_iter().map(|circle| circle.files.into_iter().collect()).collect()
}

#[test]
fn two_files_that_name_each_other_are_a_circle() {
    let lib = ("lib.rs", "mod a;\nmod b;\npub use a::A;");
    let a = ("a.rs", "use std::fmt;\n\nuse crate::b::{\n    self,\n    B as Other,\n};\npub struct A(Other);");
    let files = [lib, a, ("b.rs", "pub struct B;\nfn f() { let _ = crate::a::A; }")];
    let circle = circles(&made_up(&files)).pop().unwrap();
    let told = story("made-up", &circle);
    assert_eq!(
        told,
        "made-up: 2 files in a circle\n    \
         a.rs names of b.rs: `crate::b::self` in line 4, `crate::b::B` in line 5\n    \
         b.rs names of a.rs: `crate::a::A` in line 2\n"
    );
    let one_way = [lib, a, ("b.rs", "pub struct B;\n// crate::a::A\nconst S: &str = \"see crate::a::A\";")];
    assert_eq!(found_in(&one_way), Vec::<Vec<String>>::new());
}

#[test]
fn three_files_are_a_circle_through_what_they_reexport() {
    let files = [
        ("main.rs", "mod organ;\nuse organ::One;\nfn main() {}"),
        ("organ/mod.rs", "mod one;\nmod two;\npub use one::One;\npub use self::two::*;"),
        ("organ/one.rs", "use super::Two;\npub struct One(Two);"),
        (
            "organ/two.rs",
            "pub struct Two;\nimpl Two { fn one(self) -> super::super::organ::one::One { unreachable!() } }",
        ),
    ];
    assert_eq!(found_in(&files), [["organ/mod.rs", "organ/one.rs", "organ/two.rs"]]);
}

#[test]
fn importing_through_the_root_is_a_circle() {
    let files = [
        ("lib.rs", "mod a;\nmod b;\npub use {a::A, b::B};"),
        ("a.rs", "pub struct A;"),
        ("b.rs", "use crate::A;\npub struct B(A);"),
    ];
    assert_eq!(found_in(&files), [["b.rs", "lib.rs"]]);
}

#[test]
fn a_module_that_was_imported_leads_to_its_files() {
    let files = [
        ("lib.rs", "pub mod a;\npub mod b;"),
        ("a.rs", "pub mod deep;"),
        ("a/deep.rs", "use crate::b as other;\npub fn f() { other::g() }"),
        ("b.rs", "use crate::a::{self as there};\npub fn g() { there::deep::f::<>() }"),
    ];
    assert_eq!(found_in(&files), [["a/deep.rs", "b.rs"]]);
}

#[test]
fn a_child_may_import_what_lies_beside_its_parent_but_not_its_parent() {
    let lib = ("lib.rs", "mod ground;\nmod parent;");
    let parent = ("parent.rs", "mod child;\nuse crate::ground::G;\npub struct P(child::C, G);");
    let ground = ("ground.rs", "pub struct G;\n#[cfg(test)]\nmod tests {\n    use crate::parent::P;\n}");
    let clean = ("parent/child.rs", "use super::super::ground::G;\npub(in crate::parent) struct C(G);");
    assert_eq!(found_in(&[lib, parent, ground, clean]), Vec::<Vec<String>>::new());
    let by_attribute = ("parent/child.rs", "#[serde(default = \"super::f\")]\npub struct C;");
    assert_eq!(found_in(&[lib, parent, ground, by_attribute]), [["parent.rs", "parent/child.rs"]]);
    let by_inner_module = ("parent/child.rs", "pub struct C;\nmod inner { use super::super::P; }");
    assert_eq!(found_in(&[lib, parent, ground, by_inner_module]), [["parent.rs", "parent/child.rs"]]);
    let within = ("parent/child.rs", "pub struct C;\nmod inner { use super::C; }\nfn f() { inner::g() }");
    assert_eq!(found_in(&[lib, parent, ground, within]), Vec::<Vec<String>>::new());
}
