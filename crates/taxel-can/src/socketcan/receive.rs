//! Batch reads with the kernel's receive times: up to 64 frames a system call.

use std::io;
use std::mem::{MaybeUninit, size_of};
use std::os::fd::{AsRawFd, RawFd};
use taxel_skin::Time;
use taxel_wire::{CanId, Frame, FrameKind, TimedFrame};

use crate::clock::ClockPair;

/// Frames per system call: 7 ms of a full bus, so that a waking process catches up quickly.
const FRAMES: usize = 64;

/// Room for one time stamp with its header, generously.
const CONTROL_BYTES: usize = 64;

/// Buffers for one call, reused.
pub struct Receiver {
    frames: [libc::can_frame; FRAMES],
    control: [Control; FRAMES],
    /// Messages that were not a whole classic frame.
    pub malformed: u64,
}

/// Control data must be aligned as its headers are.
#[repr(C, align(8))]
#[derive(Clone, Copy)]
struct Control([u8; CONTROL_BYTES]);

impl Receiver {
    pub fn new() -> Self {
        // SAFETY: can_frame is plain integers; all zeros is one.
        let frame: libc::can_frame = unsafe { MaybeUninit::zeroed().assume_init() };
        Self { frames: [frame; FRAMES], control: [Control([0; CONTROL_BYTES]); FRAMES], malformed: 0 }
    }

    /// Reads what is there, without waiting; returns whether the call was filled, so that there may be more.
    pub fn receive(&mut self, socket: &impl AsRawFd, out: &mut Vec<TimedFrame>) -> io::Result<bool> {
        let mut slices: [MaybeUninit<libc::iovec>; FRAMES] = [const { MaybeUninit::uninit() }; FRAMES];
        // SAFETY: mmsghdr is integers and pointers; all zeros (null pointers, no lengths) is one.
        let mut headers: [libc::mmsghdr; FRAMES] = unsafe { MaybeUninit::zeroed().assume_init() };
        for i in 0..FRAMES {
            let base = (&raw mut self.frames[i]).cast();
            let slice = slices[i].write(libc::iovec { iov_base: base, iov_len: size_of::<libc::can_frame>() });
            let header = &mut headers[i].msg_hdr;
            header.msg_iov = slice;
            header.msg_iovlen = 1;
            header.msg_control = (&raw mut self.control[i]).cast();
            header.msg_controllen = CONTROL_BYTES as _;
        }
        let received = recvmmsg(socket.as_raw_fd(), &mut headers)?;
        let clocks = ClockPair::now();
        for (header, frame) in headers.iter().zip(&self.frames).take(received) {
            if header.msg_len as usize != size_of::<libc::can_frame>() {
                self.malformed += 1;
                continue;
            }
            let stamp = stamp(&header.msg_hdr).unwrap_or(clocks.realtime);
            out.push(TimedFrame { time: clocks.to_monotonic(stamp), frame: convert(frame) });
        }
        Ok(received == FRAMES)
    }
}

fn recvmmsg(socket: RawFd, headers: &mut [libc::mmsghdr; FRAMES]) -> io::Result<usize> {
    let flags = libc::MSG_DONTWAIT;
    // SAFETY: every header points to one iovec over one can_frame and to one control buffer, all alive and not
    // otherwise borrowed until the call returns; the count is the array's length; no timeout is given.
    let n = unsafe {
        libc::recvmmsg(socket, headers.as_mut_ptr(), FRAMES as libc::c_uint, flags as _, std::ptr::null_mut())
    };
    usize::try_from(n).map_err(|_| io::Error::last_os_error())
}

/// The receive time that the kernel put beside a frame.
fn stamp(header: &libc::msghdr) -> Option<Time> {
    // SAFETY: the kernel filled msg_control and msg_controllen of this header, and its buffer is alive.
    let mut next = unsafe { libc::CMSG_FIRSTHDR(header) };
    while !next.is_null() {
        // SAFETY: CMSG_FIRSTHDR and CMSG_NXTHDR return null or a header that lies wholly within the buffer.
        let message = unsafe { &*next };
        if message.cmsg_level == libc::SOL_SOCKET && message.cmsg_type == libc::SCM_TIMESTAMPNS {
            // SAFETY: a message of this type carries one timespec; it need not be aligned.
            let at: libc::timespec = unsafe { std::ptr::read_unaligned(libc::CMSG_DATA(next).cast()) };
            let nanos = (at.tv_sec as i64).checked_mul(1_000_000_000)?.checked_add(at.tv_nsec as i64)?;
            return Some(Time::from_nanos(nanos));
        }
        // SAFETY: as above.
        next = unsafe { libc::CMSG_NXTHDR(header, next) };
    }
    None
}

/// The kernel's frame as ours. Lengths beyond eight do not occur on classic sockets and are cut.
fn convert(raw: &libc::can_frame) -> Frame {
    let kind = match raw.can_id {
        id if id & libc::CAN_ERR_FLAG != 0 => FrameKind::Error,
        id if id & libc::CAN_RTR_FLAG != 0 => FrameKind::Remote,
        _ => FrameKind::Data,
    };
    let id = if kind == FrameKind::Error {
        CanId::Extended(raw.can_id & libc::CAN_ERR_MASK)
    } else if raw.can_id & libc::CAN_EFF_FLAG != 0 {
        CanId::Extended(raw.can_id & libc::CAN_EFF_MASK)
    } else {
        CanId::Standard((raw.can_id & libc::CAN_SFF_MASK) as u16)
    };
    let len = usize::from(raw.can_dlc).min(8);
    let bytes = &raw.data[..len];
    // Eight bytes always fit.
    Frame::new(id, kind, bytes).unwrap_or(Frame::of(id, []))
}
