//! Rows of the store: what is in them once their checksum holds.

use taxel_store::fuzzing;

/// The kind of row, then what it holds.
pub fn run(data: &[u8]) {
    let Some((kind, row)) = data.split_first() else { return };
    match kind % 4 {
        0 => text(row, fuzzing::session_again),
        1 => text(row, fuzzing::load_again),
        2 => {
            let again = fuzzing::ramp_again(row);
            assert_eq!(again.is_some(), row.len().is_multiple_of(8));
            assert!(again.is_none_or(|again| again == row), "every bit is kept");
        }
        _ => {
            let again = fuzzing::counts_again(row);
            assert!(!again.is_empty() && again.iter().all(|again| again == row), "as bytes it always means something");
        }
    }
}

/// What is read of a text is read of what is written of it.
fn text(row: &[u8], again: fn(&str) -> Result<[String; 2], String>) {
    let Ok(text) = std::str::from_utf8(row) else { return };
    match again(text) {
        Ok([read, read_again]) => assert_eq!(read, read_again),
        Err(reason) => assert!(!reason.is_empty()),
    }
}
