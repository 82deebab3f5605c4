//! The receiving socket of one interface: opened, filtered, read in batches, its losses counted.

use std::io;
use std::os::fd::{BorrowedFd, OwnedFd};

use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockProtocol, SockType, setsockopt, socket, sockopt};
use socketcan::{CanAddr, CanSocket, Socket, SocketOptions};
use taxel_skin::Time;
use taxel_wire::{CanId, Frame, FrameKind, TimedFrame};
use tokio::io::unix::AsyncFd;

use crate::can_error;
use crate::clock::ClockReading;
use crate::filter::Filter;
use crate::source::{Batch, BusEvent};
use crate::sys::{self, FD_FRAME_BYTES, FRAME_BYTES, Received, Receiver};

/// Most frames/s of a bus at 1 Mbit/s: 111 bits each, eight data bytes, no stuff bits.
const FULL_BUS_FRAMES_PER_S: usize = 9_009;
/// Kernel memory that a queued frame takes, measured on Linux 6.1 (`truesize`).
const QUEUED_FRAME_BYTES: usize = 768;
/// Half a second of a full bus.
pub(crate) const BUFFER_WANTED: usize = FULL_BUS_FRAMES_PER_S * QUEUED_FRAME_BYTES / 2;

/// `CAN_ERR_MASK`: every class of error frames.
const ALL_ERRORS: u32 = 0x1FFF_FFFF;
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;
/// `SO_MEMINFO` and the index in it of the frames lost; a kernel older than 4.12 has fewer entries.
const SO_MEMINFO: i32 = 55;
const MEMINFO_DROPS: usize = 8;

/// A system call and its answer.
#[derive(Debug)]
pub(crate) struct Failure {
    pub call: &'static str,
    pub error: io::Error,
}

/// Puts the name of a call to its error.
pub(crate) fn failed<E: Into<io::Error>>(call: &'static str) -> impl Fn(E) -> Failure {
    move |error| Failure { call, error: error.into() }
}

/// An unbound raw CAN socket.
pub(crate) fn raw_socket() -> Result<CanSocket, Failure> {
    let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
    let fd: OwnedFd = socket(AddressFamily::Can, SockType::Raw, flags, SockProtocol::CanRaw)
        .map_err(failed("socket(AF_CAN, SOCK_RAW, CAN_RAW)"))?;
    Ok(CanSocket::from(fd))
}

/// Binds to one interface. Index 0 would mean every interface at once, so the system's answer for no such name
/// is given for it.
pub(crate) fn bind(socket: &CanSocket, index: u32) -> Result<(), Failure> {
    if index == 0 {
        return Err(Failure { call: "bind", error: io::Error::from_raw_os_error(libc::ENODEV) });
    }
    socket.as_raw_socket().bind(&CanAddr::new(index).into_sock_addr()).map_err(failed("bind"))
}

/// An open receiving socket. It never sends, so a full transmit queue cannot hold it up.
pub(crate) struct Rx {
    socket: AsyncFd<CanSocket>,
    receiver: Receiver,
    received: Vec<Received>,
    /// The socket's count of lost frames as last told, modulo 2^32.
    drops: u32,
    /// No frame still to come was received before this: the newest frame so far, or the last time nothing was there.
    floor: Time,
}

impl Rx {
    /// Opens and binds; everything is set before it is bound, so that not one unwanted frame comes through.
    /// Gives the size of the granted buffer, too.
    pub fn open(index: u32, filters: Option<&[Filter]>) -> Result<(Self, usize), Failure> {
        let socket = raw_socket()?;
        if let Some(filters) = filters {
            socket.set_filters(filters).map_err(failed("setsockopt(CAN_RAW_FILTER)"))?;
        }
        // A kernel without CAN FD goes on with classic frames.
        let _classic_only = socket.set_socket_option_int(libc::SOL_CAN_RAW, libc::CAN_RAW_FD_FRAMES, 1);
        socket.set_error_filter(ALL_ERRORS).map_err(failed("setsockopt(CAN_RAW_ERR_FILTER)"))?;
        setsockopt(&socket, sockopt::ReceiveTimestampns, &true).map_err(failed("setsockopt(SO_TIMESTAMPNS)"))?;
        setsockopt(&socket, sockopt::RxqOvfl, &1).map_err(failed("setsockopt(SO_RXQ_OVFL)"))?;
        let granted = grow_buffer(&socket)?;
        bind(&socket, index)?;
        let rx = Self {
            socket: sys::register(socket).map_err(failed("epoll"))?,
            receiver: Receiver::new(),
            received: Vec::with_capacity(sys::READS),
            drops: 0,
            floor: ClockReading::now().time,
        };
        Ok((rx, granted))
    }

