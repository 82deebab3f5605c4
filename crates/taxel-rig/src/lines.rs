//! From the bytes of a serial line or a connection to lines of text.

/// A longer line is none that a gauge prints, but another protocol or another baud rate.
pub const LINE_BYTES_MAX: usize = 256;

/// Cuts bytes into lines, at carriage returns and line feeds. What comes before the first of them may be the rest of a line whose
/// beginning went before anybody listened: `23.4` of `123.4`. So it is left out.
#[derive(Debug, Default)]
pub struct Lines {
    /// The line that has not ended yet.
    begun: Vec<u8>,
    /// Whether an end of a line has come.
    is_cut: bool,
    /// Whether the present line has grown too long.
    is_long: bool,
}

impl Lines {
    /// For a device that says nothing unless it is asked: its first byte begins a line.
    #[must_use]
    pub fn from_the_first() -> Self {
        Self { is_cut: true, ..Self::default() }
    }

    /// Takes what was read; the lines that it ends, without the empty ones. A line that is too long comes cut off.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<String> {
        let mut ended = Vec::new();
        for &byte in bytes {
            if !matches!(byte, b'\r' | b'\n') {
                self.is_long |= self.begun.len() == LINE_BYTES_MAX;
                if !self.is_long {
                    self.begun.push(byte);
                }
                continue;
            }
            let line = String::from_utf8_lossy(&self.begun).trim().to_owned();
            if std::mem::replace(&mut self.is_cut, true) && !line.is_empty() {
                ended.push(line);
            }
            self.begun.clear();
            self.is_long = false;
        }
        ended
    }

    /// Whether more came without an end than any line has: no end will come.
    #[must_use]
    pub const fn is_endless(&self) -> bool {
        self.is_long
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_of_a_line_that_began_before_is_left_out() {
        let mut lines = Lines::default();
        assert_eq!(lines.take(b"23.4\r\n12"), [""; 0]);
        assert_eq!(lines.take(b"3.5\r"), ["123.5"]);
        assert_eq!(lines.take(b"\n\r\n 7 \n8\n"), ["7", "8"]);
        assert_eq!(Lines::from_the_first().take(b"23.4\r"), ["23.4"]);
    }

    #[test]
    fn a_line_without_an_end_is_bounded_and_told() {
        let mut lines = Lines::from_the_first();
        assert!(lines.take(&[b'x'; 256]).is_empty() && !lines.is_endless());
        assert!(lines.take(&[0xFF; 10_000]).is_empty() && lines.is_endless());
        let ended = lines.take(b"\n1\n");
        assert_eq!((ended.len(), ended[0].len(), ended[1].as_str()), (2, LINE_BYTES_MAX, "1"));
        assert!(!lines.is_endless());
    }
}
