//! Where the bytes of a recording go: a file, or what a test puts in its place.

use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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

    /// Whether it is a file, which somebody may remove or cut short.
    fn is_file(&self) -> bool;
}

impl Sink for File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }

    fn cut(&mut self, bytes: u64) -> io::Result<()> {
        if self.metadata()?.len() > bytes { self.set_len(bytes) } else { Ok(()) }
    }

    fn is_file(&self) -> bool {
        true
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
