//! Lines of candump logs.

use taxel_wire::candump::{LogError, parse_line, parse_line_bytes, write_line};

/// Any lines.
pub fn run(data: &[u8]) {
    data.split_inclusive(|byte| *byte == b'\n').for_each(check);
}

fn check(line: &[u8]) {
    match parse_line_bytes(line) {
        Ok(parsed) => {
            let mut text = String::new();
            write_line(&mut text, parsed.time, parsed.interface, &parsed.frame).expect("a string takes any text");
            let again = parse_line(&text).expect("what was written is read");
            assert_eq!((again.time, again.interface, again.frame), (parsed.time, parsed.interface, parsed.frame));
        }
        Err(error) => {
            let (LogError::Syntax { column, .. } | LogError::TimeRange { column } | LogError::IdRange { column, .. }) =
                error;
            assert!((1..=line.len() + 1).contains(&column), "{error}");
            assert!(error.to_string().contains("expected"), "{error}");
        }
    }
}
