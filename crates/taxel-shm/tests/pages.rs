//! Pages between processes: whole samples, dead writers, dead readers, and what is refused.

#![allow(clippy::unwrap_used, clippy::panic)] // clippy exempts only functions that are tests themselves

mod common;

use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use common::{Child, LIMITS, folder, good, in_memory};
use taxel_shm::{Folder, NoForce, Page, Reader, Sample, State, now_ns};

#[test]
fn what_was_written_is_read_and_nothing_before_it() {
    let place = in_memory();
    let mut writer = folder(&place).page("palm", LIMITS).unwrap();
    let page = Page::open(writer.path()).unwrap();
    assert_eq!(page.newest(), None);
    assert_eq!(page.force(None), Err(NoForce::NothingYet));
    for sequence in 1..100 {
        let sample = good(sequence);
        writer.write(&sample);
        let newest = page.newest().unwrap();
        assert!(newest.written_ns > 0);
        assert_eq!(newest, Sample { written_ns: newest.written_ns, ..sample });
        assert_eq!(page.force(None).unwrap().total_n, sequence as f64);
    }
}

#[test]
fn a_force_that_nobody_renews_grows_old_while_the_writer_lives() {
    let place = in_memory();
    let mut writer = folder(&place).page("palm", LIMITS).unwrap();
    let page = Page::open(writer.path()).unwrap();
    let hour_ago = now_ns() - 3_600_000_000_000;
    writer.write(&Sample { monotonic_ns: Some(hour_ago), ..good(1) });
    assert!(matches!(page.force(None), Err(NoForce::TooOld(..))));
    writer.write(&good(2));
    assert!(page.force(None).is_ok());
    // The caller's own limit counts where it is stricter, and only there.
    let one_ns = Some(Duration::from_nanos(1));
    assert!(matches!(page.force(one_ns), Err(NoForce::TooOld(_, limit)) if Some(limit) == one_ns));
    writer.write(&Sample { monotonic_ns: Some(hour_ago), ..good(3) });
    assert!(page.force(Some(Duration::from_secs(86_400))).is_err());
    writer.write(&Sample { state: State::TareInvalid, total_n: None, ..good(4) });
    assert!(matches!(page.force(None), Err(NoForce::State(State::TareInvalid, _))));
}

#[test]
fn a_writer_that_ends_says_so_and_the_next_ones_page_is_found() {
    let place = in_memory();
    let path = place.path().join("palm");
    let mut reader = Reader::new(&path, None);
    assert_eq!(reader.force(), Err(NoForce::NoPage));
    let mut first = folder(&place).page("palm", LIMITS).unwrap();
    first.write(&good(1));
    assert_eq!(wait_for(&mut reader), 1.0);
    drop(first);
    assert!(!path.exists());
    assert_eq!(reader.force(), Err(NoForce::Closed), "and the reader still has the page");
    let mut second = folder(&place).page("palm", LIMITS).unwrap();
    second.write(&good(7));
    assert_eq!(wait_for(&mut reader), 7.0);
}

/// It may be killed as it starts: no sample is written then, nothing says that it has ended, and the next one puts its own page
/// in the place of that.
#[test]
fn a_page_without_a_sample_is_left_for_that_of_the_next_writer() {
    let place = in_memory();
    let folder = folder(&place);
    let first = folder.page("palm", LIMITS).unwrap();
    let path = first.path().to_owned();
    let mut reader = Reader::new(&path, None);
    assert_eq!(reader.force(), Err(NoForce::NothingYet));
    std::mem::forget(first);
    std::fs::remove_file(&path).unwrap();
    let mut second = folder.page("palm", LIMITS).unwrap();
    second.write(&good(7));
    assert_eq!(wait_for(&mut reader), 7.0);
}

