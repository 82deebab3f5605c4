//! Tokens: who does not come with an account or a certificate shows one with each call.
//!
//! The file holds their SHA-256, so that reading it gives nobody a token. A token is long and random (`openssl rand
//! -hex 32`), so that one round of a fast hash is enough.

use sha2::{Digest, Sha256};
use std::path::Path;
use subtle::ConstantTimeEq;

use crate::access::private_file::{Others, Reader, is_readable, read_guarded};
use crate::access::role::Role;

/// Bytes of a SHA-256.
const HASH_BYTES: usize = 32;

/// More tokens than a robot needs.
const TOKENS_MAX: usize = 256;

/// Longest name of a token's holder, in bytes.
const NAME_BYTES_MAX: usize = 64;

/// One token's holder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Holder {
    pub(crate) name: String,
    pub(crate) role: Role,
    hash: [u8; HASH_BYTES],
}

/// All tokens that are good.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tokens(Vec<Holder>);

impl Tokens {
    /// Reads the text of a token file: a line each of role, name and SHA-256 in hexadecimal; `#` begins a comment.
    ///
    /// # Errors
    /// The line, what is in it and what was expected. The text of a hash is not repeated.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut holders: Vec<Holder> = Vec::new();
        for (number, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default();
            if line.trim().is_empty() {
                continue;
            }
            let holder = holder(line).map_err(|problem| format!("line {}: {problem}", number + 1))?;
            if holders.iter().any(|other| other.name == holder.name || other.hash == holder.hash) {
                return Err(format!("line {}: `{}` or its token is there twice", number + 1, holder.name));
            }
            if holders.len() == TOKENS_MAX {
                return Err(format!("line {}: at most {TOKENS_MAX} tokens are possible", number + 1));
            }
            holders.push(holder);
        }
        Ok(Self(holders))
    }

    /// Reads a token file, which only its owner may read.
    ///
    /// # Errors
    /// The path, what is wrong with the file and what was expected.
    pub fn load(path: &Path) -> Result<Self, String> {
        Self::read(path, Reader::Daemon)
    }

    /// Looks at a token file for a daemon that may have another account. One that this account cannot read passes.
    ///
    /// # Errors
    /// The path, and what no daemon would take.
    pub fn check(path: &Path) -> Result<(), String> {
        if is_readable(path) { Self::read(path, Reader::Check).map(drop) } else { Ok(()) }
    }

    fn read(path: &Path, reader: Reader) -> Result<Self, String> {
        let within = |problem: String| format!("{}: {problem}", path.display());
        let bytes = read_guarded(path, Others::Nothing, reader).map_err(within)?;
        let text = String::from_utf8(bytes).map_err(|_| within("is not text".to_owned()))?;
        Self::parse(&text).map_err(within)
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whose token this is. How long it takes tells nothing of the tokens: each hash is compared whole.
    pub(crate) fn holder(&self, token: &[u8]) -> Option<&Holder> {
        let hash: [u8; HASH_BYTES] = Sha256::digest(token).into();
        let mut found = None;
        for holder in &self.0 {
            if bool::from(holder.hash.ct_eq(&hash)) {
                found = Some(holder); // and on through the others
            }
        }
        found
    }
}

fn holder(line: &str) -> Result<Holder, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [role, name, hash] = words[..] else {
        return Err(format!("{} words, expected three: role, name, SHA-256 of the token", words.len()));
    };
    let good = |c: char| c.is_ascii_alphanumeric() || "_-.@".contains(c);
    if name.len() > NAME_BYTES_MAX || !name.chars().all(good) {
        return Err(format!("a name is 1 to {NAME_BYTES_MAX} letters, digits, `_`, `-`, `.` or `@`"));
    }
    let hash = from_hex(hash).ok_or_else(|| {
        format!("the third word of `{name}` has {} characters, expected 64 hexadecimal digits", hash.chars().count())
    })?;
    Ok(Holder { name: name.to_owned(), role: role.parse()?, hash })
}

fn from_hex(text: &str) -> Option<[u8; HASH_BYTES]> {
    let mut bytes = [0; HASH_BYTES];
    if text.len() != 2 * HASH_BYTES || !text.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    for (byte, digits) in bytes.iter_mut().zip(text.as_bytes().chunks(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
    }
    Some(bytes)
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
        assert_eq!((holder.name.as_str(), holder.role, tokens.len()), ("bench", Role::Operator, 1));
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
            (twice, "line 2: `a` or its token is there twice"),
            (shared, "line 2: `b` or its token is there twice"),
        ];
        for (text, expected) in cases {
            let problem = Tokens::parse(&text).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
            assert!(!problem.contains(&OF_ABC[8..40]), "{problem}");
        }
    }

    #[test]
    fn names_have_at_most_64_letters_and_all_tokens_count() {
        let line = |letters: usize| format!("observer {} {OF_ABC}", "n".repeat(letters));
        assert_eq!(Tokens::parse(&line(64)).map(|tokens| tokens.len()), Ok(1));
        assert!(Tokens::parse(&line(65)).unwrap_err().contains("1 to 64 letters"));
        let two = Tokens::parse(&format!("{}\nadmin b {}", line(1), OF_ABC.replace('b', "c"))).unwrap();
        assert_eq!((two.len(), two.is_empty(), Tokens::default().is_empty()), (2, false, true));
    }

    #[test]
    fn a_file_is_read_and_its_path_is_in_what_is_wrong_with_it() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens");
        std::fs::write(&path, format!("admin ann {OF_ABC}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        assert_eq!(Tokens::load(&path).unwrap().holder(b"abc").map(|holder| holder.role), Some(Role::Admin));
        std::fs::write(&path, "admin ann").unwrap();
        let problem = Tokens::load(&path).unwrap_err();
        assert!(problem.contains("tokens: line 1: 2 words"), "{problem}");
    }
}
