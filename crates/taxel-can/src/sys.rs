//! The few system calls that no crate offers in a safe form. All `unsafe` of this crate is in this file.

use std::io;
use std::mem;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};

use socketcan::CanSocket;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

/// Reads of one call. At 9,009 frames/s a full bus fills this in 7 ms.
pub(crate) const READS: usize = 64;
/// Bytes of `struct can_frame`.
pub(crate) const FRAME_BYTES: usize = 16;
/// Bytes of `struct canfd_frame`.
pub(crate) const FD_FRAME_BYTES: usize = 72;
/// Room for a timestamp (32) and a drop count (24), headers included.
const CONTROL_BYTES: usize = 64;

/// What the owner of a receiving socket waits for. A pending error is no frame to read: without asking for errors,
/// the end of an interface would wake nobody.
pub(crate) const WAKES: Interest = Interest::READABLE.add(Interest::ERROR);

/// Aligned as the kernel writes control messages.
#[repr(C, align(8))]
#[derive(Clone, Copy)]
struct Control([u8; CONTROL_BYTES]);

/// One read: a frame's bytes and what the kernel tells of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Received {
    /// `struct can_frame` or `struct canfd_frame`, as `length` says.
    pub bytes: [u8; FD_FRAME_BYTES],
    /// Bytes that the kernel wrote.
    pub length: usize,
    /// The frame was longer than one of CAN FD.
    pub truncated: bool,
    /// A process of this machine sent it.
    pub local: bool,
    /// When the kernel received it, by the wall clock, in ns since 1970.
    pub stamp_wall_ns: Option<i64>,
    /// Frames that this socket had lost when this one was queued, modulo 2^32; absent while zero.
    pub drops: Option<u32>,
}

impl Default for Received {
    fn default() -> Self {
        let bytes = [0; FD_FRAME_BYTES];
        Self { bytes, length: 0, truncated: false, local: false, stamp_wall_ns: None, drops: None }
    }
}

/// Where the kernel writes to, made once.
pub(crate) struct Receiver {
    frames: Box<[[u8; FD_FRAME_BYTES]; READS]>,
    control: Box<[Control; READS]>,
}

impl Receiver {
    pub fn new() -> Self {
        Self { frames: Box::new([[0; FD_FRAME_BYTES]; READS]), control: Box::new([Control([0; CONTROL_BYTES]); READS]) }
    }

    /// Takes what the socket holds, at most [`READS`], without waiting, and puts it into `received`.
    ///
    /// libc's call and not nix's: nix warns of its own control messages on aarch64.
    #[allow(clippy::unnecessary_cast)] // the lengths are usize or u32, as the C library has it
    pub fn receive(&mut self, socket: BorrowedFd<'_>, received: &mut Vec<Received>) -> io::Result<()> {
        received.clear();
        // SAFETY: `iovec` and `mmsghdr` are plain C structures for which all zeros (null pointers) are valid.
        let (mut places, mut headers) = unsafe { mem::zeroed::<([libc::iovec; READS], [libc::mmsghdr; READS])>() };
        for i in 0..READS {
            places[i].iov_base = self.frames[i].as_mut_ptr().cast();
            places[i].iov_len = FD_FRAME_BYTES;
            let header = &mut headers[i].msg_hdr;
            header.msg_iov = &raw mut places[i];
            header.msg_iovlen = 1;
            header.msg_control = self.control[i].0.as_mut_ptr().cast();
            header.msg_controllen = CONTROL_BYTES as _;
        }
        let flags = libc::MSG_DONTWAIT;
        // SAFETY: `headers` holds READS headers. Each points to one iovec and two buffers of the stated lengths, all
        // of which outlive the call and are not used elsewhere during it. A null timeout is allowed.
        let count = unsafe {
            libc::recvmmsg(socket.as_raw_fd(), headers.as_mut_ptr(), READS as _, flags as _, std::ptr::null_mut())
        };
        let count = usize::try_from(count).map_err(|_| io::Error::last_os_error())?;
        for (i, message) in headers.iter().enumerate().take(count) {
            let header = &message.msg_hdr;
            let control = &self.control[i].0;
            let control = control.get(..header.msg_controllen as usize).unwrap_or(control);
            let mut one = Received {
                bytes: self.frames[i],
                length: message.msg_len as usize,
                truncated: header.msg_flags & libc::MSG_TRUNC != 0,
                local: header.msg_flags & libc::MSG_DONTROUTE != 0,
                ..Received::default()
            };
            read_control(control, &mut one);
            received.push(one);
        }
        Ok(())
    }
}

/// Reads `struct cmsghdr { size_t len; int level; int type; }` and its data, again and again.
fn read_control(mut control: &[u8], one: &mut Received) {
    const WORD: usize = size_of::<usize>();
    const HEADER: usize = WORD + 8;
    while let Some((header, _)) = control.split_at_checked(HEADER) {
        let length = number(&header[..WORD]).map_or(0, usize::from_ne_bytes);
        let level = number(&header[WORD..WORD + 4]).map_or(0, i32::from_ne_bytes);
        let kind = number(&header[WORD + 4..]).map_or(0, i32::from_ne_bytes);
        let Some(data) = control.get(HEADER..length) else { return };
        match (level, kind) {
            (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) => one.stamp_wall_ns = timespec_ns(data),
            (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) => one.drops = number(data).map(u32::from_ne_bytes),
            _ => {}
        }
        control = control.get(length.next_multiple_of(WORD)..).unwrap_or_default();
    }
}

