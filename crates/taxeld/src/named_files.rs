//! The files that a configuration names: no output of a command may overwrite one.

use std::path::{Path, PathBuf};

use crate::config::{Config, Doors, beside};
use crate::open_log;

/// The configuration at `path` with all that it names: the files of its store, what it is read with, certificates, tokens and
/// sockets, and what a daemon has written into its folders.
pub fn named_files(config: &Config, doors: &Doors, path: &Path) -> Vec<PathBuf> {
    let mut files = vec![path.to_owned()];
    files.extend(taxel_store::files_of(&config.store.path));
    // Position files and DBC files.
    let of_arrays = config.patch.iter().filter_map(|patch| Some(&patch.array.as_ref()?.dbc));
    let read = config.patch.iter().filter_map(|patch| patch.geometry.as_ref()).chain(of_arrays);
    files.extend(read.map(|file| beside(path, file)));
    files.extend(doors.files());
    if let Some(record) = &config.record {
        files.extend(open_log::files_of(&record.path));
    }
    if let Some(memory) = &config.shared_memory {
        let there = std::fs::read_dir(&memory.path).into_iter().flatten().flatten().map(|entry| entry.path());
        files.extend(there.chain(config.patch.iter().map(|patch| memory.path.join(&patch.name))));
    }
    files
}

#[cfg(all(test, feature = "tls", feature = "record"))]
mod tests {
    use super::*;

    const CONFIG: &str = r#"
listen = ["unix:socket", "tls:127.0.0.1:50052"]
tls = { cert = "server.pem", key = "server.key", client_ca = "ca.pem" }
[store]
path = "FOLDER/s.db"
[access]
tokens = "tokens"
[shared_memory]
path = "FOLDER/pages"
[record]
path = "FOLDER/recordings"
[[bus]]
name = "skin"
interface = "can0"
[[patch]]
name = "palm"
bus = "skin"
geometry = "palm.txt"
boards = [{ address = 1, modules = "0" }]
[[patch]]
name = "sole"
bus = "skin"
array = { dbc = "skin.dbc", taxels = ["A.*"] }
"#;

    #[test]
    fn all_files_of_a_configuration_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let recording = "recordings/taxeld-00000001-20261122T071402Z.mcap";
        std::fs::create_dir(at("recordings")).unwrap();
        for name in [recording, "recordings/force.csv"] {
            std::fs::write(at(name), "").unwrap();
        }
        let (path, text) = (at("t.toml"), CONFIG.replace("FOLDER", folder.path().to_str().unwrap()));
        let config = crate::config::parse(&path, &text).unwrap();
        let doors = crate::config::doors(&config, &path, &mut crate::config::Faults::default());
        let named = named_files(&config, &doors, &path);
        for name in [
            "t.toml",
            "s.db",
            "s.db-wal",
            "socket",
            "server.pem",
            "server.key",
            "ca.pem",
            "tokens",
            "pages/palm",
            "pages/sole",
            "palm.txt",
            "skin.dbc",
            recording,
        ] {
            assert!(named.contains(&at(name)), "{name} is not in {named:?}");
        }
        assert!(!named.contains(&at("recordings/force.csv")), "it is nobody's");
    }
}
