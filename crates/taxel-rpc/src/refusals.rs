//! Refusals in the log: of each kind a line at most every ten seconds, so that a flood of them is not one of lines.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

/// A kind has a line at most this often.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Kinds that are told apart within that time; what is beyond shares one line.
const KINDS_MAX: usize = 64;

/// What was refused lately: by kind, when its last line was written.
#[derive(Debug, Default)]
pub(crate) struct Refusals(Mutex<HashMap<String, Instant>>);

impl Refusals {
    /// Something was refused: of this kind, to this peer.
    pub(crate) fn tell(&self, (what, peer): (&str, &str), text: impl FnOnce() -> String) {
        let mut kinds = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kinds.retain(|_, told| told.elapsed() < LINE_EVERY);
        let mut kind = format!("{what} {peer}");
        if kinds.len() >= KINDS_MAX && !kinds.contains_key(&kind) {
            "others".clone_into(&mut kind);
        }
        kinds.entry(kind).or_insert_with(|| {
            let text = text();
            tracing::warn!("{text}");
            Instant::now()
        });
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_flood_of_refusals_is_a_line_every_ten_seconds_and_however_many_peers_there_are_little_is_kept() {
        let (refusals, lines) = (Refusals::default(), Cell::new(0));
        let tell = |peer: &str| {
            refusals.tell(("stream", peer), || {
                lines.set(lines.get() + 1);
                String::new()
            });
        };
        (0..1000).for_each(|_| tell("a"));
        assert_eq!(lines.get(), 1);
        tokio::time::advance(LINE_EVERY).await;
        (0..1000).for_each(|_| tell("a"));
        assert_eq!(lines.get(), 2);
        (0..10_000).for_each(|uid| tell(&uid.to_string()));
        assert_eq!((lines.get(), refusals.0.lock().unwrap().len()), (KINDS_MAX + 2, KINDS_MAX + 1));
    }
}
