//! The carrier "tcp" as far as commands need it, and the binary form of lists ("The YARP protocol", "Standard data
//! representation format").

use std::io;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

use crate::value::Value;

/// Of every binary greeting: `YA`.
pub(crate) const FIRST_BYTE: u8 = b'Y';
/// A command is short.
const BYTES_MAX: usize = 16 * 1024;
const NAME_BYTES_MAX: usize = 256;
const BLOCKS_MAX: usize = 64;
/// Lists in lists.
const DEPTH_MAX: usize = 16;

/// Codes of types.
const INT8: i32 = 32;
const INT16: i32 = 64;
const INT32: i32 = 1;
const INT64: i32 = 17;
const VOCAB: i32 = 9;
const FLOAT64: i32 = 10;
const TEXT: i32 = 4;
const LIST: i32 = 256;

/// What a message to a port is.
#[derive(Debug, PartialEq)]
pub(crate) enum Command {
    /// A word: `*`, `/reader`.
    Word(String),
    /// An administrative message.
    Admin(Vec<Value>),
    /// Data for the port's owner.
    Data,
}

/// Answers a greeting; gives whether the other side waits for acknowledgements.
pub(crate) async fn greet(stream: &mut (impl AsyncRead + AsyncWrite + Unpin)) -> io::Result<bool> {
    let mut specifier = [0; 8];
    stream.read_exact(&mut specifier).await?;
    let acknowledges = match specifier {
        [b'Y', b'A', 0xE4, 0x1E, 0, 0, b'R', b'P'] => true,
        [b'Y', b'A', 0x64, 0x1E, 0, 0, b'R', b'P'] => false,
        _ => return Err(invalid("a carrier that is neither tcp nor text")),
    };
    let length = stream.read_u32_le().await? as usize;
    if length > NAME_BYTES_MAX {
        return Err(invalid("a name of more than 256 bytes"));
    }
    let mut name = vec![0; length];
    stream.read_exact(&mut name).await?;
    stream.write_all(&number(0)).await?;
    Ok(acknowledges)
}

/// Reads a message; nothing where the connection ends before one.
pub(crate) async fn read_command(stream: &mut (impl AsyncRead + Unpin)) -> io::Result<Option<Command>> {
    let mut header = [0; 8];
    match stream.read_exact(&mut header).await {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        other => other.map(drop)?,
    }
    let mut index = [0; 10];
    if header != number(10) {
        return Err(invalid("an index of another length"));
    }
    stream.read_exact(&mut index).await?;
    let (blocks, replies) = (usize::from(index[0]), usize::from(index[1]));
    if blocks > BLOCKS_MAX || replies > BLOCKS_MAX {
        return Err(invalid("too many blocks"));
    }
    let mut bytes = 0_usize;
    for _ in 0..blocks {
        bytes = bytes.saturating_add(stream.read_u32_le().await? as usize);
    }
    for _ in 0..replies {
        stream.read_u32_le().await?;
    }
    if bytes > BYTES_MAX {
        return Err(invalid("a command of more than 16 KiB"));
    }
    let mut content = vec![0; bytes];
    stream.read_exact(&mut content).await?;
    command(&content).map(Some).ok_or_else(|| invalid("no command"))
}

/// Four bytes, `~`, a letter, 0, 1; then the word or the message.
fn command(content: &[u8]) -> Option<Command> {
    let (header, rest) = content.split_at_checked(8)?;
    match (header[4], header[5]) {
        (b'~', 0) => {
            let end = rest.iter().position(|&byte| byte == 0).unwrap_or(rest.len());
            Some(Command::Word(String::from_utf8_lossy(&rest[..end]).into_owned()))
        }
        (b'~', b'a') => message(rest).map(Command::Admin),
        (b'~', b'd') => Some(Command::Data),
        (b'~', letter) => Some(Command::Word(char::from(letter).to_string())),
        _ => None,
    }
}

/// An answer, and what acknowledges the message behind it, as YARP's own ports send them.
pub(crate) fn reply(answer: &[u8]) -> Vec<u8> {
    [answer, &number(0)].concat()
}

fn number(number: u32) -> [u8; 8] {
    let [a, b, c, d] = number.to_le_bytes();
    [b'Y', b'A', a, b, c, d, b'R', b'P']
}

/// A list that may hold anything, in bytes.
pub(crate) fn list(elements: &[Value]) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend_from_slice(&LIST.to_le_bytes());
    append_elements(elements, &mut bytes);
    bytes
}

