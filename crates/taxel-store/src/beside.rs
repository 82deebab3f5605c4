//! The files beside the database: where they lie, and how one is replaced in one step.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt, fchown};
use std::path::{Path, PathBuf};

/// What a disk gives back or not at once.
const SECTOR_BYTES: usize = 4096;

/// Behind the name of a database: its log, what SQLite may share of that in memory, and the journal of one that has no log.
const LOG: &str = "-wal";
const SHARED: &str = "-shm";
const JOURNAL: &str = "-journal";

/// Behind it while a damaged one is put right: a new database that is whole and is to take its place, that one until it is whole,
/// and a copy of the damaged one.
pub(crate) const SUCCESSOR: &str = "-new";
pub(crate) const SUCCESSOR_PART: &str = "-new-part";
pub(crate) const COPY: &str = "-copy";

/// Behind the name of a small file until it is whole.
const PART: &str = "-part";

/// Behind that as well: what is kept of what was damaged or in the way, and its number.
const ASIDE: &str = ".damaged";

/// `path` with `suffix` behind its name.
pub(crate) fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path.as_os_str());
    name.push(suffix);
    name.into()
}

/// Links to what is not there that are followed, one after another.
const LINKS_MAX: usize = 8;

/// The file itself that `path` names, which may be a link. SQLite has the log beside that, and so do we have all else. What is
/// not there yet gets its name where a link says.
#[must_use]
pub fn real(path: &Path) -> PathBuf {
    let mut path = path.to_path_buf();
    for _ in 0..LINKS_MAX {
        if let Ok(real) = fs::canonicalize(&path) {
            return real;
        }
        let Ok(target) = fs::read_link(&path) else { break };
        path = folder(&path).join(target);
    }
    let named = fs::canonicalize(folder(&path)).ok().zip(path.file_name());
    named.map_or(path.clone(), |(folder, name)| folder.join(name))
}

/// The write-ahead log of a database.
pub(crate) fn wal(path: &Path) -> PathBuf {
    beside(path, LOG)
}

/// The rollback journal of a database that was written without a log.
pub(crate) fn journal(path: &Path) -> PathBuf {
    beside(path, JOURNAL)
}

/// Bytes of a database and its log.
pub(crate) fn bytes(path: &Path) -> u64 {
    let bytes = |file: &Path| fs::metadata(file).map_or(0, |file| file.len());
    bytes(path) + bytes(&wal(path))
}

/// Makes an empty file for a database if there is none, which its owner alone may read: the audit log is in it. SQLite gives
/// the log the same mode. That it cannot be made is found by whoever opens it.
pub(crate) fn make_private(path: &Path) {
    let _ = File::options().write(true).create_new(true).mode(0o600).open(path);
}

/// Gives a file to the owner of the database, if root has made it: the daemon's account could not open it otherwise, after a command
/// or a start by root. Whoever is not root owns both.
pub(crate) fn give_to_owner_of(database: &Path, file: &File) {
    if let Ok(owner) = fs::metadata(database) {
        let _ = fchown(file, Some(owner.uid()), Some(owner.gid()));
    }
}

/// What a process locks that has the database: see [`lock`](crate::lock).
pub(crate) fn lock(path: &Path) -> PathBuf {
    beside(path, "-lock")
}

/// There while the database is open: see [`open_mark`](crate::open_mark).
pub(crate) fn open_mark(path: &Path) -> PathBuf {
    beside(path, "-open")
}

/// There once the database was found damaged while it was open: the next start looks at all of it.
pub(crate) fn doubt_mark(path: &Path) -> PathBuf {
    beside(path, "-doubt")
}

/// What a start found lost, until it was told: see [`loss`](crate::loss).
pub(crate) fn loss_note(path: &Path) -> PathBuf {
    beside(path, "-loss")
}

/// The active model sets as plain text.
pub(crate) fn active(path: &Path) -> PathBuf {
    beside(path, "-active")
}

/// A new database that is whole and is to take the place of a damaged one.
pub(crate) fn successor(path: &Path) -> PathBuf {
    beside(path, SUCCESSOR)
}

/// Gives the file and its log further names that nothing has yet, so that they outlive what comes in their place. Gives
/// the name.
pub(crate) fn keep_aside(path: &Path) -> io::Result<PathBuf> {
    let name = free_name(path);
    link(path, &name)?;
    if wal(path).exists() {
        link(&wal(path), &wal(&name)).inspect_err(|_| drop(remove(&name)))?;
    }
    sync_folder(path)?;
    Ok(name)
}

/// Copies the log, which goes on being used, to a name that nothing has yet. Gives the name; nothing if there is no log.
pub(crate) fn keep_log(path: &Path) -> io::Result<Option<PathBuf>> {
    if !wal(path).exists() {
        return Ok(None);
    }
    let name = wal(&free_name(path));
    copy(&wal(path), &name)?;
    sync_folder(path)?;
    Ok(Some(name))
}

