//! The examination: read what can be read, note what is wrong, take it away and look again, until nothing new is found.

use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

use super::expected::expected;
use super::feasible::impossible;
use super::problem::{Code, Problem, Problems};
use super::tree::{KeyPath, Step, find, in_words, original_path, path_of, remove, text_of};
use crate::config::fault::Fault;
use crate::config::file::Config;
use crate::config::load::{finish, nearest_key};
use crate::config::resolve::{Scene, clashes, scene_of};

/// After so many problems no more are looked for.
const PROBLEMS_MAX: usize = 100;

/// So much of what the parser says is repeated, in characters.
const WORDS_CHARS_MAX: usize = 200;

/// A store, for looking further where the file's own cannot be used.
const ANY_STORE: &str = "[store]\npath = \"taxeld.db\"\n";

/// Reads and resolves a configuration.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine(path: &Path) -> Result<(Config, Scene), Problems> {
    examine_text(path, &read_text(path)?)
}

/// Reads the text of a configuration, for whoever needs it later as it was then.
///
/// # Errors
/// If it cannot be read.
pub fn read_text(path: &Path) -> Result<String, Problems> {
    crate::files::read_text(path).map_err(|error| {
        Problems::new(vec![Problem {
            code: Code::Unreadable,
            file: path.display().to_string(),
            line: 0,
            key: String::new(),
            value: None,
            expected: "a text in UTF-8 that can be read".to_owned(),
            message: error.root_cause().to_string(),
        }])
    })
}

/// The same of a text; `path` is for messages and for files beside it.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine_text(path: &Path, text: &str) -> Result<(Config, Scene), Problems> {
    examine_with(path, text, |_, _| Vec::new())
}

/// The same, where `more` tells what else keeps such a configuration from being used.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine_with(
    path: &Path,
    text: &str,
    more: impl FnOnce(&Config, &Scene) -> Vec<Fault>,
) -> Result<(Config, Scene), Problems> {
    let (tree, errors) = DeTable::parse_recoverable(text);
    let span = tree.span();
    let original = tree.into_inner();
    let mut examination = Examination { path, text, original: &original, removed: Vec::new(), problems: Vec::new() };
    if !errors.is_empty() {
        errors.iter().take(PROBLEMS_MAX).for_each(|error| examination.note_syntax(error));
        return Err(Problems::new(examination.problems));
    }
    let mut tree = original.clone();
    let found = loop {
        let attempt = read(Spanned::new(span.clone(), tree.clone()), text)
            .and_then(|config| Ok((scene_of(&config, path).map_err(Attempt::of_values)?, config)));
        match attempt {
            Ok((scene, config)) => break Some((config, scene)),
            Err(attempt) => {
                if !examination.note_and_remove(attempt, &mut tree) || examination.problems.len() >= PROBLEMS_MAX {
                    break None;
                }
            }
        }
    };
    if let Some((config, scene)) = &found {
        let clashes = clashes(config, &scene.plan).into_iter().map(|fault| (Code::Conflict, fault));
        let impossible =
            impossible(config, scene).into_iter().chain(more(config, scene)).map(|fault| (Code::CannotWork, fault));
        let room = PROBLEMS_MAX - examination.problems.len();
        clashes.chain(impossible).take(room).for_each(|(code, fault)| examination.note_fault(code, &fault, &tree));
    }
    match found {
        Some(found) if examination.problems.is_empty() => Ok(found),
        _ => Err(Problems::new(examination.problems)),
    }
}

/// Why an attempt to read the file as it is now failed.
struct Attempt {
    code: Code,
    key: KeyPath,
    /// Where in the text, if the key does not say it.
    at: Option<usize>,
    expected: Option<String>,
    words: String,
}

impl Attempt {
    fn of_values(fault: Fault) -> Self {
        let expected = Some(fault.expected()).filter(|expected| !expected.is_empty()).map(str::to_owned);
        let (key, words) = (path_of(fault.key()), fault.words().to_owned());
        Self { code: Code::Value, key, at: None, expected, words }
    }
}