fn number<const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
    bytes.first_chunk().copied()
}

/// `struct timespec` of two C longs, in ns.
#[allow(clippy::unnecessary_cast)] // a C long has 32 or 64 bits
fn timespec_ns(data: &[u8]) -> Option<i64> {
    const LONG: usize = size_of::<libc::c_long>();
    let long = |at: usize| number(data.get(at..)?).map(|bytes| libc::c_long::from_ne_bytes(bytes) as i64);
    long(0)?.checked_mul(1_000_000_000)?.checked_add(long(LONG)?)
}

/// The flags of an interface (`IFF_*`), by its name, in the network namespace of `socket`.
pub(crate) fn interface_flags(socket: BorrowedFd<'_>, name: &str) -> io::Result<i32> {
    let mut request = request_of(name)?;
    // SAFETY: SIOCGIFFLAGS reads the name and writes the flags of the `ifreq` that is lent to it.
    let result = unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCGIFFLAGS as _, &raw mut request) };
    if result < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the call succeeded, so the union holds the flags, and any bits are a valid `c_short`.
    let flags = unsafe { request.ifr_ifru.ifru_flags };
    Ok(i32::from(flags))
}

/// The index that an interface of this name has now, in the network namespace of `socket`; `ENODEV` if there is none.
/// Unlike `if_nametoindex` it opens no socket for it, so it has an answer also where there is no descriptor left.
pub(crate) fn interface_index(socket: BorrowedFd<'_>, name: &str) -> io::Result<u32> {
    let mut request = request_of(name)?;
    // SAFETY: SIOCGIFINDEX reads the name and writes the index of the `ifreq` that is lent to it.
    let result = unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCGIFINDEX as _, &raw mut request) };
    if result < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the call succeeded, so the union holds the index, and any bits are a valid `c_int`.
    let index = unsafe { request.ifr_ifru.ifru_ifindex };
    u32::try_from(index).map_err(|_| io::Error::from_raw_os_error(libc::ENODEV)) // no interface has such a one
}

/// What the kernel is asked about the interface of this name; `ENODEV` if none can have it.
fn request_of(name: &str) -> io::Result<libc::ifreq> {
    // SAFETY: `ifreq` is a plain C structure for which all zeros are valid.
    let mut request = unsafe { mem::zeroed::<libc::ifreq>() };
    // One byte stays zero and ends the name.
    let room = request.ifr_name.len() - 1;
    if name.len() > room {
        return Err(io::Error::from_raw_os_error(libc::ENODEV));
    }
    for (to, from) in request.ifr_name.iter_mut().zip(name.bytes()) {
        *to = from as libc::c_char;
    }
    Ok(request)
}

/// A socket that the runtime waits for.
pub(crate) fn register(socket: CanSocket) -> io::Result<AsyncFd<CanSocket>> {
    // SAFETY: `CanSocket` owns an open descriptor and returns that one until it is dropped, which `AsyncFd` does
    // only after it has taken it out of the poll set. Nothing in this crate takes a mutable reference to it.
    unsafe { AsyncFd::register_with_interest(socket, WAKES) }.map_err(|error| error.into_parts().1)
}

/// The socket as the calls here want it.
pub(crate) fn borrowed(socket: &AsyncFd<CanSocket>) -> BorrowedFd<'_> {
    socket.get_ref().as_fd()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(level: i32, kind: i32, data: &[u8]) -> Vec<u8> {
        let mut bytes = (size_of::<usize>() + 8 + data.len()).to_ne_bytes().to_vec();
        bytes.extend(level.to_ne_bytes());
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(size_of::<usize>()), 0);
        bytes
    }

    #[test]
    fn control_messages_are_read_in_any_order_and_unknown_ones_skipped() {
        let stamp: Vec<u8> = [7 as libc::c_long, 5].iter().flat_map(|long| long.to_ne_bytes()).collect();
        let parts = [
            message(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, &9_u32.to_ne_bytes()),
            message(1234, 5, &[1, 2, 3]),
            message(libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS, &stamp),
        ];
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
            let mut one = Received::default();
            read_control(&order.map(|i| parts[i].clone()).concat(), &mut one);
            assert_eq!((one.stamp_wall_ns, one.drops), (Some(7_000_000_005), Some(9)));
        }
    }

    #[test]
    fn an_interface_is_asked_for_on_a_socket_that_is_open_already() {
        let socket = std::net::UdpSocket::bind(("127.0.0.1", 0)).unwrap();
        let index = nix::net::if_::if_nametoindex("lo").unwrap();
        assert_eq!(interface_index(socket.as_fd(), "lo").unwrap(), index);
        assert_eq!(interface_flags(socket.as_fd(), "lo").unwrap() & libc::IFF_LOOPBACK, libc::IFF_LOOPBACK);
        for absent in ["taxeld-no-such", "a-name-of-16-bytes"] {
            let refused = interface_index(socket.as_fd(), absent).unwrap_err();
            assert_eq!(refused.raw_os_error(), Some(libc::ENODEV), "{absent}: {refused}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_the_reading_of_control_messages_panic_or_hang(bytes: Vec<u8>, cut in 0_usize..64) {
            let mut bytes = bytes;
            read_control(&bytes, &mut Received::default());
            let mut whole = message(libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS, &bytes);
            whole.truncate(cut);
            read_control(&whole, &mut Received::default());
            bytes.splice(0..0, [0; 16]);
            read_control(&bytes, &mut Received::default());
        }
    }
}
