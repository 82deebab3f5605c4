//! A request in words, for the audit log.

use std::fmt::{self, Write};

/// Longest account of a request that is kept, in characters.
const SAID_CHARS_MAX: usize = 256;

/// A request as it came, short: what a terminal would act upon is written out.
pub(crate) fn said(request: &impl fmt::Debug) -> String {
    let mut short = Short(String::new());
    let _ = write!(short, "{request:?}"); // it ends where there is no more room
    short.0
}

/// Takes a text up to its limit: one with a model set in it has megabytes.
struct Short(String);

impl Write for Short {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = SAID_CHARS_MAX.saturating_sub(self.0.chars().count());
        self.0.extend(text.chars().take(room));
        if room > 0 { Ok(()) } else { Err(fmt::Error) }
    }
}
