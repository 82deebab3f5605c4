//! Places of large answers: one that has been on its way for long gives its place to a new one, so that slow readers hold none
//! for ever.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

/// All places. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct LargeAnswers {
    state: Arc<Mutex<State>>,
    most: usize,
    /// An answer that is on its way for so long has to go if its place is asked for.
    granted: Duration,
}

#[derive(Debug, Default)]
struct State {
    /// Oldest first.
    entries: Vec<Entry>,
    begun: u64,
}

#[derive(Debug)]
struct Entry {
    number: u64,
    since: Instant,
    /// Cuts the connection that it goes over.
    cut: CancellationToken,
}

impl LargeAnswers {
    /// So many at once, each for as long as it is granted and then until another one needs its place.
    pub(crate) fn new(most: usize, granted: Duration) -> Self {
        Self { state: Arc::default(), most, granted }
    }

    /// A place for one more at `now`, over a connection that `cut` cuts. If all are taken, the oldest goes that has had its time;
    /// `None` if none has.
    pub(crate) fn begin(&self, now: Instant, cut: CancellationToken) -> Option<LargeAnswer> {
        let mut state = self.state();
        if state.entries.len() >= self.most {
            let oldest =
                state.entries.first().filter(|oldest| now.saturating_duration_since(oldest.since) >= self.granted)?;
            oldest.cut.cancel();
            state.entries.remove(0);
        }
        state.begun += 1;
        let number = state.begun;
        state.entries.push(Entry { number, since: now, cut });
        Some(LargeAnswer { number, all: self.clone() })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The place of one answer, until it is dropped.
#[derive(Debug)]
pub(crate) struct LargeAnswer {
    number: u64,
    all: LargeAnswers,
}

impl Drop for LargeAnswer {
    fn drop(&mut self) {
        self.all.state().entries.retain(|entry| entry.number != self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_answer_that_has_had_its_time_goes_and_no_other() {
        let (answers, begun) = (LargeAnswers::new(2, Duration::from_secs(30)), Instant::now());
        let cuts: Vec<CancellationToken> = (0..4).map(|_| CancellationToken::new()).collect();
        let begin = |which: usize, second| answers.begin(begun + Duration::from_secs(second), cuts[which].clone());
        let are_cut = || cuts.iter().map(CancellationToken::is_cancelled).collect::<Vec<_>>();
        let (first, second) = (begin(0, 0), begin(1, 29));
        assert!(first.is_some() && second.is_some());
        assert!(begin(2, 29).is_none(), "both have time left");
        let third = begin(2, 30);
        assert!(third.is_some());
        assert_eq!(are_cut(), [true, false, false, false]);
        drop(first); // its place is another's by now
        assert!(begin(3, 31).is_none());
        drop(second);
        assert!(begin(3, 31).is_some(), "one was read to its end");
        assert_eq!(are_cut(), [true, false, false, false]);
    }
}
