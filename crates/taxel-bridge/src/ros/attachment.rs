//! What `rmw_zenoh` attaches to each message: a number, a time, and the id of who sent it. A message without it is
//! dropped by ROS. The layout is that since `rmw_zenoh` 0.2.4 (jazzy) and 0.1.2 (humble).

use xxhash_rust::xxh3::xxh3_128;

/// Bytes of an attachment.
pub const BYTES: usize = 33;
/// The length of the id, which stands before it.
const GID_BYTES: u8 = 16;

/// Who sent a message: the hash of the liveliness token of its publisher, service or client.
pub type Gid = [u8; 16];

/// The id that goes with a liveliness token: XXH3 with 128 bits, the low half first.
pub fn gid(token: &str) -> Gid {
    xxh3_128(token.as_bytes()).to_le_bytes()
}

/// What is attached to a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// One more with each message of a publisher, from 1. An answer has that of its request.
    pub sequence: i64,
    /// When it was sent, in ns since 1970.
    pub time_ns: i64,
    /// Who sent it. An answer has that of its request.
    pub gid: Gid,
}

/// An attachment that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadAttachment {
    /// It has another length.
    #[error("an attachment of {0} bytes, expected {BYTES}: rmw_zenoh older than 0.2.4 (jazzy) or 0.1.2 (humble)?")]
    Length(usize),
    /// It does not say that an id of 16 bytes follows.
    #[error("an attachment whose byte 16 is {0}, expected {GID_BYTES}, the length of the id")]
    GidLength(u8),
}

impl Attachment {
    /// Its bytes.
    pub fn encode(&self) -> [u8; BYTES] {
        let mut bytes = [0; BYTES];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.time_ns.to_le_bytes());
        bytes[16] = GID_BYTES;
        bytes[17..].copy_from_slice(&self.gid);
        bytes
    }

    /// What such bytes mean.
    ///
    /// # Errors
    /// If they are no attachment of this layout.
    pub fn decode(bytes: &[u8]) -> Result<Self, BadAttachment> {
        let bytes: &[u8; BYTES] = bytes.try_into().map_err(|_| BadAttachment::Length(bytes.len()))?;
        if bytes[16] != GID_BYTES {
            return Err(BadAttachment::GidLength(bytes[16]));
        }
        let (mut sequence, mut time_ns, mut gid) = ([0; 8], [0; 8], [0; 16]);
        sequence.copy_from_slice(&bytes[..8]);
        time_ns.copy_from_slice(&bytes[8..16]);
        gid.copy_from_slice(&bytes[17..]);
        Ok(Self { sequence: i64::from_le_bytes(sequence), time_ns: i64::from_le_bytes(time_ns), gid })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_id_is_the_hash_that_rmw_zenoh_makes() {
        let id = gid("@ros2_lv/0/1234567890abcdef1234567890abcdef/0/0/NN/%/%/taxeld");
        let text: String = id.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(text, "5740dabfe9fff14bb838a6884302e9b0");
    }

    #[test]
    fn what_is_no_attachment_is_refused_with_what_is_wrong() {
        assert_eq!(Attachment::decode(&[0; 32]), Err(BadAttachment::Length(32)));
        assert_eq!(Attachment::decode(&[]), Err(BadAttachment::Length(0)));
        assert_eq!(Attachment::decode(&[3; BYTES]), Err(BadAttachment::GidLength(3)));
    }

    proptest! {
        #[test]
        fn an_attachment_comes_back_as_it_was(sequence: i64, time_ns: i64, gid: Gid) {
            let attachment = Attachment { sequence, time_ns, gid };
            prop_assert_eq!(Attachment::decode(&attachment.encode()), Ok(attachment));
        }
    }
}
