//! A real interface: found, lost, found again, and never silent about it.
//!
//! What Linux does (6.1, raw socket bound to one interface):
//!
//! | event | the socket | so here |
//! |---|---|---|
//! | interface set down | one `ENETDOWN`, then silence; works again when it is up | keep the socket, look at the link |
//! | interface deleted | one `ENODEV`, then silence for ever, also under the same name again | close, open by name |
//! | other end down, bus-off | silence, sends succeed | look at the link for its carrier |
//!
//! The look at the link goes by name every [`LINK_POLL`], so each state is told within that time.

use std::io;
use std::time::Duration;

use nix::net::if_::if_nametoindex;
use taxel_wire::{CanId, Frame};
use thiserror::Error;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, sleep};

use crate::filter::{Filter, filters};
use crate::rx::{BUFFER_WANTED, Failure, Rx, bytes_of, raw_socket};
use crate::source::{Batch, BusEvent, DownReason, FrameSource, NotSent, SendError, SourceError};
use crate::sys;
use crate::tx::Tx;

/// How often the link is looked at, and a lost interface looked for.
pub const LINK_POLL: Duration = Duration::from_millis(100);
/// First wait after the transmit queue was full; doubled each time.
const SEND_WAIT_FIRST: Duration = Duration::from_millis(1);
/// Longest try to send one frame: a fifth of what the receive buffer holds, because the owner does not read meanwhile.
const SEND_WAIT_TOTAL: Duration = Duration::from_millis(100);
/// Names of network interfaces in Linux have at most 15 bytes.
const NAME_BYTES: usize = 15;

/// What to open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SocketCanOptions {
    /// Name of the interface, such as `can0`. It need not exist yet.
    pub interface: String,
    /// Data frames to receive: exactly these identifiers, or all frames of any kind.
    /// Error frames come in any case.
    pub ids: Option<Vec<CanId>>,
    /// Whether frames may be sent. If not, no sending socket is opened at all.
    pub tx: bool,
}

/// Why a bus cannot be opened, now or ever, in words. An interface that is down or not there is no reason: that is a state.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct OpenError(String);

/// One CAN interface.
///
/// A frame's time is when the kernel received it, on `CLOCK_BOOTTIME`. The kernel stamps with the wall clock, so if
/// that is stepped between reception and reading, the times of that one batch may be off, yet never later than the
/// reading, and never earlier than the frame before or the last time that nothing was there to read.
///
/// The kernel hands each sent frame to every other socket of this machine. So a frame sent here is also received
/// here, if it is among the wanted identifiers; on a real bus that is when it was on the wire.
///
/// Frames of CAN FD are received where the interface has them; only classic ones are sent.
pub struct SocketCan {
    interface: String,
    filters: Option<Vec<Filter>>,
    tx: bool,
    sockets: Option<Sockets>,
    link: Link,
    /// Told with the next batch.
    pending: Vec<BusEvent>,
    poll: Interval,
}

/// Open sockets, and the interface that they are bound to.
struct Sockets {
    index: u32,
    rx: Rx,
    tx: Option<Tx>,
}

/// What was last told of the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Link {
    Untold,
    Up,
    Down(DownReason),
}

/// What woke the owner.
enum Wake {
    Look,
    Received(io::Result<()>),
}

impl SocketCan {
    /// Opens the bus. Must be called within a runtime.
    ///
    /// # Errors
    /// [`OpenError`]; not for an interface that is down or absent, which is told as [`BusEvent::Down`] and waited for.
    pub fn open(options: SocketCanOptions) -> Result<Self, OpenError> {
        let SocketCanOptions { interface, ids, tx } = options;
        let visible = interface.bytes().all(|byte| byte.is_ascii_graphic() && byte != b'/' && byte != b':');
        if !visible || interface.is_empty() || interface.len() > NAME_BYTES || matches!(&*interface, "." | "..") {
            return Err(OpenError(format!(
                "interface name {interface:?}: expected 1 to 15 visible ASCII characters without / and :, not \".\" or \"..\""
            )));
        }
        let mut poll = interval(LINK_POLL);
        poll.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let filters = ids.as_deref().map(filters);
        let mut bus = Self { interface, filters, tx, sockets: None, link: Link::Untold, pending: Vec::new(), poll };
        let mut batch = Batch::default();
        // Asked in any case: a kernel that cannot do it would never find the interface either.
        let opened = raw_socket().and_then(|_probe| bus.try_open(&mut batch));
        opened.map_err(|failure| bus.refused(failure))?;
        bus.look(&mut batch);
        bus.pending = batch.events;
        Ok(bus)
    }