/// Gives what is no file and would end a start or hold it up, as it has the name of a log or journal, names that nothing has yet.
/// Gives those, each with what it was.
pub(crate) fn put_aside_no_files(path: &Path) -> io::Result<Vec<(PathBuf, PathBuf)>> {
    let in_the_way = [LOG, JOURNAL].into_iter().filter(|suffix| is_no_file(&beside(path, suffix)));
    in_the_way.map(|suffix| put_aside(path, suffix).map(|aside| (beside(path, suffix), aside))).collect()
}

/// Whether there is something that is no regular file: opening a pipe would wait for somebody, and a device has no end.
pub(crate) fn is_no_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| !found.is_file())
}

/// Gives what is in the way a name that nothing has yet, with the same `suffix`. Gives that.
pub(crate) fn put_aside(path: &Path, suffix: &str) -> io::Result<PathBuf> {
    let name = beside(&free_name(path), suffix);
    fs::rename(beside(path, suffix), &name)?;
    sync_folder(path)?;
    Ok(name)
}

/// A name for what is damaged. Where another takes it meanwhile, whoever uses it fails rather than overwrite that.
fn free_name(path: &Path) -> PathBuf {
    let names = (1_u32..).map(|number| beside(path, &format!("{ASIDE}-{number}")));
    let free = |name: &PathBuf| {
        ["", LOG, JOURNAL, SUCCESSOR].iter().all(|suffix| beside(name, suffix).symlink_metadata().is_err())
    };
    names.into_iter().find(free).unwrap_or_else(|| beside(path, ASIDE))
}

/// Whether a database has a second name as one that was found damaged. On a file system without such names none has.
pub(crate) fn is_kept_aside(path: &Path) -> bool {
    let identity = |file: &Path| fs::symlink_metadata(file).map(|file| (file.dev(), file.ino())).ok();
    let Some(database) = identity(path) else { return false };
    kept_aside(path).any(|name| identity(&name) == Some(database))
}

/// What was kept of what was damaged or in the way.
fn kept_aside(path: &Path) -> impl Iterator<Item = PathBuf> {
    let begin = beside(Path::new(path.file_name().unwrap_or_default()), ASIDE);
    let is_name = move |name: &OsStr| name.as_bytes().starts_with(begin.as_os_str().as_bytes());
    let entries = fs::read_dir(folder(path)).into_iter().flatten().flatten();
    entries.filter(move |entry| is_name(&entry.file_name())).map(|entry| entry.path())
}

/// All names that the store at `path` has for its files, whether they are there now or not, and what it has kept aside. Nobody else
/// may write to them.
#[must_use]
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let path = real(path);
    let databases = ["", SUCCESSOR, SUCCESSOR_PART, COPY].map(|suffix| beside(&path, suffix));
    let of_sqlite = |database: &PathBuf| ["", LOG, SHARED, JOURNAL].map(|suffix| beside(database, suffix));
    let small = [lock(&path), open_mark(&path), doubt_mark(&path), loss_note(&path), active(&path)];
    let until_whole = |file: &PathBuf| ["", PART].map(|suffix| beside(file, suffix));
    let own = databases.iter().flat_map(of_sqlite).chain(small.iter().flat_map(until_whole));
    own.chain(kept_aside(&path)).collect()
}

/// A second name for a file, or a copy where the file system has no such names.
fn link(from: &Path, to: &Path) -> io::Result<()> {
    if fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    copy(from, to)
}

/// Copies a file to one that is not there yet; of what there is no room for nothing stays.
pub(crate) fn copy(from: &Path, to: &Path) -> io::Result<()> {
    let mut copy = File::options().write(true).create_new(true).open(to)?;
    copy_readable(from, &mut copy).and_then(|()| copy.sync_all()).inspect_err(|_| {
        // A part of it says nothing and takes the room that the next attempt needs.
        let _ = remove(to);
    })
}

/// Copies a file to an empty one. A sector that the disk does not give back is zeros in the copy: a page of a database that
/// nothing is read of.
pub(crate) fn copy_readable(from: &Path, to: &mut File) -> io::Result<()> {
    let from = File::open(from)?;
    let length = from.metadata()?.len();
    let mut sector = [0; SECTOR_BYTES];
    for at in (0..length).step_by(SECTOR_BYTES) {
        let there = usize::try_from(length - at).unwrap_or(SECTOR_BYTES).min(SECTOR_BYTES);
        let part = &mut sector[..there];
        if let Err(error) = from.read_exact_at(part, at) {
            tracing::warn!(%error, at, "a part of a file cannot be read");
            part.fill(0);
        }
        to.write_all(part)?;
    }
    Ok(())
}

