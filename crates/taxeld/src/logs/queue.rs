//! Lines of the log on their way to whoever reads them. A thread of its own writes, so that nobody who logs waits for a reader
//! that stands still, such as a journal that was stopped or a pipe that nobody empties. What does not fit is counted.

use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// So much may wait: some thousand lines, as a start and an hour of faults make.
const WAITING_BYTES_MAX: usize = 256 * 1024;

/// The end at which lines are put in. Clones are of the same queue.
#[derive(Clone)]
pub struct LogQueue(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    /// There is something to write, or all is written.
    changed: Condvar,
}

#[derive(Default)]
struct State {
    waiting: Vec<u8>,
    /// Lines that were left out since it was told last.
    dropped: u64,
    /// The thread has taken something and is not done with it.
    writing: bool,
}

impl LogQueue {
    /// Starts the thread, which writes to `to`. Once something is read again after lines were dropped, it calls
    /// `tell_dropped` with their number, so that a line about them follows those before them.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn start(to: impl Write + Send + 'static, tell_dropped: fn(u64)) -> io::Result<Self> {
        let queue = Self(Arc::default());
        let shared = Arc::clone(&queue.0);
        std::thread::Builder::new().name("log".to_owned()).spawn(move || shared.write_all_to(to, tell_dropped))?;
        Ok(queue)
    }

    /// Takes a line, or counts it as dropped. Once one was dropped all are, until the thread has taken those that wait: none
    /// is missing among those that are written.
    pub fn put(&self, line: &[u8]) {
        let mut state = self.0.lock();
        if state.dropped > 0 || state.waiting.len() + line.len() > WAITING_BYTES_MAX {
            state.dropped += 1;
        } else {
            state.waiting.extend_from_slice(line);
        }
        drop(state);
        self.0.changed.notify_all();
    }

    /// Waits until all is written, at most so long. Whether it is.
    pub fn flush(&self, within: Duration) -> bool {
        let left = |state: &mut State| state.writing || state.dropped > 0 || !state.waiting.is_empty();
        let waited = self.0.changed.wait_timeout_while(self.0.lock(), within, left);
        !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }
}

/// A line a call, as tracing writes them.
impl Write for LogQueue {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.put(line);
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_all_to(&self, mut to: impl Write, tell_dropped: fn(u64)) {
        loop {
            let (lines, dropped) = self.take();
            if dropped > 0 {
                tell_dropped(dropped); // into this queue, of which room was just made
            }
            let _ = to.write_all(&lines).and_then(|()| to.flush()); // without a reader it is nobody's loss
        }
    }

    /// Waits for something to write and takes it, with the number of lines that were dropped after it.
    fn take(&self) -> (Vec<u8>, u64) {
        let mut state = self.lock();
        state.writing = false;
        self.changed.notify_all();
        let idle = |state: &mut State| state.waiting.is_empty() && state.dropped == 0;
        state = self.changed.wait_while(state, idle).unwrap_or_else(PoisonError::into_inner);
        state.writing = true;
        (std::mem::take(&mut state.waiting), std::mem::take(&mut state.dropped))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::OnceLock;
    use std::sync::mpsc::{Receiver, Sender, channel};

    use super::*;

    /// A reader that reads when it is told to: a write says that it waits, waits for the word, and then hands over what it
    /// was given.
    struct Reader {
        waits: Sender<()>,
        read: Receiver<()>,
        got: Sender<Vec<u8>>,
    }

    impl Write for Reader {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.waits.send(());
            let _ = self.read.recv(); // without a test that reads, all is taken
            let _ = self.got.send(bytes.to_vec());
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// The test's ends of a reader: whether it waits, the word to read, and what it has read.
    struct Ends {
        waits: Receiver<()>,
        may_read: Sender<()>,
        lines: Receiver<Vec<u8>>,
    }

    fn reader() -> (Reader, Ends) {
        let ((told, waits), (may_read, read), (got, lines)) = (channel(), channel(), channel());
        (Reader { waits: told, read, got }, Ends { waits, may_read, lines })
    }

    #[test]
    fn whoever_logs_does_not_wait_and_what_did_not_fit_is_told_in_its_place() {
        static QUEUE: OnceLock<LogQueue> = OnceLock::new();
        let (reader, ends) = reader();
        let tell = |dropped| QUEUE.get().unwrap().put(format!("{dropped} dropped\n").as_bytes());
        let queue = QUEUE.get_or_init(|| LogQueue::start(reader, tell).unwrap());
        let line = vec![b'.'; 1024];
        queue.put(&line);
        ends.waits.recv().unwrap(); // the thread has taken that one, and takes no other before it is read
        let fit = WAITING_BYTES_MAX / line.len();
        (0..fit + 257).for_each(|_| queue.put(&line));
        assert!(!queue.flush(Duration::ZERO));
        drop(ends.may_read);
        assert!(queue.flush(Duration::MAX));
        let text = String::from_utf8(ends.lines.try_iter().flatten().collect()).unwrap();
        let (kept, told) = text.split_at(text.rfind('.').unwrap() + 1);
        assert_eq!((kept.len(), told), ((1 + fit) * line.len(), "257 dropped\n"));
    }

    #[test]
    fn a_line_that_is_too_long_is_told_and_the_next_ones_are_written() {
        static QUEUE: OnceLock<LogQueue> = OnceLock::new();
        let (reader, ends) = reader();
        drop(ends.may_read);
        let tell = |dropped| QUEUE.get().unwrap().put(format!("{dropped} dropped\n").as_bytes());
        let queue = QUEUE.get_or_init(|| LogQueue::start(reader, tell).unwrap());
        queue.put(&vec![b'.'; WAITING_BYTES_MAX + 1]);
        assert!(queue.flush(Duration::MAX));
        queue.put(b"and on\n");
        assert!(queue.flush(Duration::MAX));
        assert_eq!(ends.lines.try_iter().flatten().collect::<Vec<_>>(), b"1 dropped\nand on\n");
    }

    #[test]
    fn what_was_put_in_is_written_whole_and_in_order_before_the_end() {
        let (reader, ends) = reader();
        let queue = LogQueue::start(reader, |_| {}).unwrap();
        drop(ends.may_read);
        (0..1_000).for_each(|number| queue.put(format!("{number}\n").as_bytes()));
        assert!(queue.flush(Duration::MAX));
        let text = String::from_utf8(ends.lines.try_iter().flatten().collect()).unwrap();
        assert_eq!(text.lines().map(|line| line.parse::<u32>().unwrap()).collect::<Vec<_>>(), Vec::from_iter(0..1_000));
    }
}