fn append_elements(elements: &[Value], bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(&(elements.len() as u32).to_le_bytes());
    for element in elements {
        match element {
            Value::Int(number) => {
                bytes.extend_from_slice(&INT32.to_le_bytes());
                bytes.extend_from_slice(&(*number as i32).to_le_bytes());
            }
            Value::Float(number) => {
                bytes.extend_from_slice(&FLOAT64.to_le_bytes());
                bytes.extend_from_slice(&number.to_le_bytes());
            }
            Value::Text(text) => {
                bytes.extend_from_slice(&TEXT.to_le_bytes());
                bytes.extend_from_slice(&(text.len() as u32).to_le_bytes());
                bytes.extend_from_slice(text.as_bytes());
            }
            Value::List(inner) => {
                bytes.extend_from_slice(&LIST.to_le_bytes());
                append_elements(inner, bytes);
            }
        }
    }
}

/// The elements of a list in bytes; nothing if they make no sense.
fn message(mut bytes: &[u8]) -> Option<Vec<Value>> {
    let code = take_i32(&mut bytes)?;
    elements(code, &mut bytes, 0)
}

fn elements(code: i32, bytes: &mut &[u8], depth: usize) -> Option<Vec<Value>> {
    if code & LIST == 0 || depth > DEPTH_MAX {
        return None;
    }
    let length = take_i32(bytes).and_then(|length| usize::try_from(length).ok())?;
    let mut list = Vec::new();
    for _ in 0..length {
        let code = if code == LIST { take_i32(bytes)? } else { code - LIST };
        list.push(element(code, bytes, depth)?);
    }
    Some(list)
}

fn element(code: i32, bytes: &mut &[u8], depth: usize) -> Option<Value> {
    Some(match code {
        INT8 => Value::Int(i64::from(take::<1>(bytes)?[0] as i8)),
        INT16 => Value::Int(i64::from(i16::from_le_bytes(take(bytes)?))),
        INT32 => Value::Int(i64::from(take_i32(bytes)?)),
        INT64 => Value::Int(i64::from_le_bytes(take(bytes)?)),
        FLOAT64 => Value::Float(f64::from_le_bytes(take(bytes)?)),
        VOCAB => {
            let letters = take::<4>(bytes)?;
            Value::Text(letters.iter().take_while(|&&letter| letter != 0).map(|&letter| char::from(letter)).collect())
        }
        TEXT => {
            let length = take_i32(bytes).and_then(|length| usize::try_from(length).ok())?;
            let (text, rest) = bytes.split_at_checked(length)?;
            *bytes = rest;
            Value::Text(String::from_utf8_lossy(text).trim_end_matches('\0').to_owned())
        }
        list if list & LIST != 0 => Value::List(elements(list, bytes, depth + 1)?),
        _ => return None,
    })
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*first)
}

fn take_i32(bytes: &mut &[u8]) -> Option<i32> {
    take(bytes).map(i32::from_le_bytes)
}

fn invalid(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The two examples of the document, of which strings have another code for their end there.
    #[test]
    fn lists_are_read_as_the_document_has_them() {
        let words = |numbers: &[i32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let primes = words(&[257, 8, 2, 3, 5, 7, 11, 13, 17, 19]);
        assert_eq!(message(&primes), Some([2, 3, 5, 7, 11, 13, 17, 19].map(Value::Int).to_vec()));
        let mut mixed = words(&[256, 2, 257, 3, 91, 92, 93, 260, 2, 5]);
        mixed.extend_from_slice(b"this\0");
        mixed.extend_from_slice(&words(&[3]));
        mixed.extend_from_slice(b"is\0");
        let text = |text: &str| Value::Text(text.to_owned());
        let lists = [Value::List([91, 92, 93].map(Value::Int).to_vec()), Value::List(vec![text("this"), text("is")])];
        assert_eq!(message(&mixed), Some(lists.to_vec()));
    }

    #[test]
    fn a_command_is_a_word_or_a_message() {
        let header = |letter: u8| [0, 0, 0, 0, b'~', letter, 0, 1];
        let content = |letter, rest: &[u8]| [header(letter).as_slice(), rest].concat();
        assert_eq!(command(&content(0, b"/reader\0")), Some(Command::Word("/reader".into())));
        assert_eq!(command(&content(b'*', b"")), Some(Command::Word("*".into())));
        let list = vec![Value::Text("list".into()), Value::Text("out".into()), Value::Float(0.5)];
        assert_eq!(command(&content(b'a', &super::list(&list))), Some(Command::Admin(list)));
        assert_eq!(command(b"short"), None);
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_message_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = message(&bytes);
            let _ = command(&bytes);
        }
    }
}
