//! One MCAP file, written so that each chunk can be read as soon as it is on the disk.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, WriteOptions, Writer};
use thiserror::Error;

use crate::schema::{PACKAGE, schema_of};

/// A chunk that is larger is closed before its time, in bytes before compression.
const CHUNK_BYTES: u64 = 1 << 20;

/// A stream of messages of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, for example `/taxeld/force/left_forearm`.
    pub name: String,
    /// The message of `taxel.v1` that it consists of, for example `ForceSample`.
    pub message: &'static str,
}

/// A file cannot be written.
#[derive(Debug, Error)]
pub enum McapFault {
    /// The system or the format says no.
    #[error(transparent)]
    Write(#[from] mcap::McapError),
    /// The system says no.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// There is no such message.
    #[error("there is no message taxel.v1.{0}")]
    NoMessage(&'static str),
    /// There is no such topic.
    #[error("there is no topic {0}: expected less than {1}")]
    NoTopic(usize, usize),
}

impl McapFault {
    /// The reason in words; the container's own error hides the system's.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::Write(mcap::McapError::Io(error)) => error.to_string(),
            other => other.to_string(),
        }
    }
}

/// A file that counts, and whose flush goes down to the disk: the MCAP writer owns it and has no other way to ask for that.
struct Durable {
    file: File,
    written: Arc<AtomicU64>,
}

impl Write for Durable {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.written.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.sync_data()
    }
}

/// A file that is being written.
pub struct McapFile {
    writer: Writer<NoSeek<Durable>>,
    /// A channel for each topic, and how many messages it has.
    channels: Vec<(u16, u32)>,
    written: Arc<AtomicU64>,
    pending: bool,
}

impl McapFile {
    /// Begins a file with these topics; `about` is kept in it as metadata under the name `taxeld`.
    ///
    /// # Errors
    /// [`McapFault`]
    pub fn begin(file: File, topics: &[Topic], about: BTreeMap<String, String>) -> Result<Self, McapFault> {
        let written = Arc::new(AtomicU64::new(0));
        let durable = Durable { file, written: Arc::clone(&written) };
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            // A chunk is put together in memory and written as a whole: a file that was cut off has no chunk of unknown length.
            .disable_seeking(true)
            .library(concat!("taxeld ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.create(NoSeek::new(durable))?;
        writer.write_metadata(&Metadata { name: "taxeld".to_owned(), metadata: about })?;
        let mut channels = Vec::with_capacity(topics.len());
        for topic in topics {
            let data = schema_of(topic.message).ok_or(McapFault::NoMessage(topic.message))?;
            let schema = writer.add_schema(&format!("{PACKAGE}.{}", topic.message), "protobuf", &data)?;
            channels.push((writer.add_channel(schema, &topic.name, "protobuf", &BTreeMap::new())?, 0));
        }
        let mut file = Self { writer, channels, written, pending: true };
        file.flush()?; // definitions are in the first chunk, so that every later one can be understood
        Ok(file)
    }

    /// Adds a message of a topic, by its position; `log_ns` are nanoseconds since 1970.
    ///
    /// # Errors
    /// [`McapFault`]
    pub fn write(&mut self, topic: usize, log_ns: u64, message: &[u8]) -> Result<(), McapFault> {
        let topics = self.channels.len();
        let (channel, messages) = self.channels.get_mut(topic).ok_or(McapFault::NoTopic(topic, topics))?;
        let header =
            MessageHeader { channel_id: *channel, sequence: *messages, log_time: log_ns, publish_time: log_ns };
        *messages = messages.wrapping_add(1);
        self.pending = true;
        Ok(self.writer.write_to_known_channel(&header, message)?)
    }

    /// Ends the present chunk, and waits until it is on the disk.
    ///
    /// # Errors
    /// [`McapFault`]
    pub fn flush(&mut self) -> Result<(), McapFault> {
        if self.pending {
            self.writer.flush()?;
            self.pending = false;
        }
        Ok(())
    }

    /// Bytes written, without those of the present chunk.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Ends the file with its summary, which lets readers jump to a time.
    ///
    /// # Errors
    /// [`McapFault`]
    pub fn finish(mut self) -> Result<(), McapFault> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner().flush()?)
    }

    /// Gives a file up that cannot be written on: its whole chunks can be read.
    pub fn give_up(self) {
        drop(self.writer.into_inner());
    }
}
