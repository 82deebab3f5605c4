//! Lines that are written to whatever standard error is: none is lost because there was no room for a moment, and what cannot be
//! written is counted.

use std::io::{self, Write};
use std::os::fd::AsFd;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

/// A way that waits for room. Another process may have made it one that does not wait (`O_NONBLOCK`): whoever shares a terminal
/// or a pipe shares that, too.
pub struct Waiting<W>(pub W);

impl<W: Write + AsFd> Write for Waiting<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        loop {
            match self.0.write(bytes) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => self.wait()?,
                done => return done,
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl<W: AsFd> Waiting<W> {
    fn wait(&self) -> io::Result<()> {
        match poll(&mut [PollFd::new(self.0.as_fd(), PollFlags::POLLOUT)], PollTimeout::NONE) {
            Ok(_) | Err(Errno::EINTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

/// Writes lines, and knows how many could not be written.
pub struct Lines<W> {
    to: W,
    /// The last line was written in part.
    torn: bool,
    /// How many could not be written, and why the last of them.
    unwritten: Option<(u64, io::Error)>,
}

impl<W: Write> Lines<W> {
    /// Lines on their way to `to`.
    pub fn new(to: W) -> Self {
        Self { to, torn: false, unwritten: None }
    }

    /// Writes these lines. If that goes well: how many could not be written since it last did, and why.
    pub fn write(&mut self, lines: &[u8]) -> Option<(u64, io::Error)> {
        match self.write_on(lines) {
            Ok(()) => self.unwritten.take(),
            Err((left, error)) => {
                let before = self.unwritten.take().map_or(0, |(before, _)| before);
                let more = left.iter().filter(|byte| **byte == b'\n').count() as u64;
                self.unwritten = Some((before + more, error));
                None
            }
        }
    }

    /// What is left of the lines, and why, if not all could be written.
    fn write_on<'a>(&mut self, lines: &'a [u8]) -> Result<(), (&'a [u8], io::Error)> {
        if self.torn {
            self.to.write_all(b"\n").map_err(|error| (lines, error))?;
            self.torn = false;
        }
        let mut left = lines;
        while !left.is_empty() {
            match self.to.write(left) {
                Ok(written) if written > 0 => left = &left[written..],
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                refused => {
                    self.torn = lines[..lines.len() - left.len()].last().is_some_and(|byte| *byte != b'\n');
                    return Err((left, refused.err().unwrap_or(io::ErrorKind::WriteZero.into())));
                }
            }
        }
        self.to.flush().map_err(|error| (left, error))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;
    use std::os::unix::net::UnixStream;
    use std::time::Duration;

    use super::*;

    #[test]
    fn where_there_is_no_room_for_a_moment_it_is_waited_for() {
        let (mut reader, writer) = UnixStream::pair().unwrap();
        reader.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        writer.set_nonblocking(true).unwrap();
        let filler = [b'.'; 4096];
        let mut before = 0;
        while let Ok(written) = (&writer).write(&filler) {
            before += written;
        }
        let mut lines = Lines::new(Waiting(writer));
        let writing = std::thread::spawn(move || lines.write(b"a line\n").is_none());
        let mut read = vec![0; before + 7];
        reader.read_exact(&mut read).unwrap();
        assert!(writing.join().unwrap() && read.ends_with(b".a line\n"));
    }

    /// A disk of so much room.
    struct Disk(Vec<u8>, usize);

    impl Write for &mut Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let some = bytes.len().min(self.1 - self.0.len());
            self.0.extend(&bytes[..some]);
            if some == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(some) }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_that_could_not_be_written_are_counted_and_told_once_and_the_next_begins_anew() {
        let mut disk = Disk(Vec::new(), 6);
        let mut lines = Lines::new(&mut disk);
        assert!(lines.write(b"one\ntwo\nthree\n").is_none());
        assert!(lines.write(b"four\n").is_none());
        lines.to.1 = 100;
        let (unwritten, why) = lines.write(b"five\n").unwrap();
        assert_eq!((unwritten, why.kind()), (3, io::ErrorKind::StorageFull));
        assert!(lines.write(b"six\n").is_none());
        assert_eq!(disk.0, b"one\ntw\nfive\nsix\n");
    }
}