#[test]
fn a_folder_in_the_place_of_a_page_is_refused_in_words_and_nothing_is_left_behind() {
    let place = in_memory();
    let folder = folder(&place);
    std::fs::create_dir(place.path().join("palm")).unwrap();
    let refused = folder.page("palm", LIMITS).unwrap_err().to_string();
    assert!(refused.contains("palm: naming the page: Is a directory"), "{refused}");
    let left: Vec<_> = std::fs::read_dir(place.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(!left.contains(&".palm.new".into()), "{left:?}");
    assert!(folder.page("sole", LIMITS).is_ok());
}

/// Reads until there is a force; a reader looks for a new page every 50 ms.
fn wait_for(reader: &mut Reader) -> f64 {
    let begun = Instant::now();
    loop {
        match reader.force() {
            Ok(force) => return force.total_n,
            Err(why) => assert!(begun.elapsed() < Duration::from_secs(60), "{why}"),
        }
        std::thread::yield_now();
    }
}

#[test]
fn a_writer_that_is_killed_gives_no_force_and_leaves_nothing_in_the_way() {
    let place = in_memory();
    let path = place.path().join("palm");
    let mut child = Child::start(place.path());
    let mut reader = Reader::new(&path, None);
    wait_for(&mut reader);
    child.kill();
    let begun = Instant::now();
    let why = loop {
        match reader.force() {
            Ok(_) => assert!(begun.elapsed() < Duration::from_secs(60), "a dead daemon looks alive"),
            Err(why) => break why,
        }
    };
    assert!(matches!(why, NoForce::WriterGone(_) | NoForce::TooOld(..)), "{why}");
    assert!(path.exists(), "nobody was left to remove it");
    // Its stamps do not come back to life, and the next daemon may have the folder and the name.
    let mut next = folder(&place).page("palm", LIMITS).unwrap();
    next.write(&good(3));
    assert_eq!(wait_for(&mut reader), 3.0);
}

#[test]
fn no_reader_of_another_process_sees_a_torn_sample() {
    common::stress(300_000, 2);
}

#[test]
fn pages_are_for_their_owner_to_write_and_for_the_group_to_read() {
    let place = in_memory();
    let writer = folder(&place).page("palm", LIMITS).unwrap();
    let about = std::fs::metadata(writer.path()).unwrap();
    assert_eq!((about.permissions().mode() & 0o7777, about.len()), (0o640, 4096));
    let made = place.path().join("made");
    let writer = Folder::open(&made, Some(about.gid())).unwrap().page("palm", LIMITS).unwrap();
    assert_eq!(std::fs::metadata(writer.path()).unwrap().mode() & 0o7777, 0o640);
    assert_eq!(std::fs::metadata(made).unwrap().mode() & 0o7777, 0o750);
}

#[test]
fn a_folder_that_others_have_or_that_a_disk_is_behind_is_refused() {
    let place = in_memory();
    let refused = |path: &std::path::Path| Folder::open(path, None).unwrap_err().to_string();
    let first = folder(&place);
    let said = refused(place.path());
    assert!(said.contains("another daemon publishes its pages there"), "{said}");
    drop(first);
    std::fs::set_permissions(place.path(), std::fs::Permissions::from_mode(0o777)).unwrap();
    let said = refused(place.path());
    assert!(said.contains("others could put pages of their own there"), "{said}");
    // A folder of this account on another kind of file system.
    let said = refused(std::path::Path::new(&format!("/proc/{}", std::process::id())));
    assert!(said.contains("expected a folder on a tmpfs"), "{said}");
    std::fs::set_permissions(place.path(), std::fs::Permissions::from_mode(0o700)).unwrap();
    assert!(Folder::open(place.path(), None).is_ok());
}

#[test]
fn what_is_no_page_is_told_with_what_was_expected() {
    let place = in_memory();
    let writer = folder(&place).page("palm", LIMITS).unwrap();
    let good = std::fs::read(writer.path()).unwrap();
    let other = place.path().join("other");
    let mut wrong_version = good.clone();
    wrong_version[8] = 9;
    for (bytes, expected) in [
        (vec![0; 4096], "this is not a page of taxeld"),
        (good[..100].to_vec(), "100 bytes, expected a file of 4096"),
        (wrong_version, "layout 9 of 4096 bytes, this reader knows 1"),
    ] {
        std::fs::write(&other, bytes).unwrap();
        let said = Page::open(&other).unwrap_err().to_string();
        assert!(said.contains(expected), "{said}");
    }
}

/// Programs that print what the readers of other languages make of a page, and their first arguments.
fn readers(place: &std::path::Path) -> Vec<(std::path::PathBuf, Vec<String>)> {
    let mut readers = Vec::new();
    for (compiler, flags) in [("gcc", ["-std=c11", "-xc"]), ("g++", ["-std=c++17", "-xc++"])] {
        let program = place.join(compiler);
        let source = common::repository().join("crates/taxel-shm/tests/print.c");
        let include = format!("-I{}", common::repository().join("deploy").display());
        let strict = ["-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"];
        let mut command = Command::new(compiler);
        command.args(flags).args(strict).arg(include).arg(source).arg("-o").arg(&program).arg("-lm");
        assert!(command.status().unwrap().success(), "{compiler}");
        readers.push((program, Vec::new()));
    }
    let python = common::repository().join("deploy/python/tests/print_page.py");
    readers.push(("python3".into(), vec![python.to_str().unwrap().to_owned()]));
    readers
}

/// Also of another account, as systemd makes `/run/taxeld` for the daemon's own.
#[test]
fn a_page_is_read_if_nobody_but_its_owner_can_write_in_it_or_in_its_folder() {
    const NOBODY: u32 = 65_534;
    let (place, programs) = (in_memory(), tempfile::tempdir().unwrap());
    let mut writer = folder(&place).page("palm", LIMITS).unwrap();
    writer.write(&good(1));
    let page = writer.path().to_owned();
    for path in [place.path(), &page] {
        if std::os::unix::fs::chown(path, Some(NOBODY), None).is_err() {
            eprintln!("SKIPPED in part: only root can make a page of another account");
        }
    }
    let mode = |path: &Path, mode| std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    let readers = readers(programs.path());
    for (of_page, of_folder, status) in [(0o640, 0o755, 0), (0o666, 0o755, 1), (0o640, 0o1777, 1)] {
        mode(&page, of_page);
        mode(place.path(), of_folder);
        writer.beat();
        let said = Page::open(&page).map(|page| page.force(None).unwrap().total_n);
        match status {
            0 => assert_eq!(said.unwrap(), 1.0),
            _ => assert!(said.unwrap_err().to_string().contains("others may write in it or in its folder")),
        }
        for (program, arguments) in &readers {
            let output = Command::new(program).args(arguments).arg(&page).output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
            assert!(said.starts_with(&format!("status {status}\n")), "{}: {said}", program.display());
        }
    }
}

#[test]
fn the_header_for_c_and_the_module_for_python_read_what_rust_reads() {
    let place = in_memory();
    let mut writer = folder(&place).page("palm", LIMITS).unwrap();
    let readers = readers(place.path());
    for sample in common::cases() {
        writer.write(&sample);
        let expected = common::printed(&Page::open(writer.path()).unwrap());
        for (program, arguments) in &readers {
            // What can be told only now would differ by the time that the programs take.
            writer.beat();
            let output = Command::new(program).args(arguments).arg(writer.path()).output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout).into_owned();
            let errors = String::from_utf8_lossy(&output.stderr);
            assert_eq!(said.trim(), expected.trim(), "{}: {errors}", program.display());
        }
    }
}

/// C and Python judge each case of the table as the daemon does.
#[test]
fn c_and_python_judge_as_the_daemon_does() {
    let place = in_memory();
    let repository = common::repository();
    let table = repository.join("crates/taxel-proto/src/judge.csv");
    let program = place.path().join("judge");
    let mut compile = Command::new("cc");
    compile.args(["-std=c11", "-Wall", "-Werror", "-I"]).arg(repository.join("deploy")).arg("-o").arg(&program);
    assert!(compile.arg(repository.join("crates/taxel-shm/tests/judge.c")).arg("-lm").status().unwrap().success());
    let mut python = Command::new("python3");
    python.arg(repository.join("deploy/python/tests/judge.py"));
    for mut command in [Command::new(program), python] {
        let output = command.arg(&table).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(String::from_utf8(output.stdout).unwrap().trim(), "28 cases");
    }
}

/// What [`Child`] runs: not a test of its own.
#[test]
#[ignore = "other tests of this file start it as a child process: cargo test -p taxel-shm --test pages"]
fn child() {
    common::child();
}