    pub fn fd(&self) -> BorrowedFd<'_> {
        sys::borrowed(&self.socket)
    }

    /// Waits until the socket has given at least one frame, which [`Rx::take`] then hands out, or an error.
    /// The outer error is the runtime's, the inner one the socket's.
    pub async fn receive(&mut self) -> io::Result<io::Result<()>> {
        loop {
            let mut ready = self.socket.ready(sys::WAKES).await?;
            let before = ClockReading::now().time;
            let (receiver, received) = (&mut self.receiver, &mut self.received);
            match ready.try_io(|socket| receiver.receive(sys::borrowed(socket), received)) {
                Err(_nothing_there) => self.floor = self.floor.max(before),
                Ok(Err(error)) if error.kind() == io::ErrorKind::Interrupted => {}
                Ok(result) => return Ok(result),
            }
        }
    }

    /// Puts what was received into the batch.
    pub fn take(&mut self, batch: &mut Batch) {
        let now = ClockReading::now();
        let mut malformed = 0;
        for i in 0..self.received.len() {
            let received = self.received[i];
            if let Some(drops) = received.drops {
                self.count_drops(drops, batch);
            }
            let Some(frame) = frame_of(&received) else {
                malformed += 1;
                continue;
            };
            let time = received.stamp_wall_ns.map_or(now.time, |stamp| now.time_of(stamp, self.floor));
            self.floor = time;
            match frame.kind {
                FrameKind::Error => {
                    let local = received.local;
                    if !local {
                        batch.errors.push(TimedFrame { time, frame });
                    }
                    can_error::decode(&frame, |error| batch.events.push(BusEvent::Error { error, local }));
                }
                _ => batch.frames.push(TimedFrame { time, frame }),
            }
        }
        self.received.clear();
        if malformed > 0 {
            batch.events.push(BusEvent::Malformed { frames: malformed });
        }
    }

    /// Takes the error that the next read would give, if there is one.
    pub fn forget_error(&self) {
        let _ = self.socket.get_ref().as_raw_socket().take_error();
    }

    /// Asks for the count of lost frames, because the one that rides on frames is silent when the bus is.
    pub fn ask_drops(&mut self, batch: &mut Batch) {
        let mut info = [0; 64];
        let Ok(length) = self.socket.get_ref().get_socket_option_bytes(libc::SOL_SOCKET, SO_MEMINFO, &mut info) else {
            return;
        };
        let drops = info.get(..length).and_then(|info| info.get(4 * MEMINFO_DROPS..)?.first_chunk().copied());
        if let Some(drops) = drops {
            self.count_drops(u32::from_ne_bytes(drops), batch);
        }
    }

    /// Both counts are one kernel counter: as it was when a frame was queued, and as it is now. A frame that was
    /// queued before the last asking tells an older value, which is nothing new.
    fn count_drops(&mut self, drops: u32, batch: &mut Batch) {
        let new = drops.wrapping_sub(self.drops);
        if new == 0 || new > u32::MAX / 2 {
            return;
        }
        self.drops = drops;
        let new = u64::from(new);
        match batch.events.last_mut() {
            Some(BusEvent::Dropped { frames }) => *frames += new,
            _ => batch.events.push(BusEvent::Dropped { frames: new }),
        }
    }
}

/// Asks for [`BUFFER_WANTED`], which the kernel doubles: the margin for drivers whose frames take more memory.
/// Without CAP_NET_ADMIN the limit is twice net.core.rmem_max.
fn grow_buffer(socket: &CanSocket) -> Result<usize, Failure> {
    if setsockopt(socket, sockopt::RcvBufForce, &BUFFER_WANTED).is_err() {
        setsockopt(socket, sockopt::RcvBuf, &BUFFER_WANTED).map_err(failed("setsockopt(SO_RCVBUF)"))?;
    }
    nix::sys::socket::getsockopt(socket, sockopt::RcvBuf).map_err(failed::<Errno>("getsockopt(SO_RCVBUF)"))
}

