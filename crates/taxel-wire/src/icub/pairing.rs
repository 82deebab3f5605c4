//! Head and tail to whole modules.
//!
//! A scan of a module is two frames, head then tail, with one identifier and without a counter: nothing on the wire
//! says which head a tail belongs to. All there is to go by is order and time. A board sends head before tail, and
//! its next head not before a period has passed. So a head and the tail *after* it, less than a window apart that
//! is shorter than the period, are one scan.
//!
//! **A tail before a head is never paired**, however close they are. Two histories look alike: the two frames of one
//! scan were swapped on their way, or the tail ended one scan whose head was lost and the head begins the next. In the
//! second, both values are right and together they are a module that never was. Publishing nothing costs one scan;
//! publishing a torn module puts a false edge into the force. Hence the tail is an orphan and the head waits for its
//! own tail.
//!
//! **What holds, and when.** Let every frame, with its duplicates, arrive at most `jitter` after it was sent, and let
//! a board send its tail `gap` after its head. No two scans are mixed if `window <= period - jitter` and
//! `gap + jitter < period`. Beyond that (frames held back for nearly a period) the wire gives nothing to tell by.

use super::message::StatusWord;
use std::time::Duration;
use taxel_skin::{Time, VALUES_PER_MODULE};

/// Values in a head frame.
const HEAD_VALUES: usize = 7;

/// All twelve values of a module, of one and the same scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleScan {
    /// Receive time of the newer half, the tail.
    pub time: Time,
    /// Raw counts, thermal pads among them.
    pub values: [u8; VALUES_PER_MODULE],
    /// Health of the values.
    pub status: StatusWord,
}

/// Halves that found no partner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orphans {
    /// Heads that a later head replaced or that waited for a whole window.
    pub heads: u64,
    /// Tails without a head before them in the window.
    pub tails: u64,
}

/// Halves that said again what had been said within the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Duplicates {
    /// Heads.
    pub heads: u64,
    /// Tails.
    pub tails: u64,
}

#[derive(Clone, Copy, Debug)]
struct Head {
    time: Time,
    values: [u8; HEAD_VALUES],
}

/// The last scan that was published, for as long as duplicates of its halves may come.
#[derive(Clone, Copy, Debug)]
struct Last {
    head: Head,
    tail: [u8; VALUES_PER_MODULE - HEAD_VALUES],
    status: StatusWord,
}

/// Pairs the halves of one module, that is of one (bus, board, module).
///
/// Nothing is lost from the count: heads in = scans + orphan heads + duplicate heads + the pending one, and
/// tails in = scans + orphan tails + duplicate tails.
///
/// A half with the values of one that came less than a window ago is its duplicate and changes nothing. Within the
/// window a board cannot have sent a new scan, so no real one is taken for a duplicate.
///
/// Any order of times is safe. A tail stamped before the head is not its tail. A head always replaces the pending
/// one, so that pairing goes on with the first head after a clock stepped back.
#[derive(Clone, Debug)]
pub struct Pairer {
    window: Duration,
    pending: Option<Head>,
    last: Option<Last>,
    orphans: Orphans,
    duplicates: Duplicates,
}

impl Pairer {
    /// A pairer of halves that are strictly less than `window` apart. The caller makes the window shorter than the
    /// board's period by what frames may be late; with a window of zero nothing pairs.
    #[must_use]
    pub const fn new(window: Duration) -> Self {
        Self {
            window,
            pending: None,
            last: None,
            orphans: Orphans { heads: 0, tails: 0 },
            duplicates: Duplicates { heads: 0, tails: 0 },
        }
    }

    /// Takes a head: values 0 to 6, received at `time`.
    pub fn head(&mut self, time: Time, values: [u8; HEAD_VALUES]) {
        let known = self.pending.or(self.last.map(|last| last.head));
        if known.is_some_and(|head| head.values == values && self.within_window(head.time, time)) {
            self.duplicates.heads += 1;
            return;
        }
        if self.pending.replace(Head { time, values }).is_some() {
            self.orphans.heads += 1;
        }
    }

    /// Takes a tail: values 7 to 11 and status, received at `time`. Gives the scan that it completes.
    pub fn tail(&mut self, time: Time, values: [u8; 5], status: StatusWord) -> Option<ModuleScan> {
        let repeats =
            |last: Last| last.tail == values && last.status == status && self.within_window(last.head.time, time);
        if self.last.is_some_and(repeats) {
            self.duplicates.tails += 1;
            return None;
        }
        self.expire(time);
        let Some(head) = self.pending.take_if(|head| head.time <= time) else {
            self.orphans.tails += 1;
            return None;
        };
        self.last = Some(Last { head, tail: values, status });
        let [v0, v1, v2, v3, v4, v5, v6] = head.values;
        let [v7, v8, v9, v10, v11] = values;
        Some(ModuleScan { time, values: [v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10, v11], status })
    }

    /// Counts a pending head as an orphan once it has waited for a whole window at `now`.
    ///
    /// Pairing needs no such call, it expires heads by itself; a module that went silent shows its last orphan
    /// only through this.
    pub fn expire(&mut self, now: Time) {
        if self.pending.take_if(|head| now.since(head.time) >= self.window).is_some() {
            self.orphans.heads += 1;
        }
    }

    /// Halves without a partner since the start.
    #[must_use]
    pub const fn orphans(&self) -> Orphans {
        self.orphans
    }

    /// Repeated halves since the start.
    #[must_use]
    pub const fn duplicates(&self) -> Duplicates {
        self.duplicates
    }

    fn within_window(&self, a: Time, b: Time) -> bool {
        a.since(b).max(b.since(a)) < self.window
    }
}

#[cfg(test)]
mod tests;
