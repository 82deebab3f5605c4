//! Lines of text from a stranger, of a bounded length.

use std::io;

use tokio::io::{AsyncBufRead, AsyncBufReadExt};

/// Longest line: the longest vector of a robot's skin has 1,344 numbers of up to eight bytes.
pub(crate) const LINE_BYTES_MAX: usize = 64 * 1024;

/// Reads one line into `line`, without its end; false at the end of the stream. May be cancelled: what was read stays in
/// `line`, which the caller clears once it has used it.
///
/// # Errors
/// What the system says; `InvalidData` for a line that is too long or no UTF-8.
pub(crate) async fn read_line(from: &mut (impl AsyncBufRead + Unpin), line: &mut Vec<u8>) -> io::Result<bool> {
    loop {
        let buffer = from.fill_buf().await?;
        if buffer.is_empty() {
            return Ok(false);
        }
        let (used, ended) = match buffer.iter().position(|&byte| byte == b'\n') {
            Some(end) => (end + 1, true),
            None => (buffer.len(), false),
        };
        line.extend_from_slice(&buffer[..used]);
        from.consume(used);
        if line.len() > LINE_BYTES_MAX {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a line of more than 64 KiB"));
        }
        if ended {
            while line.last().is_some_and(|byte| matches!(byte, b'\n' | b'\r')) {
                line.pop();
            }
            return Ok(true);
        }
    }
}

/// As text; what is no UTF-8 is shown as such.
pub(crate) fn text(line: &[u8]) -> String {
    String::from_utf8_lossy(line).into_owned()
}
