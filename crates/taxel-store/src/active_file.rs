//! The active model sets once more, as a plain file beside the database: with it the daemon has its force also when the
//! database cannot be read.
//!
//! The first line says which activation was the newest and what follows; then comes each set as MODELS.json.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};
use taxel_model::bounded::{List, Text};

use crate::beside;
use crate::models_json::limits::TEXT_BYTES_MAX;
use crate::rows;

const FORMAT: &str = "taxeld-active";

/// Most patches of a file, and most bytes of its first line.
const PATCHES_MAX: usize = 64;
const HEAD_BYTES_MAX: u64 = 64 << 10;

#[derive(Serialize, Deserialize)]
#[serde(expecting = "an object with format, activation and sets")]
struct Head {
    format: Text<64>,
    /// The newest activation of all.
    activation: u64,
    sets: List<Entry, PATCHES_MAX>,
}

#[derive(Serialize, Deserialize)]
#[serde(expecting = "an object with model_set, bytes and checksum")]
struct Entry {
    model_set: Text<256>,
    bytes: usize,
    /// First bytes of the SHA-256 of the text and of `activation`.
    checksum: Text<64>,
}

/// The id of a set and its MODELS.json.
pub(crate) type IdAndText = (String, Vec<u8>);

/// What such a file says.
#[derive(Debug)]
pub(crate) struct ActiveFile {
    /// The newest activation when it was written.
    pub(crate) activation: u64,
    /// The active set of each patch, its text proven.
    pub(crate) sets: Vec<(String, String)>,
}

fn checksum(activation: u64, id: &str, text: &[u8]) -> String {
    let sum = rows::active_checksum(activation, id, text);
    sum.iter().fold(String::new(), |hex, byte| format!("{hex}{byte:02x}"))
}

/// The whole file: the sets by id, each with its MODELS.json.
pub(crate) fn content(activation: u64, sets: &[IdAndText]) -> Result<Vec<u8>, serde_json::Error> {
    let entry = |(id, text): &IdAndText| Entry {
        model_set: Text(id.clone()),
        bytes: text.len(),
        checksum: Text(checksum(activation, id, text)),
    };
    let sets = sets.iter().take(PATCHES_MAX);
    let head = Head { format: Text(FORMAT.to_owned()), activation, sets: List(sets.clone().map(entry).collect()) };
    let mut content = serde_json::to_vec(&head)?;
    content.push(b'\n');
    sets.for_each(|(_, text)| content.extend(text));
    Ok(content)
}

/// Writes the file unless it is this already.
pub(crate) fn keep(database: &Path, content: &[u8]) -> io::Result<()> {
    let path = beside::active(database);
    let there = fs::metadata(&path).is_ok_and(|file| file.len() == content.len() as u64);
    if there && fs::read(&path).is_ok_and(|found| found == content) {
        return Ok(());
    }
    beside::replace(database, &path, content)
}

/// Reads the file: nothing if there is none, or why it is not believed.
pub(crate) fn read(database: &Path) -> Option<Result<ActiveFile, String>> {
    let path = beside::active(database);
    // Opening a pipe would wait for somebody who writes into it.
    if beside::is_no_file(&path) {
        return Some(Err("it is no regular file".to_owned()));
    }
    match File::open(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => Some(Err(format!("it cannot be opened: {error}"))),
        Ok(file) => Some(read_from(file)),
    }
}

