//! Text for people on standard output.
//!
//! `println!` panics when the reader has gone, as in `taxeld check ... | head`. Here the rest of the text is then left
//! unsaid and the work goes on, so that files which were asked for are still written.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Prints a line, like `println!`.
#[macro_export]
macro_rules! say {
    () => { $crate::say::line(format_args!("")) };
    ($($text:tt)*) => { $crate::say::line(format_args!($($text)*)) };
}

/// The reader of the text has gone.
static GONE: AtomicBool = AtomicBool::new(false);
/// Standard output carries data: text for people goes to standard error.
static ASIDE: AtomicBool = AtomicBool::new(false);

/// From now on text goes to standard error, because standard output carries data.
pub fn step_aside() {
    ASIDE.store(true, Ordering::Relaxed);
}

/// Whether the reader of the text has gone: who only prints may end.
#[must_use]
pub fn reader_has_gone() -> bool {
    GONE.load(Ordering::Relaxed)
}

/// Prints a line. Ends the programme with failure if it cannot be written although somebody still reads.
pub fn line(text: Arguments<'_>) {
    if ASIDE.load(Ordering::Relaxed) {
        return error_line(text);
    }
    let mut out = anstream::stdout().lock();
    match out.write_fmt(text).and_then(|()| out.write_all(b"\n")) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => GONE.store(true, Ordering::Relaxed),
        Err(error) => {
            error_line(format_args!("standard output: {error}"));
            std::process::exit(1);
        }
    }
}

/// Writes a line to standard error; whether anybody reads it changes nothing.
pub fn error_line(text: Arguments<'_>) {
    let mut out = anstream::stderr().lock();
    let _ = out.write_fmt(text).and_then(|()| out.write_all(b"\n"));
}
