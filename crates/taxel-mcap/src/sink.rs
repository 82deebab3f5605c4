//! Where the bytes of a recording go: a file, or what a test puts in its place.

use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::MetadataExt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Device and inode of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity(u64, u64);

impl Identity {
    /// Of what the system tells of a file.
    #[must_use]
    pub fn of(about: &fs::Metadata) -> Self {
        Self(about.dev(), about.ino())
    }
}

/// A file that is written from its beginning to its end.
pub trait Sink: Write + Send {
    /// Waits until everything written is on the disk.
    ///
    /// # Errors
    /// The system's answer.
    fn sync(&mut self) -> io::Result<()>;

    /// Shortens it to so many bytes; one that is no longer than that stays as it is.
    ///
    /// # Errors
    /// The system's answer.
    fn cut(&mut self, bytes: u64) -> io::Result<()>;

    /// What tells it from all other files as long as it is open; none for what is no file.
    ///
    /// # Errors
    /// The system's answer.
    fn identity(&self) -> io::Result<Option<Identity>>;
}

impl Sink for File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }

    fn cut(&mut self, bytes: u64) -> io::Result<()> {
        if self.metadata()?.len() > bytes { self.set_len(bytes) } else { Ok(()) }
    }

    fn identity(&self) -> io::Result<Option<Identity>> {
        Ok(Some(Identity::of(&self.metadata()?)))
    }
}

/// A sink that counts, and whose flush goes down to the disk: the MCAP writer owns it and has no other way to ask for that.
pub(crate) struct Durable {
    pub(crate) sink: Box<dyn Sink>,
    pub(crate) written: Arc<AtomicU64>,
}

impl Write for Durable {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.sink.write(bytes)?;
        self.written.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()?;
        self.sink.sync()
    }
}
