//! Colour on a terminal: a word that says how something is in green, yellow or red.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::ColorChoice;

/// Standard output is shown in colour.
static COLOURED: AtomicBool = AtomicBool::new(false);

/// How something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Usable, with a reservation.
    Warn,
    /// Not usable.
    Bad,
}

/// Decides once whether there is colour: as `--color` says, or on a terminal unless `NO_COLOR` is set (<https://no-color.org>).
pub fn choose(choice: ColorChoice) {
    let coloured = match choice {
        ColorChoice::Always => true,
        ColorChoice::Never => false,
        ColorChoice::Auto => {
            std::env::var_os("NO_COLOR").is_none_or(|set| set.is_empty()) && std::io::stdout().is_terminal()
        }
    };
    COLOURED.store(coloured, Ordering::Relaxed);
}

impl Tone {
    /// The text in this tone, where there is colour.
    pub fn paint(self, text: &str) -> String {
        if !COLOURED.load(Ordering::Relaxed) {
            return text.to_owned();
        }
        let colour = match self {
            Self::Good => 32,
            Self::Warn => 33,
            Self::Bad => 31,
        };
        format!("\x1b[1;{colour}m{text}\x1b[0m")
    }
}
