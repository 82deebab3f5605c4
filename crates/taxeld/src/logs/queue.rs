//! Lines of the log on their way to whoever reads them. A thread of its own writes, so that nobody who logs waits for a reader
//! that stands still, such as a journal that was stopped or a pipe that nobody empties. What does not get there is counted.

use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::lines::Lines;

/// So much may wait: some thousand lines, as a start and an hour of faults make.
const WAITING_BYTES_MAX: usize = 256 * 1024;

/// Lines that are not in the log, by what kept them from it.
#[derive(Debug, Default)]
pub struct Lost {
    /// Those for which there was no room, since nobody read what waited.
    unread: u64,
    /// Those that are longer than all that may wait.
    too_long: u64,
    /// Those that could not be written, and why the last of them.
    unwritten: Option<(u64, io::Error)>,
}

impl Lost {
    fn is_none(&self) -> bool {
        self.unread == 0 && self.too_long == 0 && self.unwritten.is_none()
    }

    /// What to say of them, a line for each reason.
    pub fn words(&self) -> Vec<String> {
        let unread = (self.unread, "nobody read them".to_owned());
        let too_long = (self.too_long, format!("each had more than {WAITING_BYTES_MAX} bytes"));
        let unwritten = self.unwritten.iter().map(|(lines, why)| (*lines, format!("they could not be written: {why}")));
        let reasons = [unread, too_long].into_iter().chain(unwritten).filter(|(lines, _)| *lines > 0);
        reasons.map(|(lines, why)| format!("{lines} lines of the log were dropped, since {why}")).collect()
    }
}

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
    /// What was left out since it was told last.
    lost: Lost,
    /// The thread has taken something and is not done with it.
    writing: bool,
}

impl State {
    /// Whether there is nothing to write or to tell.
    fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.lost.is_none()
    }
}

impl LogQueue {
    /// Starts the thread, which writes to `to`. Once something is written again after lines were lost, it calls `tell_lost`,
    /// so that a line about them follows those before them.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn start(to: impl Write + Send + 'static, tell_lost: fn(&Lost)) -> io::Result<Self> {
        let queue = Self(Arc::default());
        let shared = Arc::clone(&queue.0);
        std::thread::Builder::new()
            .name("log".to_owned())
            .spawn(move || shared.write_all_to(Lines::new(to), tell_lost))?;
        Ok(queue)
    }

    /// Takes a line, or counts it as lost. Once there was no room for one there is none for any, until the thread has taken
    /// those that wait: none is missing among those that are written.
    pub fn put(&self, line: &[u8]) {
        let mut state = self.0.lock();
        if line.len() > WAITING_BYTES_MAX {
            state.lost.too_long += 1;
        } else if state.lost.unread > 0 || state.waiting.len() + line.len() > WAITING_BYTES_MAX {
            state.lost.unread += 1;
        } else {
            state.waiting.extend_from_slice(line);
        }
        drop(state);
        self.0.changed.notify_all();
    }

    /// Waits until all is written, at most so long. Whether it is.
    pub fn flush(&self, within: Duration) -> bool {
        let left = |state: &mut State| state.writing || !state.is_idle();
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

    fn write_all_to(&self, mut out: Lines<impl Write>, tell_lost: fn(&Lost)) {
        loop {
            let (lines, lost) = self.take();
            if !lost.is_none() {
                tell_lost(&lost); // into this queue, of which room was just made
            }
            self.lock().lost.unwritten = out.write(&lines);
        }
    }

    /// Waits for something to write and takes it, with what was lost after it.
    fn take(&self) -> (Vec<u8>, Lost) {
        let mut state = self.lock();
        state.writing = false;
        self.changed.notify_all();
        state = self.changed.wait_while(state, |state| state.is_idle()).unwrap_or_else(PoisonError::into_inner);
        state.writing = true;
        (std::mem::take(&mut state.waiting), std::mem::take(&mut state.lost))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicBool, Ordering};
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

    fn told(lost: &Lost) -> String {
        lost.words().iter().map(|words| format!("{words}\n")).collect()
    }

    #[test]
    fn whoever_logs_does_not_wait_and_what_did_not_fit_is_told_in_its_place() {
        static QUEUE: OnceLock<LogQueue> = OnceLock::new();
        let (reader, ends) = reader();
        let tell = |lost: &Lost| QUEUE.get().unwrap().put(told(lost).as_bytes());
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
        assert_eq!(
            (kept.len(), told),
            ((1 + fit) * line.len(), "257 lines of the log were dropped, since nobody read them\n")
        );
    }

    #[test]
    fn a_line_that_is_too_long_is_told_and_the_next_ones_are_written() {
        static QUEUE: OnceLock<LogQueue> = OnceLock::new();
        let (reader, ends) = reader();
        drop(ends.may_read);
        let tell = |lost: &Lost| QUEUE.get().unwrap().put(told(lost).as_bytes());
        let queue = QUEUE.get_or_init(|| LogQueue::start(reader, tell).unwrap());
        queue.put(&vec![b'.'; WAITING_BYTES_MAX + 1]);
        assert!(queue.flush(Duration::MAX));
        queue.put(b"and on\n");
        assert!(queue.flush(Duration::MAX));
        let text = String::from_utf8(ends.lines.try_iter().flatten().collect()).unwrap();
        let told = "1 lines of the log were dropped, since each had more than 262144 bytes";
        assert_eq!(text, format!("{told}\nand on\n"));
    }

    /// A disk that has no room until it is given some.
    struct Disk(Sender<Vec<u8>>);

    static ROOM: AtomicBool = AtomicBool::new(false);

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if !ROOM.load(Ordering::SeqCst) {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let _ = self.0.send(bytes.to_vec());
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_could_not_be_written_is_told_once_something_is() {
        static QUEUE: OnceLock<LogQueue> = OnceLock::new();
        let (got, written) = channel();
        let tell = |lost: &Lost| QUEUE.get().unwrap().put(told(lost).as_bytes());
        let queue = QUEUE.get_or_init(|| LogQueue::start(Disk(got), tell).unwrap());
        queue.put(b"one\ntwo\n");
        assert!(queue.flush(Duration::MAX));
        ROOM.store(true, Ordering::SeqCst);
        queue.put(b"and on\n");
        assert!(queue.flush(Duration::MAX));
        let text = String::from_utf8(written.try_iter().flatten().collect()).unwrap();
        let told = "2 lines of the log were dropped, since they could not be written: no storage space";
        assert_eq!(text, format!("and on\n{told}\n"));
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
