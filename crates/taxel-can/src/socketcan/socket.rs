//! Sockets and links: everything that is asked of the kernel, one function each.

use std::io;
use std::os::fd::RawFd;

use nix::net::if_::InterfaceFlags;
use nix::sys::socket::{setsockopt, sockopt};
use socketcan::{CanFilter, CanSocket, Socket, SocketOptions};

use crate::filter::Filter;
use crate::source::SourceError;

/// Receive buffer for 0.5 s of a full bus: 9,009 frames/s at the most (111 bits each at 1 Mbit/s), of which the
/// kernel charges 768 bytes each.
pub const BUFFER_BYTES: usize = 9_009 * 768 / 2;

/// What is known of an interface.
pub enum Link {
    /// There is none of this name.
    Absent,
    /// There is one.
    Present {
        /// Its number; a device that returns under the same name has another.
        index: u32,
        /// Whether it is set up.
        up: bool,
        /// Whether it is on the bus; a controller that went bus-off is not.
        carrier: bool,
    },
}

/// Looks an interface up.
pub fn link(name: &str) -> Link {
    let Ok(index) = nix::net::if_::if_nametoindex(name) else { return Link::Absent };
    let addresses = nix::ifaddrs::getifaddrs().into_iter().flatten();
    let flags = addresses.filter(|a| a.interface_name == name).map(|a| a.flags).next();
    // An interface without an entry cannot be judged: take it for usable, reading will tell.
    let flags = flags.unwrap_or(InterfaceFlags::IFF_UP | InterfaceFlags::IFF_RUNNING);
    let up = flags.contains(InterfaceFlags::IFF_UP);
    Link::Present { index, up, carrier: flags.contains(InterfaceFlags::IFF_RUNNING) }
}

/// Whether the kernel knows CAN at all.
pub fn check_kernel() -> Result<(), SourceError> {
    // SAFETY: socket(2) takes three integers and touches no memory of ours.
    let fd = unsafe { libc::socket(libc::AF_CAN, libc::SOCK_RAW | libc::SOCK_CLOEXEC, libc::CAN_RAW) };
    if fd >= 0 {
        // SAFETY: the descriptor was just made and is owned by nobody else.
        drop(unsafe { <std::os::fd::OwnedFd as std::os::fd::FromRawFd>::from_raw_fd(fd) });
        return Ok(());
    }
    let source = io::Error::last_os_error();
    match source.raw_os_error() {
        Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT) => Err(SourceError::NoCan),
        _ => Err(SourceError::Io { what: "opening a CAN socket".to_owned(), source }),
    }
}

/// A socket that receives exactly what the filters let through, error frames and receive times; with the receive
/// buffer that was granted, in bytes.
pub fn receiving(interface: &str, filters: &[Filter]) -> io::Result<(CanSocket, usize)> {
    let socket = CanSocket::open(interface)?;
    let filters: Vec<CanFilter> = filters.iter().map(|&f| f.into()).collect();
    socket.set_filters(&filters)?;
    socket.set_error_filter_accept_all()?;
    socket.set_nonblocking(true)?;
    setsockopt(&socket, sockopt::ReceiveTimestampns, &true)?;
    // Beyond the system's limit only with CAP_NET_ADMIN; without, as much as the limit allows.
    if setsockopt(&socket, sockopt::RcvBufForce, &BUFFER_BYTES).is_err() {
        setsockopt(&socket, sockopt::RcvBuf, &BUFFER_BYTES)?;
    }
    let granted = nix::sys::socket::getsockopt(&socket, sockopt::RcvBuf)?;
    Ok((socket, granted))
}

/// A socket that only sends: it receives nothing, so that its buffer never fills.
pub fn sending(interface: &str) -> io::Result<CanSocket> {
    let socket = CanSocket::open(interface)?;
    socket.set_filter_drop_all()?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// How many frames the kernel dropped because the socket's buffer was full, since it was opened; wraps.
pub fn drops(socket: RawFd) -> Option<u32> {
    /// Position of the drop counter in what SO_MEMINFO returns (SK_MEMINFO_DROPS).
    const DROPS: usize = 8;
    let mut info = [0_u32; DROPS + 1];
    let mut len = size_of_val(&info) as libc::socklen_t;
    // SAFETY: the buffer is `len` bytes long and alive; the kernel writes at most `len` bytes and says how many.
    let outcome = unsafe {
        libc::getsockopt(socket, libc::SOL_SOCKET, libc::SO_MEMINFO, info.as_mut_ptr().cast(), &raw mut len)
    };
    (outcome == 0 && len as usize == size_of_val(&info)).then_some(info[DROPS])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::fd::AsRawFd;

    #[test]
    fn an_interface_that_is_not_there_is_absent() {
        assert!(matches!(link("nocan7"), Link::Absent));
    }

    #[test]
    fn drops_of_something_that_is_no_socket_are_unknown() {
        let file = std::fs::File::open("/dev/null").unwrap();
        assert_eq!(drops(file.as_raw_fd()), None);
    }
}
