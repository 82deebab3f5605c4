//! How something is, in green, yellow or red. `say` leaves the colour out where there is no terminal, or `NO_COLOR` is set.

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

impl Tone {
    /// The text in this tone.
    pub fn paint(self, text: &str) -> String {
        let colour = match self {
            Self::Good => 32,
            Self::Warn => 33,
            Self::Bad => 31,
        };
        format!("\x1b[1;{colour}m{text}\x1b[0m")
    }
}