/// Reads one set after the other, so that no more is in memory than is believed and what comes next.
fn read_from(file: File) -> Result<ActiveFile, String> {
    let length = file.metadata().map_err(|error| error.to_string())?.len();
    let mut rest = BufReader::new(file);
    let mut line = Vec::new();
    rest.by_ref().take(HEAD_BYTES_MAX).read_until(b'\n', &mut line).map_err(|error| error.to_string())?;
    if line.last() != Some(&b'\n') {
        return Err("it has no first line".to_owned());
    }
    let head: Head = serde_json::from_slice(&line).map_err(|error| error.to_string())?;
    if head.format.0 != FORMAT {
        return Err(format!("its format is `{}`, expected `{FORMAT}`", head.format.0));
    }
    let told = head.sets.0.iter().try_fold(line.len(), |sum, entry| sum.checked_add(entry.bytes));
    if told.map(|told| told as u64) != Some(length) {
        let told = told.map_or("more than there can be".to_owned(), |told| told.to_string());
        return Err(format!("it has {length} bytes, and by its first line {told}"));
    }
    let mut sets = Vec::new();
    for Entry { model_set: Text(id), bytes, checksum: Text(sum) } in head.sets.0 {
        if bytes > TEXT_BYTES_MAX {
            return Err(format!("model set {id} in it has {bytes} bytes, expected at most {TEXT_BYTES_MAX}"));
        }
        let mut text = vec![0; bytes];
        rest.read_exact(&mut text).map_err(|error| error.to_string())?;
        if sum != checksum(head.activation, &id, &text) {
            return Err(format!("model set {id} in it is not what was written"));
        }
        sets.push((id, String::from_utf8(text).map_err(|error| error.to_string())?));
    }
    Ok(ActiveFile { activation: head.activation, sets })
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn a_pipe_in_its_place_is_told_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("t.db");
        let made = std::process::Command::new("mkfifo").arg(beside::active(&database)).status().unwrap();
        assert!(made.success());
        assert_eq!(read(&database).unwrap().err().as_deref(), Some("it is no regular file"));
    }

    fn sets() -> Vec<IdAndText> {
        vec![("m-1".to_owned(), b"{\"first\": 1}".to_vec()), ("m-2".to_owned(), b"{\"second\": 2}".to_vec())]
    }

    fn database() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.db");
        (folder, path)
    }

    fn why(database: &Path, content: &[u8]) -> String {
        keep(database, content).unwrap();
        read(database).unwrap().unwrap_err()
    }

    #[test]
    fn what_was_written_is_read_and_what_was_changed_is_not_believed() {
        let (_folder, database) = database();
        assert!(read(&database).is_none(), "there is none");
        let whole = content(7, &sets()).unwrap();
        keep(&database, &whole).unwrap();
        let found = read(&database).unwrap().unwrap();
        let texts = ["{\"first\": 1}", "{\"second\": 2}"];
        assert_eq!(found.activation, 7);
        assert_eq!(found.sets, [("m-1".to_owned(), texts[0].to_owned()), ("m-2".to_owned(), texts[1].to_owned())]);
        let changed = |from: &str, to: &str| {
            let text = String::from_utf8(whole.clone()).unwrap();
            assert!(text.contains(from));
            text.replacen(from, to, 1).into_bytes()
        };
        assert!(why(&database, &changed("{\"second\": 2}", "{\"second\": 3}")).contains("model set m-2 in it is not"));
        assert!(
            why(&database, &changed("\"activation\":7", "\"activation\":8")).contains("model set m-1 in it is not")
        );
        let length = whole.len();
        for (content, is) in [(whole[..length - 1].to_vec(), length - 1), ([&whole[..], b"\0"].concat(), length + 1)] {
            let said = format!("it has {is} bytes, and by its first line {length}");
            assert_eq!(why(&database, &content), said);
        }
        assert!(why(&database, b"4\n").contains("expected an object with format, activation and sets"));
        assert!(why(&database, &changed(FORMAT, "taxeld-passive")).contains("`taxeld-passive`"));
        assert!(why(&database, b"no line").contains("no first line"));
    }

    #[test]
    fn a_file_that_is_the_same_already_is_left_and_another_one_of_its_length_is_not() {
        let (_folder, database) = database();
        let inode = || fs::metadata(beside::active(&database)).unwrap().ino();
        let (seven, eight) = (content(7, &sets()).unwrap(), content(8, &sets()).unwrap());
        assert_eq!(seven.len(), eight.len());
        keep(&database, &seven).unwrap();
        let first = inode();
        keep(&database, &seven).unwrap();
        assert_eq!(inode(), first);
        keep(&database, &eight).unwrap();
        assert_eq!(read(&database).unwrap().unwrap().activation, 8);
    }

    #[test]
    fn what_cannot_be_opened_or_is_far_too_long_is_told() {
        let (folder, database) = database();
        let file = folder.path().join("file");
        fs::write(&file, b"").unwrap();
        assert!(read(&file.join("t.db")).unwrap().unwrap_err().contains("ot a directory"));
        let long = File::create(beside::active(&database)).unwrap();
        long.set_len(1 << 40).unwrap();
        assert_eq!(read(&database).unwrap().unwrap_err(), "it has no first line");
        // What its first line says may be anything.
        let head = |bytes: &str| {
            let sets = format!("[{{\"model_set\": \"m-1\", \"bytes\": {bytes}, \"checksum\": \"00\"}}]");
            format!("{{\"format\": \"{FORMAT}\", \"activation\": 1, \"sets\": {sets}}}\n")
        };
        let huge = head("1099511627776");
        fs::write(beside::active(&database), &huge).unwrap();
        long.set_len(huge.len() as u64 + (1 << 40)).unwrap();
        let said = read(&database).unwrap().unwrap_err();
        assert!(said.starts_with("model set m-1 in it has 1099511627776 bytes, expected at most "), "{said}");
        fs::write(beside::active(&database), head(&u64::MAX.to_string())).unwrap();
        let said = read(&database).unwrap().unwrap_err();
        assert!(said.contains("by its first line more than there can be"), "{said}");
    }
}
