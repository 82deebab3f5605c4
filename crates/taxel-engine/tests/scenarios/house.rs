//! Invariants of the house that the sources themselves must keep.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The crates that do no I/O, read no clock and know no runtime.
const PURE: [&str; 4] = ["taxel-skin", "taxel-wire", "taxel-model", "taxel-engine"];

/// The folder of all crates.
pub fn crates() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Names of the crates in the repository.
pub fn members() -> Vec<String> {
    let entries = fs::read_dir(crates()).unwrap().map(|entry| entry.unwrap());
    let mut names: Vec<String> = entries
        .filter(|entry| entry.path().join("Cargo.toml").is_file())
        .map(|entry| entry.file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// What a crate needs to run, straight from its manifest: keys of `[dependencies]`. Optional ones belong to a feature; that
/// a robot's build has none of them is looked at by tests/run.
fn dependencies(name: &str) -> Vec<String> {
    let manifest = read(&crates().join(name).join("Cargo.toml"));
    let section = manifest.lines().skip_while(|line| line.trim() != "[dependencies]").skip(1);
    let lines = section.take_while(|line| !line.starts_with('[')).map(str::trim);
    let entries = lines.filter(|line| !line.is_empty() && !line.starts_with('#') && !line.contains("optional = true"));
    entries.map(|line| line.split(['.', '=', ' ']).next().unwrap_or(line).to_owned()).collect()
}

/// Every Rust file below a folder.
pub fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            files.extend(sources(&entry));
        } else if entry.extension().is_some_and(|e| e == "rs") {
            files.push(entry);
        }
    }
    files
}

/// The code of a file without its comments. Test modules stand at the end of a file or in files of their own.
pub fn code(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if stem == "tests"
        || stem.ends_with("_tests")
        || path.strip_prefix(crates()).unwrap_or(path).iter().any(|part| part == "tests")
    {
        return String::new();
    }
    let text = read(path).replace("#[cfg(all(test, feature = \"sim\"))]", "#[cfg(test)]");
    let inline_tests = text.match_indices("#[cfg(test)]").find(|(at, mark)| {
        let after = text[at + mark.len()..].trim_start();
        let end = after.find(['{', ';']);
        end.is_some_and(|end| after[..end].contains("mod ") && after[end..].starts_with('{'))
    });
    let live = &text[..inline_tests.map_or(text.len(), |(at, _)| at)];
    live.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

fn words(code: &str) -> impl Iterator<Item = &str> {
    code.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|word| !word.is_empty())
}

/// None of which knows a runtime, a socket or a database.
const OF_PURE: [&str; 3] = ["nalgebra", "serde", "thiserror"];

#[test]
fn pure_crates_depend_on_nothing_but_each_other_and_what_is_pure_itself() {
    for name in PURE {
        let known = |needed: &String| PURE.contains(&needed.as_str()) || OF_PURE.contains(&needed.as_str());
        let others: Vec<String> = dependencies(name).into_iter().filter(|needed| !known(needed)).collect();
        assert_eq!(others, [""; 0], "{name}");
    }
    assert!(dependencies("taxel-can").contains(&"tokio".to_owned()), "the search finds what is there");
}

#[test]
fn pure_crates_do_no_io_and_read_no_clock() {
    let banned = ["Instant", "SystemTime", "fs", "net", "io", "thread", "process", "env", "File", "TcpStream", "async"];
    let mut files = 0;
    for name in PURE {
        for path in sources(&crates().join(name).join("src")) {
            let code = code(&path);
            files += usize::from(!code.is_empty());
            // `crate::io` is the engine's own boundary.
            let own = code.replace("crate::io", "").replace("mod io", "").replace("use io::", "");
            // What the compiler knows of the crate is no environment.
            let own = own.replace("env!(\"CARGO_PKG_VERSION\")", "");
            let found: Vec<&str> = words(&own).filter(|word| banned.contains(word)).collect();
            assert!(found.is_empty(), "{} names {found:?}", path.display());
        }
    }
    assert!(files > 50, "only {files} files were looked at");
}

/// The crates that call the system where no crate offers it in a safe form: each states its own lints, and allows `unsafe`
/// in one module.
const WITH_UNSAFE: [(&str, &str); 2] = [("taxel-can", "mod sys;"), ("taxel-shm", "mod map;")];

#[test]
fn unsafe_code_is_in_one_module_of_taxel_can_and_of_taxel_shm_alone() {
    let root = read(&crates().parent().unwrap().join("Cargo.toml"));
    assert!(root.contains("unsafe_code = \"forbid\""));
    let mut with_unsafe = BTreeSet::new();
    for name in members() {
        let manifest = read(&crates().join(&name).join("Cargo.toml"));
        let inherits = manifest.contains("[lints]\nworkspace = true");
        assert!(
            inherits || WITH_UNSAFE.iter().any(|(known, _)| *known == name),
            "{name} does not take the workspace's lints"
        );
        let folders = ["src", "tests", "benches", "examples"].map(|folder| crates().join(&name).join(folder));
        for path in folders.iter().flat_map(|folder| sources(folder)) {
            let text = read(&path);
            let live: String = text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
            let pieces = ["unsafe {", "unsafe fn", "unsafe impl", "unsafe extern", "unsafe trait"];
            // This file has to say what it looks for.
            if pieces.iter().any(|piece| live.contains(piece)) && !path.ends_with("scenarios/house.rs") {
                with_unsafe.insert(name.clone());
            }
        }
    }
    assert_eq!(with_unsafe, BTreeSet::from(WITH_UNSAFE.map(|(name, _)| name.to_owned())));
    for (name, module) in WITH_UNSAFE {
        let manifest = read(&crates().join(name).join("Cargo.toml"));
        for lint in
            ["unsafe_code = \"deny\"", "unsafe_op_in_unsafe_fn = \"deny\"", "undocumented_unsafe_blocks = \"warn\""]
        {
            assert!(manifest.contains(lint), "{name} lacks {lint}");
        }
        let lib = read(&crates().join(name).join("src/lib.rs"));
        assert_eq!(lib.matches("#[allow(unsafe_code)]").count(), 1, "{name}");
        assert!(lib.contains(&format!("#[allow(unsafe_code)]\n{module}")), "{name}");
    }
}