fn read(tree: Spanned<DeTable<'_>>, text: &str) -> Result<Config, Attempt> {
    let shape = |error: serde_path_to_error::Error<toml::de::Error>| {
        let mut key: KeyPath = error.path().iter().filter_map(step).collect();
        let error = error.into_inner();
        let message = error.message();
        let name = message.split('`').nth(1).unwrap_or_default().to_owned();
        let code = match message {
            _ if message.starts_with("unknown field") => Code::UnknownKey,
            _ if message.starts_with("missing field") => Code::MissingKey,
            _ => Code::Value,
        };
        let last = Step::Key(name);
        if code != Code::Value && key.last() != Some(&last) {
            key.push(last);
        }
        Attempt { code, key, at: error.span().map(|span| span.start), expected: None, words: message.to_owned() }
    };
    let config: Config = serde_path_to_error::deserialize(Deserializer::from(tree)).map_err(shape)?;
    finish(config, text).map_err(Attempt::of_values)
}

fn step(segment: &serde_path_to_error::Segment) -> Option<Step> {
    match segment {
        // `Spanned` looks like a table with keys of its own.
        serde_path_to_error::Segment::Map { key } => (!key.starts_with("$__")).then(|| Step::Key(key.clone())),
        serde_path_to_error::Segment::Seq { index } => Some(Step::Element(*index)),
        _ => None,
    }
}

struct Examination<'a> {
    path: &'a Path,
    text: &'a str,
    original: &'a DeTable<'a>,
    /// Original paths of what was taken away: that it lacks then is no problem of the file.
    removed: Vec<KeyPath>,
    problems: Vec<Problem>,
}

impl Examination<'_> {
    fn note_syntax(&mut self, error: &toml::de::Error) {
        let line = error.span().map_or(1, |span| self.line_of(span.start));
        self.problems.push(Problem {
            code: Code::Syntax,
            file: self.path.display().to_string(),
            line,
            key: String::new(),
            value: None,
            expected: "TOML".to_owned(),
            message: on_a_line(error.message()),
        });
    }

    /// Notes why an attempt failed, and takes what is wrong out of the tree. False if nothing can be taken out.
    fn note_and_remove(&mut self, attempt: Attempt, tree: &mut DeTable<'_>) -> bool {
        let key = original_path(tree, self.original, &attempt.key);
        let is_own_doing = self.removed.iter().any(|removed| {
            let emptied = attempt.key.is_empty() && removed.len() == 2; // the last [[bus]] or [[patch]] went
            let lacks_it = attempt.code == Code::MissingKey && *removed == key;
            let lacks_of_it = attempt.code == Code::Value && removed.len() > key.len() && removed.starts_with(&key);
            emptied || lacks_it || (lacks_of_it && !key.is_empty())
        });
        if !is_own_doing {
            let problem = self.problem(attempt.code, &attempt, key.clone(), tree);
            self.problems.push(problem);
        }
        let gone = if attempt.code == Code::MissingKey { &attempt.key[..attempt.key.len() - 1] } else { &attempt.key };
        if gone.is_empty() {
            return attempt.code == Code::MissingKey && attempt.key == path_of("store") && put_any_store(tree);
        }
        self.removed.push(original_path(tree, self.original, gone));
        remove(tree, gone)
    }

    fn note_fault(&mut self, code: Code, fault: &Fault, tree: &DeTable<'_>) {
        let attempt = Attempt { code, ..Attempt::of_values(fault.clone()) };
        let key = original_path(tree, self.original, &attempt.key);
        let problem = self.problem(code, &attempt, key, tree);
        self.problems.push(problem);
    }

    fn problem(&self, code: Code, attempt: &Attempt, key: KeyPath, tree: &DeTable<'_>) -> Problem {
        // A key that lacks is looked for in the section that lacks it.
        let nearest = (0..=key.len()).rev().find_map(|n| find(self.original, &key[..n]));
        let at = nearest.map(|(begin, _)| begin).or(attempt.at);
        let value = find(tree, &attempt.key).map(|(_, value)| value.get_ref());
        let (expected, message) = words(code, attempt, &key, value);
        Problem {
            code,
            file: self.path.display().to_string(),
            line: at.map_or(0, |at| self.line_of(at)),
            value: value.filter(|_| code != Code::UnknownKey).map(in_words),
            key: text_of(&key),
            expected,
            message,
        }
    }

    fn line_of(&self, at: usize) -> usize {
        1 + self.text.as_bytes()[..at.min(self.text.len())].iter().filter(|&&byte| byte == b'\n').count()
    }
}

