//! Tokens: who does not come with an account or a certificate shows one with each call.
//!
//! The file holds their SHA-256, so that reading it gives nobody a token. A token is long and random (`openssl rand
//! -hex 32`), so that one round of a fast hash is enough.

use std::collections::HashMap;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::access::private_file::{SECRET, read_guarded};
use crate::access::table::Role;

/// Hexadecimal digits of a SHA-256.
const HASH_DIGITS: usize = 64;

/// Longest name of a token's holder, in bytes.
const NAME_BYTES_MAX: usize = 64;

/// One token's holder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Holder {
    pub(crate) name: String,
    pub(crate) role: Role,
}

/// All tokens that are good: their holders by their SHA-256 in lower-case hexadecimal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tokens(HashMap<String, Holder>);

impl Tokens {
    /// Reads the text of a token file: a line each of role, name and SHA-256 in hexadecimal; `#` begins a comment.
    ///
    /// # Errors
    /// The line, what is in it and what was expected. The text of a hash is not repeated.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut holders: HashMap<String, Holder> = HashMap::new();
        for (number, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default();
            if line.trim().is_empty() {
                continue;
            }
            let (hash, holder) = holder(line).map_err(|problem| format!("line {}: {problem}", number + 1))?;
            if holders.contains_key(&hash) || holders.values().any(|other| other.name == holder.name) {
                return Err(format!("line {}: `{}` or its token is there twice", number + 1, holder.name));
            }
            holders.insert(hash, holder);
        }
        Ok(Self(holders))
    }

    /// Reads a token file, which only its owner may read.
    ///
    /// # Errors
    /// The path, what is wrong with the file and what was expected.
    pub fn load(path: &Path) -> Result<Self, String> {
        let within = |problem: String| format!("{}: {problem}", path.display());
        let bytes = read_guarded(path, SECRET)?;
        let text = String::from_utf8(bytes).map_err(|_| within("is not text".to_owned()))?;
        Self::parse(&text).map_err(within)
    }

    /// Whose token this is. Looking it up by its hash tells nobody anything of a token that he does not have.
    pub(crate) fn holder(&self, token: &[u8]) -> Option<&Holder> {
        let hash: String = Sha256::digest(token).iter().map(|byte| format!("{byte:02x}")).collect();
        self.0.get(&hash)
    }
}

fn holder(line: &str) -> Result<(String, Holder), String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [role, name, hash] = words[..] else {
        return Err(format!("{} words, expected three: role, name, SHA-256 of the token", words.len()));
    };
    let good = |c: char| c.is_ascii_alphanumeric() || "_-.@".contains(c);
    if name.len() > NAME_BYTES_MAX || !name.chars().all(good) {
        return Err(format!("a name is 1 to {NAME_BYTES_MAX} letters, digits, `_`, `-`, `.` or `@`"));
    }
    let characters = hash.chars().count();
    if characters != HASH_DIGITS || !hash.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        let why = format!("has {characters} characters, expected {HASH_DIGITS} hexadecimal digits");
        return Err(format!("the third word of `{name}` {why}"));
    }
    let known = Role::ALL.into_iter().find(|known| known.name() == role);
    let role = known.ok_or_else(|| format!("`{role}` is no role: expected observer, operator or admin"))?;
    Ok((hash.to_ascii_lowercase(), Holder { name: name.to_owned(), role }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SHA-256 of `abc`, FIPS 180-2 appendix B.1.
    const OF_ABC: &str = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

    #[test]
    fn a_token_is_found_by_its_hash_and_no_other_is() {
        let tokens = Tokens::parse(&format!("# who\n\noperator bench {OF_ABC} # the bench\n")).unwrap();
        let holder = tokens.holder(b"abc").unwrap();
        assert_eq!((holder.name.as_str(), holder.role), ("bench", Role::Operator));
        for wrong in [&b"abd"[..], b"ab", b"", OF_ABC.as_bytes()] {
            assert_eq!(tokens.holder(wrong), None);
        }
    }

    #[test]
    fn a_bad_line_is_refused_with_its_number_and_without_its_hash() {
        let other = OF_ABC.replace('b', "c");
        let twice = format!("admin a {OF_ABC}\nadmin a {other}");
        let shared = format!("admin a {OF_ABC}\nadmin b {OF_ABC}");
        let cases = [
            ("admin root".to_owned(), "line 1: 2 words, expected three"),
            (format!("\nroot r {OF_ABC}"), "line 2: `root` is no role: expected observer, operator or admin"),
            (format!("admin r {}", &OF_ABC[1..]), "line 1: the third word of `r` has 63 characters"),
            (format!("admin r {}", OF_ABC.replace('b', "g")), "expected 64 hexadecimal digits"),
            (format!("admin r\u{7} {OF_ABC}"), "line 1: a name is 1 to 64 letters"),
            (format!("admin {} {OF_ABC}", "n".repeat(65)), "line 1: a name is 1 to 64 letters"),
            (twice, "line 2: `a` or its token is there twice"),
            (shared, "line 2: `b` or its token is there twice"),
        ];
        for (text, expected) in cases {
            let problem = Tokens::parse(&text).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
            assert!(!problem.contains(&OF_ABC[8..40]), "{problem}");
        }
    }
}
