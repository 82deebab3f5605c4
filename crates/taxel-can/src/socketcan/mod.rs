//! A real CAN interface, owned by one task, that comes back by itself.
//!
//! The kernel tells of trouble once and is silent afterwards: a link that goes down gives one ENETDOWN and the same
//! socket works again when it is back; a device that is unplugged gives one ENODEV and its socket is dead, even when
//! a device of the same name returns. So a deadline of its own looks at the link four times a second, and a dead
//! socket is closed and opened anew by name.

mod error_frame;
mod receive;
mod socket;

use std::io;
use std::os::fd::AsRawFd;
use std::time::Duration;

use socketcan::{CanFrame, EmbeddedFrame, ExtendedId, Socket, StandardId};
use taxel_wire::{CanId, Frame, FrameKind};
use tokio::io::unix::AsyncFd;
use tokio::time::{Instant, sleep, sleep_until, timeout_at};

use crate::filter::{Filter, filters};
use crate::source::{Batch, BusEvent, FrameSource, SendError, SourceError};
use receive::Receiver;
use socket::Link;

/// How often link and drop counter are looked at; changes of the link are published within this.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// How long a frame waits for room in the send queue. Board commands are few; a second node acknowledges within 1 ms.
const SEND_WITHIN: Duration = Duration::from_millis(250);

/// How an interface is opened.
#[derive(Clone, Debug)]
pub struct Options {
    /// Its name, for example `can0`.
    pub interface: String,
    /// The identifiers that are let through.
    pub wanted: Vec<CanId>,
    /// Whether anything may be sent.
    pub listen_only: bool,
}

/// A CAN interface.
pub struct SocketCan {
    interface: String,
    filters: Vec<Filter>,
    listen_only: bool,
    open: Option<Open>,
    sender: Option<socketcan::CanSocket>,
    receiver: Box<Receiver>,
    look_at: Instant,
    /// What was last published of the link.
    published: Option<Result<(), String>>,
}

/// The receiving socket, bound to one incarnation of the interface.
struct Open {
    socket: AsyncFd<socketcan::CanSocket>,
    index: u32,
    dropped: u32,
}

impl SocketCan {
    /// Checks what never changes. The interface need not be there yet: its absence is an event, not an error.
    ///
    /// # Errors
    /// [`SourceError::NoCan`] if the kernel has no CAN sockets; [`SourceError::Filters`] if there are too many.
    pub fn new(options: Options) -> Result<Self, SourceError> {
        socket::check_kernel()?;
        Ok(Self {
            filters: filters(&options.wanted)?,
            interface: options.interface,
            listen_only: options.listen_only,
            open: None,
            sender: None,
            receiver: Box::new(Receiver::new()),
            look_at: Instant::now(),
            published: None,
        })
    }

    /// Frames of a length that no classic frame has; the kernel should never hand one over.
    #[must_use]
    pub fn malformed(&self) -> u64 {
        self.receiver.malformed
    }

    /// Opens, closes and asks the kernel, as the link demands.
    fn look(&mut self, batch: &mut Batch) {
        self.look_at = Instant::now() + LOOK_EVERY;
        let link = socket::link(&self.interface);
        let state = match link {
            Link::Absent => {
                self.close();
                Err(format!("there is no interface {}", self.interface))
            }
            Link::Present { index, up, carrier } => {
                if self.open.as_ref().is_some_and(|open| open.index != index) {
                    self.close(); // another device of the same name: the old socket is dead
                }
                let opened = if self.open.is_none() { self.open(index, batch) } else { Ok(()) };
                self.note_drops(batch);
                match opened {
                    Err(error) => Err(format!("{} cannot be opened: {error}", self.interface)),
                    Ok(()) if !up => Err(format!("{} is down", self.interface)),
                    Ok(()) if !carrier => Err(format!("{} is up but off the bus (no carrier)", self.interface)),
                    Ok(()) => Ok(()),
                }
            }
        };
        self.publish(state, batch);
    }

    fn publish(&mut self, state: Result<(), String>, batch: &mut Batch) {
        if self.published.as_ref() != Some(&state) {
            batch.events.push(match &state {
                Ok(()) => BusEvent::Up,
                Err(why) => BusEvent::Down(why.clone()),
            });
            self.published = Some(state);
        }
    }

    fn open(&mut self, index: u32, batch: &mut Batch) -> io::Result<()> {
        let (socket, granted) = socket::receiving(&self.interface, &self.filters)?;
        if granted < socket::BUFFER_BYTES {
            batch.events.push(BusEvent::SmallBuffer { granted, wanted: socket::BUFFER_BYTES });
        }
        let socket = register(socket)?;
        self.sender = if self.listen_only { None } else { Some(socket::sending(&self.interface)?) };
        self.open = Some(Open { socket, index, dropped: 0 });
        Ok(())
    }

