//! What the JSON reader says, in words for people who do not write Rust.

/// So many characters of a text that is not understood are shown.
const SHOWN_CHARS_MAX: usize = 200;

/// What the reader calls its types, and what these are in a file.
const WORDS: [(&str, &str); 16] = [
    ("expected u8", "expected a whole number from 0 to 255"),
    ("expected u16", "expected a whole number from 0 to 65535"),
    ("expected u32", "expected a whole number from 0 to 4294967295"),
    ("expected u64", "expected a whole number of 0 or more"),
    ("expected usize", "expected a whole number of 0 or more"),
    ("expected i64", "expected a whole number"),
    ("expected f64", "expected a number"),
    ("expected a boolean", "expected true or false"),
    ("expected a sequence", "expected a list"),
    ("expected a map", "expected an object"),
    ("expected struct ", "expected an object of "),
    ("expected an array of length ", "expected a list of length "),
    ("invalid type: map", "invalid type: an object"),
    ("invalid type: sequence", "invalid type: a list"),
    ("unknown variant", "unknown word"),
    // The text is JSON by then: what follows does not belong to the list that was read.
    ("trailing characters", "more entries than the list has"),
];

/// The reader's error about a text that is JSON.
pub(super) fn plain(error: &serde_json::Error) -> String {
    let mut words = shown(&error.to_string());
    for (theirs, ours) in WORDS {
        let Some(at) = words.rfind(theirs) else { continue };
        let (before, after) = (&words[..at], &words[at + theirs.len()..]);
        // What the file says is quoted, and stays as it is; and of a longer name nothing is changed.
        let is_quoted = before.matches(['`', '"']).count() % 2 == 1;
        let goes_on = after.starts_with(char::is_alphanumeric) && !theirs.ends_with(' ');
        if !is_quoted && !goes_on {
            words = format!("{before}{ours}{after}");
        }
    }
    words
}

/// The beginning of a text.
pub(super) fn shown(text: &str) -> String {
    match text.char_indices().nth(SHOWN_CHARS_MAX) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
