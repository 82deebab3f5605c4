//! Heads and tails of one module, at any time and in any order.

use std::time::Duration;

use taxel_skin::Time;
use taxel_wire::icub::{ModuleScan, Pairer, StatusWord};

use crate::bytes::Bytes;

/// A window, then halves: what it is, its values, and when it comes after the one before.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let window = Duration::from_micros(u64::from(bytes.word()));
    let mut watch =
        Watch { pairer: Pairer::new(window), window, now: 0, since_scan: vec![], heads: 0, tails: 0, scans: 0 };
    while !bytes.is_empty() {
        let [what, value, steps] = bytes.array();
        // Mostly some milliseconds, now and then back or centuries on.
        let step = i64::from(steps as i8).saturating_mul(1_000 << (8 * u32::from(what >> 5)).min(52));
        watch.now = watch.now.saturating_add(step);
        match what & 3 {
            0 => watch.pairer.expire(Time::from_nanos(watch.now)),
            1 => watch.head(value),
            _ => watch.tail(value, what & 4 != 0),
        }
        watch.count();
    }
}

/// A pairer, and what it was given.
struct Watch {
    pairer: Pairer,
    window: Duration,
    now: i64,
    /// Heads since the last scan.
    since_scan: Vec<(Time, [u8; 7])>,
    heads: u64,
    tails: u64,
    scans: u64,
}

impl Watch {
    fn head(&mut self, value: u8) {
        let (time, values) = (Time::from_nanos(self.now), [value; 7]);
        self.heads += 1;
        self.since_scan.push((time, values));
        self.pairer.head(time, values);
    }

    fn tail(&mut self, value: u8, not_ok: bool) {
        let (time, status) = (Time::from_nanos(self.now), StatusWord(not_ok.into()));
        self.tails += 1;
        if let Some(scan) = self.pairer.tail(time, [value; 5], status) {
            self.scans += 1;
            let ModuleScan { values, .. } = scan;
            assert_eq!((scan.time, &values[7..], scan.status), (time, [value; 5].as_slice(), status));
            // Both halves of one scan: its head was the newest, and came before, within the window.
            let newest = self.since_scan.last().expect("a scan has a head");
            assert_eq!(newest.1, values[..7]);
            let fits =
                |(at, head): &(Time, [u8; 7])| *head == values[..7] && *at <= time && time.since(*at) < self.window;
            assert!(self.since_scan.iter().any(fits), "{scan:?} of {:?}", self.since_scan);
            self.since_scan.clear();
        }
    }

    /// Every half is in a scan, an orphan, a duplicate, or waits.
    fn count(&self) {
        let (orphans, duplicates) = (self.pairer.orphans(), self.pairer.duplicates());
        let counted = self.scans + orphans.heads + duplicates.heads;
        assert!(self.heads == counted || self.heads == counted + 1, "one may wait: {} of {}", counted, self.heads);
        assert_eq!(self.tails, self.scans + orphans.tails + duplicates.tails);
    }
}
