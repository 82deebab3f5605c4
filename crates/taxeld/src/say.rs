//! Text for whoever reads standard output.
//!
//! `println!` panics when the reader has gone, as in `taxeld check ... | head`. Here the rest of the text is then left
//! unsaid and the work goes on, so that files which were asked for are still written.

use std::io::{ErrorKind, Write};

/// Prints a line, like `println!`.
macro_rules! say {
    () => { $crate::say::line(format_args!("")) };
    ($($text:tt)*) => { $crate::say::line(format_args!($($text)*)) };
}

/// Prints a line. Ends the programme with failure if it cannot be written although somebody still reads.
pub fn line(text: std::fmt::Arguments<'_>) {
    let mut out = std::io::stdout().lock();
    match out.write_fmt(text).and_then(|()| out.write_all(b"\n")) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {}
        Err(error) => {
            eprintln!("taxeld: standard output: {error}");
            std::process::exit(1);
        }
    }
}
