//! A CAN frame as all crates know it, independent of any socket library.

use std::fmt;

use taxel_skin::Time;

/// Standard (11 bit) or extended (29 bit) identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CanId {
    /// 11 bits, 0 to 0x7FF.
    Standard(u16),
    /// 29 bits, 0 to 0x1FFF_FFFF.
    Extended(u32),
}

impl fmt::Display for CanId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Standard(id) => write!(f, "{id:03X}"),
            Self::Extended(id) => write!(f, "{id:08X}"),
        }
    }
}

/// What a frame is, beside its identifier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FrameKind {
    /// Carries data.
    #[default]
    Data,
    /// Asks for data; `len` is the length asked for.
    Remote,
    /// Made by the kernel or the controller: the identifier holds the error class bits.
    Error,
    /// Carries data in the format of CAN FD.
    Fd,
}

/// Most bytes of a classic frame.
const CLASSIC_BYTES: usize = 8;
/// Most bytes of a CAN FD frame.
pub const FD_BYTES: usize = 64;

/// A CAN frame: up to eight bytes, or 64 in the format of CAN FD.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Frame {
    /// Identifier; for [`FrameKind::Error`] the class bits as an extended identifier.
    pub id: CanId,
    /// Data, remote or error, or data of CAN FD.
    pub kind: FrameKind,
    len: u8,
    data: [u8; FD_BYTES],
}

impl Frame {
    /// A data frame; `None` if there are more than eight bytes.
    #[must_use]
    pub fn data(id: CanId, bytes: &[u8]) -> Option<Self> {
        Self::new(id, FrameKind::Data, bytes)
    }

    /// A data frame of CAN FD; `None` if there are more than 64 bytes. Lengths that no bus carries are taken as they are,
    /// as virtual buses do.
    #[must_use]
    pub fn fd(id: CanId, bytes: &[u8]) -> Option<Self> {
        Self::new(id, FrameKind::Fd, bytes)
    }

    /// A frame of any kind; `None` if there are more than eight bytes, or 64 for CAN FD.
    ///
    /// Of a remote frame's bytes only the number is kept, because only the length asked for travels on the bus.
    #[must_use]
    pub fn new(id: CanId, kind: FrameKind, bytes: &[u8]) -> Option<Self> {
        let most = if kind == FrameKind::Fd { FD_BYTES } else { CLASSIC_BYTES };
        let mut data = [0; FD_BYTES];
        data.get_mut(..bytes.len()).filter(|to| to.len() <= most)?.copy_from_slice(bytes);
        if kind == FrameKind::Remote {
            data = [0; FD_BYTES];
        }
        Some(Self { id, kind, len: bytes.len() as u8, data })
    }

    /// A data frame of a length that the compiler checks: more than eight bytes do not build.
    #[must_use]
    pub const fn of<const N: usize>(id: CanId, bytes: [u8; N]) -> Self {
        const { assert!(N <= CLASSIC_BYTES, "a classic CAN frame holds at most eight bytes") };
        let mut data = [0; FD_BYTES];
        let mut i = 0;
        while i < N {
            data[i] = bytes[i];
            i += 1;
        }
        Self { id, kind: FrameKind::Data, len: N as u8, data }
    }

    /// The frame's bytes, at most eight, or 64 of CAN FD.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }
}

/// A frame and when the kernel received it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedFrame {
    /// Receive time on the run's clock.
    pub time: Time,
    /// The frame.
    pub frame: Frame,
}
