//! Refusals in the log: the first of a kind at once, of the rest a count, so that a flood of them is not one of lines.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::access::origin::PeerKey;

/// What came after the first is told after so long, in one line.
const COUNTED_FOR: Duration = Duration::from_secs(10);

/// Kinds that are told apart within that time; what is beyond shares one line.
const KINDS_MAX: usize = 64;

/// What was refused lately.
#[derive(Debug, Default)]
pub(crate) struct Refusals(Mutex<HashMap<String, Kind>>);

#[derive(Debug, Default)]
struct Kind {
    /// Refusals that no line told of.
    untold: u64,
    /// The newest of them.
    newest: String,
}

impl Refusals {
    /// Something was refused: of this kind, to this peer.
    pub(crate) fn tell(&self, (what, peer): (&str, &PeerKey), text: impl FnOnce() -> String) {
        let mut kinds = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut name = format!("{what} {peer}");
        if kinds.len() >= KINDS_MAX && !kinds.contains_key(&name) {
            "others".clone_into(&mut name);
        }
        match kinds.get_mut(&name) {
            Some(kind) => {
                kind.untold += 1;
                kind.newest = text();
            }
            None => {
                kinds.insert(name, Kind::default());
                tracing::warn!("{}", text());
            }
        }
    }

    /// Tells what is untold, for ever.
    pub(crate) async fn keep(&self) -> std::convert::Infallible {
        loop {
            tokio::time::sleep(COUNTED_FOR).await;
            for line in self.take() {
                tracing::warn!("{line}");
            }
        }
    }

    /// The lines that are due. A kind of which nothing came since the last time is new when it comes again.
    pub(crate) fn take(&self) -> Vec<String> {
        let mut kinds = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kinds.retain(|_, kind| kind.untold > 0);
        let seconds = COUNTED_FOR.as_secs();
        let line = |kind: &mut Kind| {
            let Kind { untold, newest } = std::mem::take(kind);
            format!("{untold} more like the last within {seconds} s: {newest}")
        };
        kinds.values_mut().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_refusals_are_two_lines_and_a_kind_that_ended_begins_anew() {
        let (refusals, peer) = (Refusals::default(), PeerKey::User(7));
        for n in 0..1000 {
            refusals.tell(("stream", &peer), || format!("stream {n}"));
        }
        refusals.tell(("call", &peer), || "call".to_owned());
        assert_eq!(refusals.take(), ["999 more like the last within 10 s: stream 999"]);
        assert_eq!(refusals.take(), Vec::<String>::new());
        assert!(refusals.0.lock().unwrap().is_empty());
    }

    #[test]
    fn however_many_peers_there_are_little_is_kept() {
        let refusals = Refusals::default();
        for uid in 0..100_000 {
            refusals.tell(("stream", &PeerKey::User(uid)), String::new);
        }
        assert_eq!(refusals.0.lock().unwrap().len(), KINDS_MAX + 1);
        assert_eq!(refusals.take().len(), 1, "all that had no line of their own");
    }
}
