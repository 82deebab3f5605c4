//! Every target on its corpus, on what once failed, and on random changes of both, the same in each run.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod change;

use std::fmt::Display;
use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

use change::Random;
use taxel_fuzz::{TARGETS, Target};

/// Longest input that changes make, in bytes: each target has to be quick without optimisation.
const BYTES_MAX: usize = 2048;

/// The inputs of a target in one of the folders, in the order of their names.
fn inputs(folder: &str, target: &Target) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join(target.name);
    let Ok(entries) = fs::read_dir(folder) else { return vec![] };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), fs::read(path).unwrap())).collect()
}

/// Runs one input. One that fails is kept, and the test says how to run it again.
fn run(target: &Target, input: &[u8], from: impl Display) {
    if catch_unwind(|| (target.run)(input)).is_ok() {
        return;
    }
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("failed-{}", target.name));
    fs::write(&kept, input).unwrap();
    panic!(
        "target {} fails on {from}, kept as {}\n  {}\nagain: FUZZ_INPUT={} cargo test -p taxel-fuzz one_input",
        target.name,
        kept.display(),
        input.escape_ascii(),
        kept.display(),
    );
}

#[test]
fn what_was_kept_holds() {
    for target in TARGETS {
        let seeds = inputs("corpus", target);
        assert!(!seeds.is_empty(), "{} has no corpus", target.name);
        for (path, input) in seeds.into_iter().chain(inputs("finds", target)) {
            run(target, &input, path.display());
        }
        run(target, &[], "nothing");
    }
}

/// Changes of what was kept, the same ones in each run.
#[test]
fn random_changes_of_it_hold() {
    for target in TARGETS {
        let kept = inputs("corpus", target).into_iter().chain(inputs("finds", target));
        let kept: Vec<Vec<u8>> = kept.map(|(_, input)| input).collect();
        let mut random = Random::new(target.name);
        for number in 0..target.changes {
            let mut input = kept[random.below(kept.len())].clone();
            let other = &kept[random.below(kept.len())];
            change::change(&mut input, other, &mut random);
            input.truncate(BYTES_MAX);
            run(target, &input, format_args!("change {number}"));
        }
    }
}

/// `FUZZ_INPUT=FILE cargo test -p taxel-fuzz one_input`: a file whose path names its target, as those that failed do.
#[test]
fn one_input() {
    let Some(path) = std::env::var_os("FUZZ_INPUT").map(PathBuf::from) else { return };
    let name = path.display().to_string();
    let target = TARGETS.iter().filter(|target| name.contains(target.name)).max_by_key(|target| target.name.len());
    (target.unwrap().run)(&fs::read(path).unwrap());
}
