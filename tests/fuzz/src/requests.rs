//! Inputs of the service: calls by name, each with the bytes of its message.

/// Calls, one after the other: a name, a line feed, the length in two bytes, the message.
pub struct Requests<'a>(&'a [u8]);

impl<'a> Requests<'a> {
    pub const fn new(data: &'a [u8]) -> Self {
        Self(data)
    }
}

impl<'a> Iterator for Requests<'a> {
    type Item = (&'a str, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let end = self.0.iter().position(|byte| *byte == b'\n')?;
        let name = std::str::from_utf8(&self.0[..end]).ok()?;
        let (length, rest) = self.0[end + 1..].split_first_chunk()?;
        let (message, rest) = rest.split_at(usize::from(u16::from_le_bytes(*length)).min(rest.len()));
        self.0 = rest;
        Some((name, message))
    }
}
