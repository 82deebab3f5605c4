//! A file in blocks of whole lines, and these in parts: they can be parsed at the same time.

use std::io::{self, Read};

/// Whole lines of a file, block after block.
pub(super) struct Blocks<R> {
    input: R,
    /// A block is that long or longer, but for the last one.
    least_bytes: usize,
    /// What has been read of the next block.
    begun: Vec<u8>,
}

impl<R: Read> Blocks<R> {
    pub fn new(input: R, least_bytes: usize) -> Self {
        Self { input, least_bytes, begun: Vec::new() }
    }

    /// The next block; `None` at the end of the file. Without the `\r` of lines that end with `\r\n`. The last block may end within
    /// a line, and so does one in which no line ends. So many `lines` came before it.
    ///
    /// # Errors
    /// The file cannot be read on; with the number of lines that could be read.
    pub fn next(&mut self, lines: u64) -> io::Result<Option<Vec<u8>>> {
        self.begun.reserve(self.least_bytes);
        let read = self.input.by_ref().take(self.least_bytes as u64).read_to_end(&mut self.begun);
        let read = read.map_err(|error| match lines + lines_in(&self.begun) {
            0 => error,
            lines => io::Error::new(error.kind(), format!("after line {lines}: {error}")),
        })?;
        let end = self.begun.iter().rposition(|byte| *byte == b'\n').filter(|_| read > 0);
        let rest = end.map_or_else(Vec::new, |end| self.begun.split_off(end + 1));
        let mut block = std::mem::replace(&mut self.begun, rest);
        if block.contains(&b'\r') {
            let mut after = block.clone().into_iter().skip(1);
            block.retain(|byte| after.next() != Some(b'\n') || *byte != b'\r');
        }
        Ok((!block.is_empty()).then_some(block))
    }

    /// A block and all that follows it, in one piece.
    pub fn from(self, block: Vec<u8>) -> impl Read {
        io::Cursor::new(block).chain(io::Cursor::new(self.begun)).chain(self.input)
    }
}

/// Cuts whole lines into at most so many parts of whole lines, each with the number of lines before it.
pub(super) fn parts(text: &[u8], most: usize, least_bytes: usize) -> Vec<(u64, &[u8])> {
    let part_bytes = (text.len() / most.max(1)).max(least_bytes);
    let (mut parts, mut rest, mut lines) = (Vec::new(), text, 0);
    while !rest.is_empty() {
        let from = part_bytes.min(rest.len());
        let end = rest[from..].iter().position(|byte| *byte == b'\n').map_or(rest.len(), |at| from + at + 1);
        let (part, left) = rest.split_at(end);
        parts.push((lines, part));
        lines += lines_in(part);
        rest = left;
    }
    parts
}

/// How many lines end in the text.
pub(super) fn lines_in(text: &[u8]) -> u64 {
    text.iter().filter(|byte| **byte == b'\n').count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn blocks_and_parts_are_the_text_in_whole_lines(
            text in "[ab\n]{0,60}", least in 1..20_usize, most in 1..5_usize, taken in 0..8_usize,
        ) {
            let mut blocks = Blocks::new(text.as_bytes(), least);
            let mut found = Vec::new();
            for _ in 0..taken {
                let Some(block) = blocks.next(0).unwrap() else { break };
                prop_assert!(!block[..block.len() - 1].contains(&b'\n') || block.ends_with(b"\n") || block.len() < least);
                for (before, part) in parts(&block, most, 1) {
                    let at = part.as_ptr() as usize - block.as_ptr() as usize;
                    prop_assert_eq!(before, lines_in(&block[..at]));
                    prop_assert!(at == 0 || block[at - 1] == b'\n');
                }
                let lines: Vec<u8> = parts(&block, most, 1).iter().flat_map(|(_, part)| part.to_vec()).collect();
                prop_assert_eq!(&lines, &block);
                found.extend(block);
            }
            blocks.from(Vec::new()).read_to_end(&mut found).unwrap();
            prop_assert_eq!(found, text.as_bytes());
        }

        #[test]
        fn a_line_that_ends_with_two_characters_ends_with_one(text in "[a\r\n]{0,40}", least in 1..60_usize) {
            let mut blocks = Blocks::new(text.as_bytes(), least);
            let (mut found, mut whole_lines) = (Vec::new(), true);
            while let Some(block) = blocks.next(0).unwrap() {
                whole_lines &= found.is_empty() || found.ends_with(b"\n");
                found.extend(block);
            }
            // A block without the end of a line may end between both characters.
            prop_assert!(!whole_lines || found == text.replace("\r\n", "\n").as_bytes());
        }
    }
}
