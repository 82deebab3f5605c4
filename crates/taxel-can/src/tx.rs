//! The sending socket of one interface.

use std::io;
use std::os::fd::AsRawFd;

use nix::sys::socket::{MsgFlags, send};
use socketcan::{CanSocket, SocketOptions};

use crate::rx::{Failure, bind, failed, raw_socket};
use crate::sys::FRAME_BYTES;

/// An open socket that only sends: its filter lets nothing in, so nothing piles up unread.
pub(crate) struct Tx {
    socket: CanSocket,
}

impl Tx {
    pub fn open(index: u32) -> Result<Self, Failure> {
        let socket = raw_socket()?;
        socket.set_filter_drop_all().map_err(failed("setsockopt(CAN_RAW_FILTER)"))?;
        bind(&socket, index)?;
        Ok(Self { socket })
    }

    /// Queues one frame, or says at once why not.
    pub fn send(&self, bytes: &[u8; FRAME_BYTES]) -> io::Result<()> {
        let sent = send(self.socket.as_raw_fd(), bytes, MsgFlags::MSG_DONTWAIT)?;
        // The kernel takes a whole frame or none.
        if sent == FRAME_BYTES { Ok(()) } else { Err(io::ErrorKind::WriteZero.into()) }
    }
}