    fn refused(&self, Failure { call, error }: Failure) -> OpenError {
        let why = match error.raw_os_error() {
            Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT) => format!(
                "this kernel has no CAN support ({call}: {error}); load the modules can and can_raw, or use a kernel with \
                 CONFIG_CAN and CONFIG_CAN_RAW"
            ),
            Some(libc::ENODEV) => "is no CAN interface".to_owned(),
            _ => format!("{call}: {error}"),
        };
        OpenError(format!("interface {}: {why}", self.interface))
    }

    /// Opens the sockets. An interface that is not there is told and no failure.
    fn try_open(&mut self, batch: &mut Batch) -> Result<(), Failure> {
        let index = match if_nametoindex(&*self.interface).map_err(io::Error::from) {
            Ok(index) => index, // never 0, which no interface has
            Err(error) if is_gone(&error) => {
                self.tell(Link::Down(DownReason::NoInterface), batch);
                return Ok(());
            }
            Err(error) => return Err(Failure { call: "if_nametoindex", error }),
        };
        let opened = Rx::open(index, self.filters.as_deref()).and_then(|(rx, granted)| {
            let tx = if self.tx { Some(Tx::open(index)?) } else { None };
            Ok((Sockets { index, rx, tx }, granted))
        });
        match opened {
            Ok((sockets, bytes)) => {
                self.sockets = Some(sockets);
                batch.events.push(BusEvent::BufferGranted { bytes, wanted: BUFFER_WANTED });
                Ok(())
            }
            // It went between the look for its index and now.
            Err(Failure { error, .. }) if is_gone(&error) && if_nametoindex(&*self.interface) != Ok(index) => {
                self.tell(Link::Down(DownReason::NoInterface), batch);
                Ok(())
            }
            Err(failure) => Err(failure),
        }
    }

    /// Looks at the link and at the losses; opens the interface again if it was lost.
    fn look(&mut self, batch: &mut Batch) {
        if self.sockets.is_none()
            && let Err(Failure { error, .. }) = self.try_open(batch)
        {
            self.tell(Link::Down(reason_of(&error)), batch);
        }
        let Some(sockets) = &mut self.sockets else { return };
        sockets.rx.ask_drops(batch);
        if is_lost(sockets.index, sys::interface_index(sockets.rx.fd(), &self.interface)) {
            self.close(DownReason::NoInterface, batch);
            return;
        }
        match sys::interface_flags(sockets.rx.fd(), &self.interface) {
            Ok(flags) if flags & libc::IFF_UP == 0 => {
                // Seen here before the socket's own word of it, which would sound like a second time later.
                sockets.rx.forget_error();
                self.tell(Link::Down(DownReason::InterfaceDown), batch);
            }
            Ok(flags) if flags & libc::IFF_RUNNING == 0 => self.tell(Link::Down(DownReason::NoCarrier), batch),
            Ok(_) => self.tell(Link::Up, batch),
            Err(error) if is_gone(&error) => self.close(DownReason::NoInterface, batch),
            Err(_nothing_about_the_link) => {} // the next look asks again
        }
    }

    /// The socket's one word about its end.
    fn socket_failed(&mut self, error: &io::Error, batch: &mut Batch) {
        if let Some(sockets) = &mut self.sockets {
            sockets.rx.ask_drops(batch);
        }
        match reason_of(error) {
            // The same socket works on when the interface is up again.
            reason @ DownReason::InterfaceDown => self.tell(Link::Down(reason), batch),
            reason => self.close(reason, batch),
        }
    }

    fn close(&mut self, reason: DownReason, batch: &mut Batch) {
        self.sockets = None;
        self.tell(Link::Down(reason), batch);
    }

    fn tell(&mut self, link: Link, batch: &mut Batch) {
        if self.link == link {
            return;
        }
        self.link = link;
        match link {
            Link::Up => batch.events.push(BusEvent::Up),
            Link::Down(reason) => batch.events.push(BusEvent::Down { reason }),
            Link::Untold => {}
        }
    }

    /// Waits for the socket or for the time to look at the link. Nothing is lost if it is cancelled: what the kernel
    /// gave away is handed on within the same poll.
    async fn wake(&mut self) -> io::Result<Wake> {
        let Some(sockets) = &mut self.sockets else {
            self.poll.tick().await;
            return Ok(Wake::Look);
        };
        tokio::select! {
            _ = self.poll.tick() => Ok(Wake::Look),
            received = sockets.rx.receive() => received.map(Wake::Received),
        }
    }
}