/// `struct can_frame { u32 id; u8 len; u8 pad[3]; u8 data[8]; }` as a frame, or `struct canfd_frame`, which has the same
/// head and 64 bytes; `None` if it is none. The length of a read tells them apart.
fn frame_of(received: &Received) -> Option<Frame> {
    if !matches!(received.length, FRAME_BYTES | FD_FRAME_BYTES) || received.truncated {
        return None;
    }
    let (head, data) = received.bytes[..received.length].split_at(8);
    let id = u32::from_ne_bytes(*head.first_chunk()?);
    let data = data.get(..usize::from(head[4]))?;
    let kind = match id {
        _ if id & ERROR != 0 => FrameKind::Error,
        _ if received.length == FD_FRAME_BYTES => FrameKind::Fd,
        _ if id & REMOTE != 0 => FrameKind::Remote,
        _ => FrameKind::Data,
    };
    let id = match id {
        _ if id & (EXTENDED | ERROR) != 0 => CanId::Extended(id & 0x1FFF_FFFF),
        _ => CanId::Standard((id & 0x7FF) as u16),
    };
    Frame::new(id, kind, data)
}

/// A classic frame as the kernel wants it; `None` for an error frame, which is not to be sent, and one of CAN FD: bring-up
/// commands are classic frames.
pub(crate) fn bytes_of(frame: &Frame) -> Option<[u8; FRAME_BYTES]> {
    let id = match frame.id {
        CanId::Standard(id) => u32::from(id & 0x7FF),
        CanId::Extended(id) => id & 0x1FFF_FFFF | EXTENDED,
    };
    let id = match frame.kind {
        FrameKind::Data => id,
        FrameKind::Remote => id | REMOTE,
        FrameKind::Error | FrameKind::Fd => return None,
    };
    let mut bytes = [0; FRAME_BYTES];
    bytes[..4].copy_from_slice(&id.to_ne_bytes());
    bytes[4] = frame.bytes().len() as u8;
    bytes[8..8 + frame.bytes().len()].copy_from_slice(frame.bytes());
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn received(bytes: [u8; FRAME_BYTES]) -> Received {
        let mut received = Received { length: FRAME_BYTES, ..Received::default() };
        received.bytes[..FRAME_BYTES].copy_from_slice(&bytes);
        received
    }

    #[test]
    fn a_read_of_72_bytes_is_a_frame_of_can_fd() {
        let mut fd = Received { length: FD_FRAME_BYTES, ..Received::default() };
        fd.bytes[..4].copy_from_slice(&(0x123_4567_u32 | EXTENDED).to_ne_bytes());
        (fd.bytes[4], fd.bytes[5]) = (64, 5);
        fd.bytes[8..].fill(0xAB);
        assert_eq!(frame_of(&fd), Frame::fd(CanId::Extended(0x123_4567), &[0xAB; 64]));
        fd.bytes[4] = 65;
        assert_eq!(frame_of(&fd), None);
        let classic = Received { length: FRAME_BYTES, ..fd };
        assert_eq!(frame_of(&classic), None, "a classic frame of more than eight bytes is none");
    }

    #[test]
    fn short_long_and_cut_reads_are_no_frames() {
        let good = received(bytes_of(&Frame::of(CanId::Standard(0x301), [1, 2])).unwrap());
        assert!(frame_of(&good).is_some());
        assert!(frame_of(&Received { length: 15, ..good }).is_none());
        assert!(frame_of(&Received { truncated: true, ..good }).is_none());
        let mut nine = good;
        nine.bytes[4] = 9;
        assert!(frame_of(&nine).is_none());
    }

    #[test]
    fn error_frames_are_told_from_data_and_never_made_for_sending() {
        let mut bytes = [0; FRAME_BYTES];
        bytes[..4].copy_from_slice(&0x2000_0040_u32.to_ne_bytes());
        bytes[4] = 8;
        let frame = frame_of(&received(bytes)).unwrap();
        assert_eq!((frame.kind, frame.id), (FrameKind::Error, CanId::Extended(0x40)));
        assert_eq!(bytes_of(&frame), None);
    }

    proptest! {
        #[test]
        fn frames_survive_the_way_to_the_kernel_and_back(
            id in 0_u32..0x2000_0000,
            extended: bool,
            remote: bool,
            data in prop::collection::vec(any::<u8>(), 0..=8),
        ) {
            let id = if extended { CanId::Extended(id) } else { CanId::Standard((id & 0x7FF) as u16) };
            let kind = if remote { FrameKind::Remote } else { FrameKind::Data };
            let frame = Frame::new(id, kind, &data).unwrap();
            prop_assert_eq!(frame_of(&received(bytes_of(&frame).unwrap())), Some(frame));
        }

        #[test]
        fn no_bytes_make_the_reading_of_a_frame_panic(bytes in prop::collection::vec(any::<u8>(), 72), length in 0_usize..80) {
            let bytes = bytes.try_into().unwrap();
            let _ = frame_of(&Received { length, bytes, ..Received::default() });
        }
    }
}
