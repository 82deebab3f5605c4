//! A file in blocks of whole lines: they can be parsed at the same time.

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

    /// The next block; `None` at the end of the file.
    ///
    /// # Errors
    /// The file cannot be read on.
    pub fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        loop {
            let wanted = self.least_bytes as u64;
            self.begun.reserve(self.least_bytes);
            if self.input.by_ref().take(wanted).read_to_end(&mut self.begun)? == 0 {
                let last = std::mem::take(&mut self.begun);
                return Ok((!last.is_empty()).then_some(last));
            }
            if let Some(end) = self.begun.iter().rposition(|byte| *byte == b'\n') {
                let rest = self.begun.split_off(end + 1);
                return Ok(Some(std::mem::replace(&mut self.begun, rest)));
            }
        }
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
            text in "[ab\\n]{0,60}", least in 1..20_usize, most in 1..5_usize, taken in 0..4_usize,
        ) {
            let mut blocks = Blocks::new(text.as_bytes(), least);
            let mut found = Vec::new();
            for _ in 0..taken {
                let Some(block) = blocks.next().unwrap() else { break };
                prop_assert!(block.ends_with(b"\n") || text.as_bytes()[found.len()..] == block);
                let lines: Vec<u8> = parts(&block, most, 1).iter().flat_map(|(_, part)| part.to_vec()).collect();
                prop_assert_eq!(&lines, &block);
                for (before, part) in parts(&block, most, 1) {
                    let at = part.as_ptr() as usize - block.as_ptr() as usize;
                    prop_assert_eq!(before, lines_in(&block[..at]));
                    prop_assert!(at == 0 || block[at - 1] == b'\n');
                }
                found.extend(block);
            }
            blocks.from(Vec::new()).read_to_end(&mut found).unwrap();
            prop_assert_eq!(found, text.as_bytes());
        }
    }
}