impl SocketCan {
    async fn try_send(&mut self, frame: &Frame) -> Result<(), NotSent> {
        if !self.tx {
            return Err(NotSent::ListenOnly);
        }
        let bytes = bytes_of(frame).ok_or(NotSent::Kind)?;
        let Some(Sockets { tx: Some(tx), .. }) = &self.sockets else {
            return Err(NotSent::Down(DownReason::NoInterface));
        };
        let started = Instant::now();
        let mut wait = SEND_WAIT_FIRST;
        loop {
            match tx.send(&bytes) {
                Ok(()) => return Ok(()),
                Err(error) if !is_full(&error) => {
                    return Err(match reason_of(&error) {
                        DownReason::System { .. } => NotSent::System(error),
                        reason => NotSent::Down(reason),
                    });
                }
                Err(_full) => {}
            }
            // The socket stays writable all the while, so only a timer can tell when to try again.
            if started.elapsed() + wait > SEND_WAIT_TOTAL {
                return Err(NotSent::QueueFull(started.elapsed()));
            }
            sleep(wait).await;
            wait *= 2;
        }
    }
}

impl FrameSource for SocketCan {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        batch.events.append(&mut self.pending);
        while batch.is_empty() {
            let wake = self.wake().await;
            match wake.map_err(|error| SourceError::Runtime { interface: self.interface.clone(), error })? {
                Wake::Look => self.look(batch),
                Wake::Received(Err(error)) => self.socket_failed(&error, batch),
                Wake::Received(Ok(())) => {
                    // Frames on a link that is said to be down: it is up again, and told so before them.
                    if self.link != Link::Up {
                        self.look(batch);
                    }
                    if let Some(sockets) = &mut self.sockets {
                        sockets.rx.take(batch);
                    }
                }
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        self.try_send(frame).await.map_err(|why| SendError { id: frame.id, why })
    }
}

/// Whether the interface that the sockets are bound to is gone, as another look at its name tells: nothing has the name, or
/// another interface has it. An answer about anything else, such as a want of memory, says nothing about the interface.
fn is_lost(bound: u32, now: io::Result<u32>) -> bool {
    match now {
        Ok(index) => index != bound,
        Err(error) => is_gone(&error),
    }
}

fn is_gone(error: &io::Error) -> bool {
    matches!(error.raw_os_error(), Some(libc::ENODEV | libc::ENXIO))
}

fn is_full(error: &io::Error) -> bool {
    matches!(error.raw_os_error(), Some(libc::ENOBUFS | libc::EAGAIN | libc::EINTR))
}

fn reason_of(error: &io::Error) -> DownReason {
    match error.raw_os_error() {
        Some(libc::ENETDOWN) => DownReason::InterfaceDown,
        _ if is_gone(error) => DownReason::NoInterface,
        errno => DownReason::System { errno: errno.unwrap_or(libc::EIO) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(interface: &str) -> Result<SocketCan, OpenError> {
        SocketCan::open(SocketCanOptions { interface: interface.to_owned(), ..SocketCanOptions::default() })
    }

    #[tokio::test]
    async fn a_name_that_no_interface_can_have_is_refused_with_the_name() {
        for name in ["", "a-name-of-16-bytes", "can 0", "can/0", "can0\0", ".."] {
            let refused = open(name).err().unwrap().to_string();
            assert!(refused.starts_with(&format!("interface name {name:?}: expected")), "{refused}");
        }
    }

    #[test]
    fn an_interface_is_lost_when_its_name_is_gone_or_another_s_and_not_when_the_system_is_short_of_something() {
        let failed = |errno| Err(io::Error::from_raw_os_error(errno));
        for gone in [failed(libc::ENODEV), failed(libc::ENXIO), Ok(8)] {
            assert!(is_lost(7, gone));
        }
        for there in [Ok(7), failed(libc::EMFILE), failed(libc::ENFILE), failed(libc::ENOBUFS), failed(libc::ENOMEM)] {
            assert!(!is_lost(7, there));
        }
    }

    /// With CAN the lab's tests take over; this is what the user of a kernel without it reads.
    #[tokio::test]
    async fn a_kernel_without_can_is_named_as_the_cause() {
        match open("can-not-there") {
            Err(error) => assert!(error.to_string().contains("this kernel has no CAN support"), "{error}"),
            Ok(mut bus) => {
                let mut batch = Batch::default();
                bus.next(&mut batch).await.unwrap();
                assert_eq!(batch.events, [BusEvent::Down { reason: DownReason::NoInterface }]);
            }
        }
    }
}
