//! One task per bus: it alone reads and writes the bus, and hands everything to the engine's task.

use taxel_can::{Batch, BusError, BusEvent, FrameSource};
use taxel_engine::BusNotice;
use taxel_skin::BusIndex;
use taxel_wire::Frame;
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

use crate::queues::BusBatch;
use crate::record::Tap;

/// Batches that may wait for the engine: a batch is at least one frame, so that at the 9,009 frames/s of a full bus the
/// engine may be 7 ms behind before a bus waits, and then the kernel's buffer holds another half second and counts.
pub const BATCHES_WAITING_MAX: usize = 64;

/// Frames that may wait to be sent: a bring-up sends four commands a board to at most fourteen boards, spread in time.
pub const FRAMES_WAITING_MAX: usize = 64;

/// What a bus is connected to.
pub struct Ends {
    /// Everything that is read goes there.
    pub to_engine: mpsc::Sender<BusBatch>,
    /// What is to be sent.
    pub to_send: mpsc::Receiver<Frame>,
    /// Where it is recorded.
    pub tap: Tap,
}

/// Runs a source until it ends or is cancelled. Each frame wakes the task.
pub async fn run(
    bus: BusIndex,
    mut source: impl FrameSource,
    Ends { to_engine, mut to_send, mut tap }: Ends,
    cancel: CancellationToken,
) {
    let mut batch = Batch::default();
    loop {
        tokio::select! {
            () = cancel.cancelled() => return,
            Some(frame) = to_send.recv() => {
                if let Err(error) = source.send(&frame).await {
                    tracing::warn!(bus = bus.0, %error, "a command to a board was not sent");
                }
            }
            next = source.next(&mut batch) => {
                if let Err(error) = next {
                    tracing::error!(bus = bus.0, %error, "the bus cannot be read any more");
                    let notices = vec![BusNotice::Down(error.to_string())];
                    let _ = to_engine.send(BusBatch { bus, frames: Vec::new(), notices }).await;
                    return;
                }
                let notices: Vec<_> = batch.events.drain(..).filter_map(|event| notice(bus, event)).collect();
                let frames = std::mem::take(&mut batch.frames);
                tap.look(&frames, &batch.errors, &notices);
                if to_engine.send(BusBatch { bus, frames, notices }).await.is_err() {
                    return;
                }
            }
        }
    }
}

/// Logs an event once and tells the engine what concerns it.
fn notice(bus: BusIndex, event: BusEvent) -> Option<BusNotice> {
    let bus = bus.0;
    match &event {
        BusEvent::Up | BusEvent::BufferGranted { .. } => tracing::info!(bus, "{event}"),
        BusEvent::Unread { .. } | BusEvent::Error { .. } => tracing::debug!(bus, "{event}"),
        _ => tracing::warn!(bus, "{event}"),
    }
    match event {
        BusEvent::Up => Some(BusNotice::Up),
        BusEvent::Down { reason } => Some(BusNotice::Down(reason.to_string())),
        BusEvent::SourceDown { why } => Some(BusNotice::Down(why)),
        BusEvent::Dropped { frames } => Some(BusNotice::Dropped(frames)),
        BusEvent::Unread { lines, why } => Some(BusNotice::Unread(lines, why)),
        BusEvent::Malformed { .. } => None,
        BusEvent::BufferGranted { bytes, wanted } => {
            if bytes < wanted {
                tracing::warn!(bus, "the receive buffer holds less than 0.5 s of a full bus: raise net.core.rmem_max");
            }
            None
        }
        // The kernel marks what a process of this machine sent, and that anybody may: it is not the controller's.
        BusEvent::Error { error, local } => (!local).then(|| of_controller(&error)),
    }
}

/// What an error means that the controller reports, or the recording of one.
pub fn of_controller(error: &BusError) -> BusNotice {
    match error {
        BusError::BusOff => BusNotice::BusOff,
        BusError::Active(_) | BusError::Restarted => BusNotice::ControllerRecovered(error.to_string()),
        other => BusNotice::ControllerError(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(error: BusError, local: bool) -> Option<BusNotice> {
        notice(BusIndex(0), BusEvent::Error { error, local })
    }

    #[test]
    fn an_error_frame_of_a_process_of_this_machine_is_no_error_of_the_bus() {
        assert_eq!(told(BusError::BusOff, true), None);
        assert_eq!(told(BusError::BusOff, false), Some(BusNotice::BusOff));
    }

    #[test]
    fn what_the_controller_reports_is_told_in_words() {
        let words = "error-passive: very many errors on the bus".to_owned();
        assert_eq!(told(BusError::Passive(None), false), Some(BusNotice::ControllerError(words)));
        let words = "error-active: the errors have become few again".to_owned();
        assert_eq!(told(BusError::Active(None), false), Some(BusNotice::ControllerRecovered(words)));
    }
}