/// What was expected, and the whole in words.
fn words(code: Code, attempt: &Attempt, key: &[Step], value: Option<&DeValue<'_>>) -> (String, String) {
    let keys = key.iter().filter(|step| matches!(step, Step::Key(_))).cloned().collect::<KeyPath>();
    let name = text_of(key);
    let known = expected(&text_of(&keys));
    match code {
        Code::UnknownKey => nearest_key(&attempt.words),
        Code::MissingKey => {
            let expected = known.unwrap_or("a value").to_owned();
            let message = format!("{name}: it is missing, expected {expected}");
            (expected, message)
        }
        // Of what the parser says only the place is kept where there are better words.
        Code::Value if attempt.at.is_some() => {
            let expected = known.map_or_else(|| on_a_line(&attempt.words), str::to_owned);
            let got = value.map_or_else(String::new, |value| format!(", got {}", in_words(value)));
            let message = format!("{name}: expected {expected}{got}");
            (expected, if known.is_some() { message } else { format!("{name}: {}", on_a_line(&attempt.words)) })
        }
        _ => (attempt.expected.clone().or(known.map(str::to_owned)).unwrap_or_default(), attempt.words.clone()),
    }
}

/// The words of the parser on one line.
fn on_a_line(words: &str) -> String {
    let line = words.split_whitespace().collect::<Vec<_>>().join(" ");
    let more = if line.chars().count() > WORDS_CHARS_MAX { "..." } else { "" };
    line.chars().take(WORDS_CHARS_MAX).collect::<String>() + more
}

