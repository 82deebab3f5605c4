//! Text in a fixed number of bytes.

use std::fmt;

/// At most `N` bytes of UTF-8, the rest zero. What is longer is cut at a character.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text<const N: usize>([u8; N]);

impl<const N: usize> Text<N> {
    /// As much of `text` as there is room for.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut bytes = [0; N];
        let end = (0..=N.min(text.len())).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// The text: up to the first zero, and as far as it is UTF-8.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|&byte| byte == 0).unwrap_or(N);
        self.0[..end].utf8_chunks().next().map_or("", |chunk| chunk.valid())
    }

    pub(crate) const fn of_bytes(bytes: [u8; N]) -> Self {
        Self(bytes)
    }

    pub(crate) const fn bytes(&self) -> &[u8; N] {
        &self.0
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl<const N: usize> fmt::Display for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_long_is_cut_at_a_character_and_bad_bytes_are_left_out() {
        assert_eq!(Text::<8>::new("force").as_str(), "force");
        assert_eq!(Text::<4>::new("force").as_str(), "forc");
        assert_eq!(Text::<4>::new("abc\u{e9}").as_str(), "abc");
        assert_eq!(Text::<0>::new("a").as_str(), "");
        assert_eq!(Text::of_bytes([b'a', 0xff, b'b']).as_str(), "a");
    }
}
