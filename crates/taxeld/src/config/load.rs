//! Reading the file, and errors that a person can act on: place, value, and the nearest known key.

use std::path::{Path, PathBuf};
use thiserror::Error;

use super::fault::Fault;
use super::file::Config;

/// So much of an unknown key is repeated, in characters.
const KEY_CHARS_MAX: usize = 60;

/// A configuration that cannot be used.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file is not what it should be.
    #[error("{path}:{line}: {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// The values do not fit together.
    #[error("{path}: {problem}")]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong and what was expected.
        problem: String,
    },
}

/// The path of a file that a configuration names relative to itself.
pub fn beside(config: &Path, file: &Path) -> PathBuf {
    config.parent().unwrap_or(Path::new("")).join(file)
}

/// Reads the text of a configuration file; `path` is for messages.
///
/// # Errors
/// [`ConfigError`] with file, line and what was expected.
pub fn parse(path: &Path, text: &str) -> Result<Config, ConfigError> {
    let line_of = |at: usize| 1 + text.as_bytes()[..at.min(text.len())].iter().filter(|&&b| b == b'\n').count();
    let invalid = |at: usize, problem: String| ConfigError::Invalid { path: path.into(), line: line_of(at), problem };
    let config: Config = toml::from_str(text)
        .map_err(|error| invalid(error.span().map_or(0, |span| span.start), explain(error.message())))?;
    let config = with_lines(config, text);
    match config.patch.iter().find_map(super::area::problem) {
        Some((at, problem)) => Err(invalid(at, problem)),
        None => Ok(config),
    }
}

/// The configuration with the lines of its boards, for messages about them.
fn with_lines(mut config: Config, text: &str) -> Config {
    let line_of = |at: usize| 1 + text.as_bytes()[..at.min(text.len())].iter().filter(|&&b| b == b'\n').count();
    for board in config.patch.iter_mut().flat_map(|patch| &mut patch.board) {
        board.line = line_of(board.modules.span().start);
    }
    config
}

/// What is left to do with a configuration that was read from `text`.
///
/// # Errors
/// The area of a patch that needs what is not there.
pub fn finish(config: Config, text: &str) -> Result<Config, Fault> {
    let config = with_lines(config, text);
    let problem = |(n, patch)| Some(Fault::of(format!("patch[{n}].area"), super::area::problem(patch)?.1));
    match config.patch.iter().enumerate().find_map(problem) {
        Some(fault) => Err(fault),
        None => Ok(config),
    }
}

/// The parser's message, with the nearest known key where a key is unknown.
fn explain(message: &str) -> String {
    if message.starts_with("unknown field") { nearest_key(message).1 } else { message.to_owned() }
}

/// The nearest known key and the whole in words, of "unknown field `x`, expected one of `a`, `b`".
pub fn nearest_key(message: &str) -> (String, String) {
    let words: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let Some((unknown, known)) = words.split_first() else { return (String::new(), message.to_owned()) };
    let unknown: String = unknown.chars().take(KEY_CHARS_MAX).collect();
    let closeness = known.iter().map(|word| (strsim::jaro_winkler(&unknown, word), *word));
    let nearest = closeness.max_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, word)| word);
    let known = known.join(", ");
    match nearest {
        Some(nearest) => {
            let words = format!("unknown key `{unknown}`; did you mean `{nearest}`? Known here: {known}");
            (nearest.to_owned(), words)
        }
        None => (String::new(), format!("unknown key `{unknown}`; nothing is known here")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EXAMPLE: &str = include_str!("../../../../deploy/taxeld.toml");

    fn error(text: &str) -> String {
        parse(Path::new("t.toml"), text).unwrap_err().to_string()
    }

    #[test]
    fn the_example_is_complete_and_resolves() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/taxeld.toml");
        let config = parse(Path::new(path), EXAMPLE).unwrap();
        let scene = super::super::resolve(&config, Path::new(path)).unwrap();
        assert_eq!(scene.plan.patches[0].patch.taxels().len(), 230);
    }

    /// iCub's own files say where each module of the forearm is.
    #[test]
    fn the_example_has_the_modules_of_the_real_forearm() {
        let data = std::env::var("TAXELD_DATA").map_or_else(
            |_| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
            |folder| Path::new(&folder).to_owned(),
        );
        for (file, modules) in
            [("left_forearm_mesh", "1, 5, 8-10, 12-13"), ("left_forearm_V2", "0-1, 3, 6, 8-9, 12-13")]
        {
            assert!(EXAMPLE.contains(&format!("\"{modules}\"")), "{modules}");
            let path = data.join("icub_positions").join(file).with_extension("txt");
            let Ok(text) = std::fs::read_to_string(&path) else {
                eprintln!("SKIPPED the_example_has_the_modules_of_the_real_forearm: no {}", path.display());
                return;
            };
            let posed = taxel_skin::PositionFile::parse(&text).unwrap().modules();
            let listed = super::super::modules::modules(modules, Default::default()).unwrap();
            let listed: Vec<usize> = (0..16).chain(listed.iter().map(|(m, _)| 16 + usize::from(m.get()))).collect();
            assert_eq!(posed, listed, "{file}");
        }
    }

    #[test]
    fn an_unknown_key_is_refused_with_line_and_nearest_key() {
        let text = EXAMPLE.replace("period_ms = 50", "periode_ms = 50");
        let line = 1 + text.lines().position(|l| l.starts_with("periode_ms")).unwrap();
        let message = error(&text);
        assert!(message.starts_with(&format!("t.toml:{line}: unknown key `periode_ms`")), "{message}");
        assert!(message.contains("did you mean `period_ms`?"), "{message}");
    }

    #[test]
    fn a_wrong_type_names_the_line() {
        let text = EXAMPLE.replace("area_mm2 = 42.1", "area_mm2 = \"much\"");
        let line = 1 + text.lines().position(|l| l.contains("\"much\"")).unwrap();
        assert!(error(&text).starts_with(&format!("t.toml:{line}: ")));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(?s).{0,300}") {
            let _ = parse(Path::new("t.toml"), &text);
        }

        #[test]
        fn no_damage_to_the_example_panics(at in 0..EXAMPLE.len(), byte in 0_u8..128) {
            let mut bytes = EXAMPLE.as_bytes().to_vec();
            bytes[at] = byte;
            if let Ok(text) = String::from_utf8(bytes)
                && let Ok(config) = parse(Path::new("t.toml"), &text)
            {
                let _ = super::super::resolve(&config, Path::new("t.toml"));
            }
        }
    }
}