    fn close(&mut self) {
        self.open = None;
        self.sender = None;
    }

    fn note_drops(&mut self, batch: &mut Batch) {
        let Some(open) = &mut self.open else { return };
        // The counter beside the frames (SO_RXQ_OVFL) shows a loss only with the next frame; this one at once.
        if let Some(dropped) = socket::drops(open.socket.get_ref().as_raw_fd()) {
            let new = dropped.wrapping_sub(open.dropped);
            open.dropped = dropped;
            if new > 0 {
                batch.events.push(BusEvent::Dropped(u64::from(new)));
            }
        }
    }

    /// Reads until the socket is empty, or until the batch is long enough that its consumer should see it.
    fn drain(&mut self, batch: &mut Batch) {
        let Some(open) = &self.open else { return };
        let first = batch.frames.len();
        let outcome = loop {
            match self.receiver.receive(open.socket.get_ref(), &mut batch.frames) {
                Ok(true) if batch.frames.len() - first < 512 => {}
                Ok(_) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        batch.frames.retain(|timed| match error_frame::event(&timed.frame) {
            Some(event) => {
                batch.events.push(event);
                false
            }
            None => true,
        });
        match outcome.as_ref().map_err(io::Error::raw_os_error) {
            Ok(()) | Err(Some(libc::EAGAIN | libc::EINTR)) => {}
            Err(Some(libc::ENETDOWN)) => self.publish(Err(format!("{} is down", self.interface)), batch),
            Err(_) => {
                let why = outcome.err().map_or_else(String::new, |e| e.to_string());
                self.close();
                self.publish(Err(format!("{}: {why}", self.interface)), batch);
            }
        }
    }
}

fn register(socket: socketcan::CanSocket) -> io::Result<AsyncFd<socketcan::CanSocket>> {
    // SAFETY: the socket owns its descriptor, hands it out only by reference, and is closed after the registration
    // ends, because AsyncFd drops the registration first.
    unsafe { AsyncFd::register(socket) }.map_err(Into::into)
}

impl FrameSource for SocketCan {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        while batch.frames.is_empty() && batch.events.is_empty() {
            if Instant::now() >= self.look_at {
                self.look(batch);
                continue;
            }
            let Some(open) = &self.open else {
                sleep_until(self.look_at).await;
                continue;
            };
            let readable = match timeout_at(self.look_at, open.socket.readable()).await {
                Err(_elapsed) => continue,
                Ok(Ok(mut guard)) => {
                    // Readiness is edge-triggered: forget it before reading, so that what comes meanwhile wakes again.
                    guard.clear_ready();
                    true
                }
                Ok(Err(_)) => false,
            };
            if readable {
                self.drain(batch);
            } else {
                self.close();
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        if self.listen_only {
            return Err(SendError::ListenOnly);
        }
        let interface = || self.interface.clone();
        let fail = |source| SendError::Io { interface: interface(), source };
        let Some(sender) = &self.sender else {
            return Err(fail(io::Error::from_raw_os_error(libc::ENETDOWN)));
        };
        let raw = to_raw(frame).ok_or_else(|| fail(io::Error::from(io::ErrorKind::InvalidInput)))?;
        // A full queue still polls as writable, so waiting for readiness would spin.
        let mut waited = Duration::ZERO;
        let mut pause = Duration::from_millis(1);
        loop {
            match sender.write_frame(&raw) {
                Ok(()) => return Ok(()),
                Err(error) if matches!(error.raw_os_error(), Some(libc::ENOBUFS | libc::EAGAIN)) => {
                    if waited >= SEND_WITHIN {
                        let waited_ms = waited.as_millis() as u64;
                        return Err(SendError::Full { interface: interface(), waited_ms });
                    }
                }
                Err(error) => return Err(fail(error)),
            }
            sleep(pause).await;
            waited += pause;
            pause *= 2;
        }
    }
}

fn to_raw(frame: &Frame) -> Option<CanFrame> {
    let id: socketcan::Id = match frame.id {
        CanId::Standard(id) => StandardId::new(id)?.into(),
        CanId::Extended(id) => ExtendedId::new(id)?.into(),
    };
    match frame.kind {
        FrameKind::Data => CanFrame::new(id, frame.bytes()),
        FrameKind::Remote => CanFrame::new_remote(id, frame.bytes().len()),
        FrameKind::Error => None,
    }
}