/// Writes a file beside a database as a whole: whoever reads it, also after a power cut, finds the old content or the new one.
pub(crate) fn replace(database: &Path, path: &Path, content: &[u8]) -> io::Result<()> {
    let part = beside(path, PART);
    let make = || File::options().write(true).create_new(true).open(&part);
    // In the way may be what a stop has left, or a pipe, which would be waited for.
    let mut file = make().or_else(|_| remove(&part).and_then(|()| make()))?;
    give_to_owner_of(database, &file);
    file.write_all(content)?;
    file.sync_all()?;
    fs::rename(&part, path)?;
    sync_folder(path)
}

/// Reads a small file; nothing if there is none.
///
/// # Errors
/// If it cannot be read, is no regular file, or has more than so many bytes.
pub(crate) fn read_small(path: &Path, bytes_max: u64) -> io::Result<Option<Vec<u8>>> {
    // Also where no more files can be opened, one that is not there is none.
    let about = match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        about => about?,
    };
    if !about.is_file() {
        return Err(io::Error::other("it is no regular file"));
    }
    if about.len() > bytes_max {
        return Err(io::Error::other(format!("it has {} bytes, expected at most {bytes_max}", about.len())));
    }
    let mut content = Vec::new();
    File::open(path)?.take(bytes_max).read_to_end(&mut content)?;
    Ok(Some(content))
}

/// Marks a file that may be damaged, so that the next start looks at all of it.
pub(crate) fn mark_doubt(path: &Path) {
    if let Err(error) = replace(path, &doubt_mark(path), &[]) {
        tracing::warn!(store = %path.display(), %error, "that the store is damaged could not be marked");
    }
}

/// Removes a file that may not be there.
pub(crate) fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// Makes names that were given or taken away in the folder of `path` outlive a power cut.
pub(crate) fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder(path))?.sync_all()
}

/// The folder of a file.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_removed_and_what_cannot_be_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, b"").unwrap();
        remove(&file).unwrap();
        remove(&file).unwrap();
        assert!(remove(folder.path()).is_err(), "a folder is none of the files");
    }

    #[test]
    fn a_link_is_the_file_that_it_names() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let [folder, elsewhere] = ["folder", "elsewhere"].map(|name| dir.path().join(name));
        fs::create_dir(&folder).unwrap();
        fs::create_dir(&elsewhere).unwrap();
        let link = folder.join("store.db");
        symlink("../elsewhere/other.db", &link).unwrap();
        let file = fs::canonicalize(&elsewhere).unwrap().join("other.db");
        assert_eq!(real(&link), file, "it is not there yet");
        fs::write(&file, b"").unwrap();
        assert_eq!([real(&link), real(&file)], [file.clone(), file]);
        let doubled = PathBuf::from(format!("/{}/new.db", elsewhere.display()));
        assert_eq!(real(&doubled), fs::canonicalize(&elsewhere).unwrap().join("new.db"));
        symlink("round", elsewhere.join("round")).unwrap();
        assert_eq!(real(&elsewhere.join("round")).file_name().unwrap(), "round");
        assert_eq!(real(Path::new("no/such/folder/store.db")), Path::new("no/such/folder/store.db"));
    }

    #[test]
    fn a_file_is_replaced_as_a_whole_whatever_a_stop_has_left() {
        let folder = tempfile::tempdir().unwrap();
        let [database, file] = ["store.db", "file"].map(|name| folder.path().join(name));
        replace(&database, &file, b"first").unwrap();
        fs::write(beside(&file, "-part"), b"the half of a longer one").unwrap();
        replace(&database, &file, b"second").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"second");
        assert!(!beside(&file, "-part").exists());
        let nowhere = folder.path().join("no/file");
        assert_eq!(replace(&database, &nowhere, b"").unwrap_err().kind(), io::ErrorKind::NotFound);
        assert_eq!(fs::read(&file).unwrap(), b"second");
    }

    #[test]
    fn a_small_file_is_read_and_none_of_another_kind_or_size() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        assert_eq!(read_small(&file, 4).unwrap(), None);
        fs::write(&file, b"four").unwrap();
        assert_eq!(read_small(&file, 4).unwrap().unwrap(), b"four");
        assert_eq!(read_small(&file, 3).unwrap_err().to_string(), "it has 4 bytes, expected at most 3");
        assert_eq!(read_small(folder.path(), 4).unwrap_err().to_string(), "it is no regular file");
        assert_eq!(read_small(&file.join("below"), 4).unwrap_err().kind(), io::ErrorKind::NotADirectory);
    }

    #[test]
    fn a_database_has_the_bytes_of_its_log_too() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("store.db");
        assert_eq!(bytes(&database), 0);
        fs::write(&database, [0; 4096]).unwrap();
        fs::write(wal(&database), [0; 100]).unwrap();
        assert_eq!(bytes(&database), 4196);
    }

    #[test]
    fn the_folder_of_a_name_alone_is_the_present_one() {
        sync_folder(Path::new("name")).unwrap();
        assert_eq!(sync_folder(Path::new("no/such/folder/name")).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