fn put_any_store(tree: &mut DeTable<'_>) -> bool {
    let Ok(any) = DeTable::parse(ANY_STORE) else { return false };
    any.into_inner().into_iter().for_each(|(key, value)| drop(tree.insert(key, value)));
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EXAMPLE: &str = include_str!("../../../../../deploy/taxeld.toml");

    fn problems(text: &str) -> Vec<Problem> {
        examine_text(Path::new("t.toml"), text).err().map(|problems| problems.all().to_vec()).unwrap_or_default()
    }

    fn lines(text: &str) -> Vec<String> {
        problems(text).iter().map(ToString::to_string).collect()
    }

    /// The line of the example as the tests change it that holds these words.
    fn line(text: &str, words: &str) -> usize {
        1 + text.lines().position(|line| line.contains(words)).unwrap()
    }

    #[test]
    fn the_example_has_no_problem() {
        assert_eq!(lines(EXAMPLE), Vec::<String>::new());
    }

    /// The escape would colour the rest of the terminal, and the line feed begin a line of its own.
    #[test]
    fn a_problem_is_one_line_whatever_the_names_in_it() {
        let name = "leg\\u001b[31m\\nt.toml:1: all is well\\u202e";
        let text = EXAMPLE.replace("bus = \"skin\"", &format!("bus = \"{name}\""));
        let found = problems(&text);
        assert_eq!(found.len(), 1, "{found:#?}");
        let said = found[0].to_string();
        let expected = "bus `leg\\u{1b}[31m\\nt.toml:1: all is well\\u{202e}` is not among the buses";
        assert!(said.contains(expected), "{said}");
        let path = Path::new("t.toml");
        let used = crate::config::parse(path, &text).and_then(|config| crate::config::resolve(&config, path));
        let error = used.unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }

    #[test]
    fn every_error_is_found_in_one_run_with_line_key_value_and_what_was_expected() {
        let text = EXAMPLE
            .replace("period_ms = 50", "period_ms = \"50\"")
            .replace("subscribers_max = 128", "subscribrs_max = 128")
            .replace("budget_mb = 4096", "budget_mb = -1")
            .replace("area_mm2 = 42.1", "area_mm2 = 0.0")
            .replace("unit = \"Pa\"", "unit = \"ell\"")
            .replace("interface = \"can0\"", "interface = \"a/very long name\"");
        let found = problems(&text);
        let about = |key: &str| {
            let found = found.iter().find(|problem| problem.key.ends_with(key));
            found.unwrap_or_else(|| panic!("{key}: {found:#?}")).clone()
        };
        assert_eq!(found.len(), 6, "{found:#?}");
        let period = about("patch[0].period_ms");
        assert_eq!(
            period.to_string(),
            format!(
                "t.toml:{}: patch[0].period_ms: expected a whole number of milliseconds from 1 to 209, for an array without boards to 5000, got the text \"50\"",
                line(&text, "period_ms = \"50\"")
            )
        );
        assert_eq!((period.code, period.value.as_deref()), (Code::Value, Some("the text \"50\"")));
        let unknown = about("subscribrs_max");
        assert_eq!((unknown.code, unknown.expected.as_str()), (Code::UnknownKey, "subscribers_max"));
        assert!(unknown.message.contains("did you mean `subscribers_max`?"), "{unknown}");
        assert_eq!(
            (about("budget_mb").value.as_deref(), about("unit").line),
            (Some("the number -1"), line(&text, "\"ell\""))
        );
        assert_eq!((about("area_mm2").code, about("area_mm2").expected.as_str()), (Code::Value, "0.01 to 100000"));
        assert_eq!((about("interface").code, about("interface").line), (Code::CannotWork, line(&text, "a/very long")));
    }

    const SMALL: &str = "[store]\npath = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n[[patch]]\nname = \"p\"\n\
                         bus = \"b\"\n[[patch.board]]\naddress = 13\nmodules = \"0-3\"\n";

    #[test]
    fn what_lacks_is_told_once_and_the_rest_is_looked_at() {
        let text = SMALL.replace("path = \"t.db\"", "path = 7").replace("address = 13", "address = 99")
            + "[patch.gauge]\nlength_bits = 32\nunit = \"Pa\"\n[patch.tare]\nseconds = 0\n";
        let found = lines(&text);
        let expected = [
            "t.toml:2: store.path: expected the path of a file",
            "t.toml:9: patch `p`: ",
            "t.toml:12: patch[0].gauge.id: it is missing, expected a whole number, as in 0x3A1",
            "t.toml:16: patch `p`: tare.seconds = 0: expected 0.1 to 60",
        ];
        assert_eq!(found.len(), expected.len(), "{found:#?}");
        expected
            .iter()
            .zip(&found)
            .for_each(|(begin, line)| assert!(line.starts_with(begin), "{line}, expected {begin}"));
    }

    #[test]
    fn a_second_patch_keeps_its_number_and_contradictions_have_a_place() {
        let gauge = "[patch.gauge]\nid = 0x4D1\nlength_bits = 32\nunit = \"Pa\"\n";
        let second =
            "[[patch]]\nname = \"q\"\nbus = \"b\"\nperiod_ms = 500\n[[patch.board]]\naddress = 12\nmodules = \"0\"\n";
        let found = problems(&format!("{SMALL}{gauge}{second}"));
        let keys: Vec<(&str, Code)> = found.iter().map(|problem| (problem.key.as_str(), problem.code)).collect();
        assert_eq!(keys, [("patch[0].gauge.id", Code::Conflict), ("patch[1].period_ms", Code::Value)], "{found:#?}");
        let wrong_bus = SMALL.replace("bus = \"b\"", "bus = \"c\"");
        let found = problems(&format!("{wrong_bus}{second}"));
        let keys: Vec<&str> = found.iter().map(|problem| problem.key.as_str()).collect();
        assert_eq!(keys, ["patch[0].bus", "patch[1].period_ms"], "{found:#?}");
    }

    #[test]
    fn limits_that_exclude_each_other_and_impossible_names_are_found() {
        let text = SMALL.replace("can0", "an-interface-of-19")
            + "[patch.session]\ntarget_kpa = 5\nfall_end_kpa = 5\nnoise_band_kpa = 9\n";
        let keys: Vec<String> = problems(&text).into_iter().map(|problem| problem.key).collect();
        let target = "patch[0].session.target_kpa"; // vented_below_kpa is the default, above it
        assert_eq!(
            keys,
            ["bus[0].interface", target, "patch[0].session.fall_end_kpa", "patch[0].session.noise_band_kpa"]
        );
        let text = SMALL.replace("path = \"t.db\"", "path = \"/dev/null/t.db\"\nbudget_mb = 5\nkeep_mb = 6");
        let found = problems(&text);
        let codes: Vec<Code> = found.iter().map(|problem| problem.code).collect();
        assert_eq!(codes, [Code::CannotWork; 2], "{found:#?}");
        let found = problems(&SMALL.replace("path = \"t.db\"", "path = \"t.db\"\nbudget_mb = 0"));
        assert_eq!(found.iter().map(|problem| problem.key.as_str()).collect::<Vec<_>>(), ["store.budget_mb"]);
    }

    #[test]
    fn a_target_that_no_bag_reaches_needs_the_key_of_a_chamber() {
        let of = |session: &str| problems(&format!("{SMALL}[patch.session]\n{session}"));
        let found = of("target_kpa = 150\n");
        assert_eq!(
            found.iter().map(|problem| problem.key.as_str()).collect::<Vec<_>>(),
            ["patch[0].session.target_kpa"]
        );
        assert!(found[0].message.contains("pressurised_chamber = true"), "{found:#?}");
        assert!(of("target_kpa = 95\n").is_empty() && of("target_kpa = 150\npressurised_chamber = true\n").is_empty());
        assert!(!of("target_kpa = 1001\npressurised_chamber = true\n").is_empty());
    }

    #[test]
    fn a_bus_that_cannot_carry_its_scans_is_refused() {
        let full = SMALL.replace("modules = \"0-3\"", "modules = \"0-15\"");
        let of =
            |period_ms: u32| problems(&full.replace("name = \"p\"", &format!("name = \"p\"\nperiod_ms = {period_ms}")));
        let found = of(1);
        assert_eq!(found.iter().map(|problem| problem.key.as_str()).collect::<Vec<_>>(), ["patch[0].period_ms"]);
        assert!(found[0].message.contains("355 % of 1 Mbit/s"), "{found:#?}");
        assert!(of(5).is_empty());
    }

    #[test]
    fn several_faults_of_syntax_are_told_at_once() {
        let found = lines("[store\npath = 1\n[[bus]]\nname = = 2\n");
        assert!(found.len() >= 2 && found[0].starts_with("t.toml:1: "), "{found:#?}");
    }

    #[test]
    fn faults_of_syntax_are_told_up_to_the_limit() {
        assert_eq!(lines(&"= 1\n".repeat(2 * PROBLEMS_MAX)).len(), PROBLEMS_MAX);
    }

    /// Two things cannot work on any machine, for the last of which there is no room.
    #[test]
    fn what_cannot_work_is_told_up_to_the_limit() {
        let unknown: String = (1..PROBLEMS_MAX).map(|i| format!("unknown{i} = {i}\n")).collect();
        let text = SMALL
            .replace("path = \"t.db\"", &format!("path = \"/dev/null/t.db\"\nbudget_mb = 5\nkeep_mb = 6\n{unknown}"));
        let found = problems(&text);
        let cannot_work = found.iter().filter(|problem| problem.code == Code::CannotWork);
        assert_eq!((found.len(), cannot_work.count()), (PROBLEMS_MAX, 1), "{found:#?}");
    }

    proptest! {
        /// Whatever is in the file: an end, and no panic.
        #[test]
        fn no_damage_to_the_example_panics(at in 0..EXAMPLE.len(), byte in 0_u8..128, cut in 0_usize..40) {
            let mut bytes = EXAMPLE.as_bytes().to_vec();
            bytes.drain(at..(at + cut).min(bytes.len()));
            if let Some(place) = bytes.get_mut(at) {
                *place = byte;
            }
            if let Ok(text) = String::from_utf8(bytes) {
                let found = problems(&text);
                prop_assert!(found.len() <= PROBLEMS_MAX && found.iter().all(|problem| !problem.message.is_empty()));
            }
        }
    }
}
