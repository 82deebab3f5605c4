//! The messages of frames in one MCAP file, with bounded memory, as far as the file is whole.
//!
//! The file may be hostile or cut off. No record, and no chunk before or after decompression, may be larger than
//! [`CHUNK_BYTES_MAX`], and a chunk with a checksum is read only if that holds.

use std::collections::HashSet;
use std::io::{self, Read};

use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use prost::Message as _;
use taxel_proto::v1::CanFrames;
use thiserror::Error;

use crate::file::{ABOUT, BOOT};
use crate::schema::PACKAGE;

/// Largest record, and largest chunk before and after compression, in bytes. Our own have about one MiB.
pub(crate) const CHUNK_BYTES_MAX: usize = 32 << 20;

/// Largest message of frames that is decoded, in bytes: decoded it may take fifty times as much. Our own have a few
/// kilobytes.
const MESSAGE_BYTES_MAX: usize = 256 * 1024;

/// Bytes asked of the file at once, at most.
const READ_BYTES_MAX: usize = 1 << 20;

/// What is longer names no start of a computer; ours have 32 characters.
const BOOT_BYTES_MAX: usize = 64;

/// Why a file cannot be read on. Everything before was handed out.
#[derive(Debug, Error)]
pub(crate) enum ReadFault {
    /// The system's answer.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file ends before its end.
    #[error("the file was cut off: it was not closed, or is still being written")]
    Cut,
    /// It is not what it should be.
    #[error("{0}")]
    Format(McapError),
}

impl From<McapError> for ReadFault {
    fn from(error: McapError) -> Self {
        match error {
            McapError::UnexpectedEof => Self::Cut,
            other => Self::Format(other),
        }
    }
}

/// What was found in a file.
pub(crate) enum Found {
    /// Frames of a bus.
    Frames(CanFrames),
    /// What follows was recorded since this start of the computer.
    Boot(String),
    /// A message that is none.
    Bad,
}

/// The messages of frames in one file.
pub(crate) struct Messages {
    input: Box<dyn Read + Send>,
    reader: LinearReader,
    kinds: Kinds,
}

impl Messages {
    /// Reads from the beginning of a file, its magic bytes included.
    pub fn new(input: Box<dyn Read + Send>) -> Self {
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_skip_end_magic(true)
            .with_record_length_limit(CHUNK_BYTES_MAX);
        Self { input, reader: LinearReader::new_with_options(options), kinds: Kinds::default() }
    }

    /// What comes next; `None` at the end.
    ///
    /// # Errors
    /// [`ReadFault`]; nothing comes after it.
    pub fn next(&mut self) -> Result<Option<Found>, ReadFault> {
        loop {
            match self.reader.next_event().ok_or(ReadFault::Cut)?? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let read = self.input.read(self.reader.insert(wanted.clamp(1, READ_BYTES_MAX)));
                    match read {
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        read => self.reader.notify_read(read?),
                    }
                }
                LinearReadEvent::Record { opcode: op::DATA_END | op::FOOTER, .. } => return Ok(None),
                LinearReadEvent::Record { opcode, data } => {
                    if let Some(found) = self.kinds.look(opcode, data)? {
                        return Ok(Some(found));
                    }
                }
            }
        }
    }
}

/// Which records are frames. Of what a file defines only small numbers are kept.
#[derive(Default)]
struct Kinds {
    schemas: HashSet<u16>,
    channels: HashSet<u16>,
}

impl Kinds {
    fn look(&mut self, opcode: u8, data: &[u8]) -> Result<Option<Found>, McapError> {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA) {
            return Ok(None);
        }
        match mcap::parse_record(opcode, data)? {
            Record::Metadata(mut about) if about.name == ABOUT => {
                let boot = about.metadata.remove(BOOT).filter(|boot| boot.len() <= BOOT_BYTES_MAX);
                return Ok(boot.map(Found::Boot));
            }
            Record::Schema { header, .. } if is_frames(&header.name, &header.encoding) => {
                self.schemas.insert(header.id);
            }
            Record::Channel(channel) if self.schemas.contains(&channel.schema_id) => {
                self.channels.insert(channel.id);
            }
            Record::Message { header, data } if self.channels.contains(&header.channel_id) => {
                if data.len() > MESSAGE_BYTES_MAX {
                    return Ok(Some(Found::Bad));
                }
                return Ok(Some(CanFrames::decode(&*data).map_or(Found::Bad, Found::Frames)));
            }
            _ => {}
        }
        Ok(None)
    }
}

fn is_frames(name: &str, encoding: &str) -> bool {
    encoding == "protobuf" && name.strip_prefix(PACKAGE) == Some(".CanFrames")
}
