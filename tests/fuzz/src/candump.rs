//! Lines of candump logs.

use taxel_wire::candump::parse_line;

/// Any lines.
pub fn run(data: &[u8]) {
    data.split_inclusive(|byte| *byte == b'\n').for_each(check);
}

fn check(line: &[u8]) {
    match parse_line(line) {
        Ok(parsed) => assert!(!parsed.interface.is_empty() && parsed.time.as_nanos() >= 0),
        Err(error) => assert!((1..=line.len() + 1).contains(&error.column), "{error}"),
    }
}
