//! How late a thread of this machine is woken that does nothing but sleep: what no daemon can do anything about.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::histogram::Histogram;

/// Often enough for a p99 of ten seconds, and so seldom that it keeps no processor awake.
const PERIOD: Duration = Duration::from_millis(5);

/// A sleeper that is being watched.
pub struct Jitter {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Histogram>,
}

impl Jitter {
    pub fn begin() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let (mut late, mut due) = (Histogram::default(), Instant::now());
            while !stopped.load(Ordering::Relaxed) {
                due += PERIOD;
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                late.add_ns(due.elapsed().as_nanos() as i64);
                due = due.max(Instant::now() - PERIOD); // a long stall counts once
            }
            late
        });
        Self { stop, thread }
    }

    pub fn end(self) -> Histogram {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap_or_default() // it cannot panic
    }
}
