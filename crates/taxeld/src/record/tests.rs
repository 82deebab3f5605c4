use taxel_can::{Batch, BusError, BusEvent, FrameSource, NotSent, RecordedFrames, SendError, SourceError};
use taxel_mcap::Recording;
use taxel_skin::{BusIndex, Time};
use taxel_wire::{CanId, Frame, FrameKind};
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

use super::*;
use crate::bus::{self, Ends};

/// A bus of which the controller goes off, and nothing more comes.
struct GoesOff(bool);

impl FrameSource for GoesOff {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        if std::mem::replace(&mut self.0, true) {
            let error = std::io::ErrorKind::BrokenPipe.into();
            return Err(SourceError::Runtime { interface: "can7".to_owned(), error });
        }
        let off = Frame::new(CanId::Extended(0x40), FrameKind::Error, &[0; 8]);
        let time = Time::from_nanos(1_000_000_000);
        batch.errors.extend(off.map(|frame| TimedFrame { time, frame }));
        batch.events.push(BusEvent::Error { error: BusError::BusOff, local: false });
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError { id: frame.id, why: NotSent::ListenOnly })
    }
}

/// A bus that is off has no frames, either.
#[tokio::test]
async fn what_the_controller_tells_the_engine_is_recorded() {
    let scratch = tempfile::tempdir().unwrap();
    let limits = Limits {
        budget_bytes: 1 << 30,
        file_bytes: 1 << 20,
        file_age: Duration::MAX,
        keep_free_bytes: 0,
        flush_every: Duration::from_secs(1),
        retry_after: Duration::from_secs(1),
    };
    let topics = vec![Topic { name: "/taxeld/bus/skin".to_owned(), message: "CanFrames" }];
    let folder = Folder::open(scratch.path()).unwrap();
    let (recorder, queue) = Recorder::start(folder, limits, topics, BTreeMap::new(), Box::new(open_file)).unwrap();
    let (to_engine, mut engine) = mpsc::channel(2);
    let (_to_bus, to_send) = mpsc::channel(1);
    let tap = Tap(Some(FrameTap::new(queue, 0, "skin".to_owned(), "can7".to_owned())));
    let ends = Ends { to_engine, to_send, tap };
    bus::run(BusIndex(0), GoesOff(false), ends, CancellationToken::new()).await;
    assert_eq!(engine.recv().await.unwrap().notices, [BusNotice::BusOff]);
    recorder.finish();
    let files = Folder::list(scratch.path()).unwrap();
    let files = files.iter().map(|(name, _)| scratch.path().join(name.to_string()));
    let (mut recording, mut frames) = (Recording::of_files(files, Some("can7".to_owned())), Vec::new());
    assert!(!recording.next_batch(&mut frames, 10));
    let off = Frame::new(CanId::Extended(0x40), FrameKind::Error, &[0; 8]).unwrap();
    assert_eq!(frames.iter().map(|timed| timed.frame).collect::<Vec<_>>(), [off]);
}
