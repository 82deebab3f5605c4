//! Reads an MCAP file from its beginning, chunk by chunk, with bounded memory, as far as it is whole.
//!
//! The file may be hostile or cut off. Lengths are checked before memory is taken for them: no record, and no chunk before
//! or after decompression, may be larger than [`CHUNK_BYTES_MAX`]. A chunk is handed out only if its checksum holds.

use std::io::{self, Read};

use mcap::records::{ChunkHeader, Record as Parsed, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use thiserror::Error;

/// Largest record, and largest chunk before and after compression, in bytes. Our own have about one MiB.
pub const CHUNK_BYTES_MAX: usize = 32 << 20;

/// What every MCAP file begins with.
pub const MAGIC_BYTES: &[u8] = mcap::MAGIC;

/// Bytes asked of the file at once, at most.
const READ_BYTES_MAX: usize = 1 << 20;

/// Opcode and length before each record.
const HEAD_BYTES: usize = 1 + 8;

/// Why a file cannot be read on. Everything before was handed out.
#[derive(Debug, Error)]
pub enum ReadFault {
    /// The system's answer.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file ends before its end.
    #[error("the file was cut off: it was not closed, or is still being written")]
    Cut,
    /// It is not what it should be.
    #[error("{0}")]
    Format(#[from] mcap::McapError),
    /// A chunk's records do not fill it.
    #[error("a record of {wanted} bytes where its chunk has {left} left")]
    Record {
        /// What it claims.
        wanted: u64,
        /// What is there.
        left: usize,
    },
    /// A chunk would take too much memory.
    #[error("a chunk of {claimed} bytes, at most {CHUNK_BYTES_MAX} are read")]
    TooLarge {
        /// What it claims.
        claimed: u64,
    },
    /// A chunk is not as long as it says.
    #[error("a chunk has {found} bytes and says {claimed}")]
    Length {
        /// What came out.
        found: usize,
        /// What it claims.
        claimed: u64,
    },
    /// A chunk's content is damaged.
    #[error("a chunk's checksum is {found:08X}, expected {expected:08X}")]
    Checksum {
        /// Of what was read.
        found: u32,
        /// What the chunk says.
        expected: u32,
    },
    /// A compression that is not read here.
    #[error("a chunk is compressed as {0:?}, expected lz4 or none: `mcap compress --compression lz4` makes one of it")]
    Compression(String),
}

/// One record, by its number in the format (`mcap::records::op`).
#[derive(Debug)]
pub struct Record<'a> {
    /// Its kind.
    pub op: u8,
    /// Its content.
    pub body: &'a [u8],
}

/// The records of a file: those within chunks and those between, until the end of its data.
pub struct Chunks<R> {
    input: R,
    reader: LinearReader,
    /// The chunk that is being handed out, or a single record.
    content: Vec<u8>,
    at: usize,
    over: bool,
}

impl<R: Read> Chunks<R> {
    /// Reads from the beginning of a file, its magic bytes included.
    pub fn new(input: R) -> Self {
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_skip_end_magic(true)
            .with_record_length_limit(CHUNK_BYTES_MAX);
        let reader = LinearReader::new_with_options(options);
        Self { input, reader, content: Vec::new(), at: 0, over: false }
    }

    /// The next record; `None` after the last.
    ///
    /// # Errors
    /// [`ReadFault`]; then there is no more.
    pub fn next_record(&mut self) -> Result<Option<Record<'_>>, ReadFault> {
        while self.at >= self.content.len() {
            if self.over {
                return Ok(None);
            }
            if let Err(fault) = self.load() {
                self.over = true;
                self.content.clear();
                return Err(fault);
            }
        }
        match head(&self.content, self.at) {
            Ok((op, from, to)) => {
                self.at = to;
                Ok(Some(Record { op, body: &self.content[from..to] }))
            }
            Err(fault) => {
                self.over = true;
                self.content.clear();
                Err(fault)
            }
        }
    }

    /// Puts the records of the next chunk into `content`, or the next single record.
    fn load(&mut self) -> Result<(), ReadFault> {
        self.content.clear();
        self.at = 0;
        loop {
            let wanted = match self.reader.next_event() {
                // The file is over, within a record or between two.
                None | Some(Err(mcap::McapError::UnexpectedEof)) => return Err(ReadFault::Cut),
                Some(Err(error)) => return Err(error.into()),
                Some(Ok(LinearReadEvent::Record { opcode: op::DATA_END | op::FOOTER, .. })) => break,
                Some(Ok(LinearReadEvent::Record { opcode: op::CHUNK, data })) => {
                    return unpack(data, &mut self.content);
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    if matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA) {
                        self.content.push(opcode);
                        self.content.extend((data.len() as u64).to_le_bytes());
                        self.content.extend(data);
                        return Ok(());
                    }
                    continue;
                }
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => wanted.clamp(1, READ_BYTES_MAX),
            };
            let read = loop {
                match self.input.read(self.reader.insert(wanted)) {
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    result => break result?,
                }
            };
            self.reader.notify_read(read);
        }
        self.over = true;
        Ok(())
    }
}

/// Kind and place of the record at `at`.
fn head(content: &[u8], at: usize) -> Result<(u8, usize, usize), ReadFault> {
    let rest = &content[at..];
    let Some((&[op], length)) = rest.split_first_chunk::<1>() else {
        return Err(ReadFault::Record { wanted: HEAD_BYTES as u64, left: 0 });
    };
    let Some((length, body)) = length.split_first_chunk::<8>() else {
        return Err(ReadFault::Record { wanted: HEAD_BYTES as u64, left: rest.len() });
    };
    let wanted = u64::from_le_bytes(*length);
    match usize::try_from(wanted).ok().filter(|length| *length <= body.len()) {
        Some(length) => Ok((op, at + HEAD_BYTES, at + HEAD_BYTES + length)),
        None => Err(ReadFault::Record { wanted, left: body.len() }),
    }
}

/// So many characters of a compression's name are shown; a file may claim any.
const COMPRESSION_SHOWN: usize = 40;

/// The records of a chunk, once its length and its checksum are found right.
fn unpack(chunk: &[u8], content: &mut Vec<u8>) -> Result<(), ReadFault> {
    let Parsed::Chunk { header, data } = mcap::parse_record(op::CHUNK, chunk)? else { return Ok(()) };
    let ChunkHeader { uncompressed_size: claimed, uncompressed_crc: expected, compression, .. } = header;
    let Some(size) = usize::try_from(claimed).ok().filter(|size| *size <= CHUNK_BYTES_MAX) else {
        return Err(ReadFault::TooLarge { claimed });
    };
    match compression.as_str() {
        "" => content.extend_from_slice(data.get(..size).unwrap_or(&data)),
        // One byte more than it may have shows that it has more.
        "lz4" => drop(lz4::Decoder::new(&*data)?.take(claimed + 1).read_to_end(content)?),
        _ => return Err(ReadFault::Compression(compression.chars().take(COMPRESSION_SHOWN).collect())),
    }
    if content.len() != size {
        return Err(ReadFault::Length { found: content.len(), claimed });
    }
    let found = crc32fast::hash(content);
    if expected != 0 && found != expected {
        return Err(ReadFault::Checksum { found, expected });
    }
    Ok(())
}
