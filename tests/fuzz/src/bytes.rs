//! Frames out of any bytes.

use taxel_wire::{CanId, FD_BYTES, Frame, FrameKind};

/// Bytes that are taken from the front.
pub struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    pub const fn new(data: &'a [u8]) -> Self {
        Self(data)
    }

    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The next bytes, zeros behind the end.
    pub fn array<const N: usize>(&mut self) -> [u8; N] {
        let mut array = [0; N];
        let taken = self.take(N);
        array[..taken.len()].copy_from_slice(taken);
        array
    }

    pub fn byte(&mut self) -> u8 {
        self.array::<1>()[0]
    }

    /// At most so many.
    pub fn take(&mut self, most: usize) -> &'a [u8] {
        let (taken, rest) = self.0.split_at(most.min(self.0.len()));
        self.0 = rest;
        taken
    }

    /// An identifier, also one with more bits than a bus carries.
    pub fn id(&mut self, extended: bool) -> CanId {
        if extended {
            CanId::Extended(u32::from_le_bytes(self.array()))
        } else {
            CanId::Standard(u16::from_le_bytes(self.array()))
        }
    }

    /// A frame: a byte of kind and identifier's length, the identifier, a length and so many bytes. `None` if no frame has
    /// so many.
    pub fn frame(&mut self) -> Option<Frame> {
        let head = self.byte();
        let kind = [FrameKind::Data, FrameKind::Fd, FrameKind::Remote, FrameKind::Error][usize::from(head & 3)];
        let id = self.id(head & 4 != 0);
        let length = usize::from(self.byte());
        let content = self.take(length);
        let frame = Frame::new(id, kind, content);
        let most = if kind == FrameKind::Fd { FD_BYTES } else { 8 };
        assert_eq!(frame.is_some(), content.len() <= most, "{kind:?} of {} bytes", content.len());
        frame
    }
}
