//! Messages on their way through gRPC: each has five bytes before it, whether it is compressed and how long it is.

use hyper::body::{Buf, Bytes};
use prost::Message;
use prost::bytes::{BufMut, BytesMut};
use prost_reflect::{DynamicMessage, MessageDescriptor};
use taxel_proto::refusal::Refusal;
use tonic::Status;

/// Whether it is compressed (it never is: nobody here asks for it), and its length in 32 bits.
const HEAD_BYTES: usize = 5;

/// No message of the daemon is longer; its own limit is 16 MiB.
const MESSAGE_BYTES_MAX: usize = 32 << 20;

/// One message as the body of a request.
pub(crate) fn framed(message: &DynamicMessage) -> Bytes {
    let length = message.encoded_len();
    let mut bytes = BytesMut::with_capacity(HEAD_BYTES + length);
    bytes.put_u8(0);
    bytes.put_u32(length as u32); // a request was bounded long before it could be longer
    bytes.put_slice(&message.encode_to_vec());
    bytes.freeze()
}

/// What has come of an answer and was not yet made into messages.
#[derive(Debug, Default)]
pub(crate) struct Unframed {
    bytes: BytesMut,
}

impl Unframed {
    /// More has come.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        self.bytes.put_slice(bytes);
    }

    /// The next message, if it has come whole.
    pub(crate) fn next(&mut self, of: &MessageDescriptor) -> Result<Option<DynamicMessage>, Status> {
        let Some((head, _)) = self.bytes.split_at_checked(HEAD_BYTES) else { return Ok(None) };
        let (compressed, mut length) = (head[0] != 0, &head[1..]);
        let length = length.get_u32() as usize;
        if compressed || length > MESSAGE_BYTES_MAX {
            return Err(Refusal::fault(format!("an answer of {length} bytes, compressed: {compressed}")).into());
        }
        if self.bytes.len() < HEAD_BYTES + length {
            return Ok(None);
        }
        self.bytes.advance(HEAD_BYTES);
        let message = DynamicMessage::decode(of.clone(), self.bytes.split_to(length));
        Ok(message
            .map(Some)
            .map_err(|error| Refusal::fault(format!("an answer is not {}: {error}", of.full_name())))?)
    }
}
