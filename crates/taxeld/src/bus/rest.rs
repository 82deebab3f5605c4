//! The pauses of a bus task, timed by an alarm.

use std::future::pending;

use taxel_can::{Batch, ClockReading};
use taxel_skin::Time;
use taxel_ticks::Alarm;

use super::rhythm::{Pause, Rhythm};

/// Whether a bus task rests, and until when.
pub struct Rest {
    /// Absent where there are no pauses: in a replay, whose clock is not the machine's.
    rhythm: Option<(Rhythm, Alarm)>,
    pause: Option<Pause>,
    on: bool,
}

impl Rest {
    /// Never.
    pub fn never() -> Self {
        Self { rhythm: None, pause: None, on: false }
    }

    /// By this rhythm. Without a timer, never.
    pub fn by(rhythm: Rhythm) -> Self {
        let alarm = Alarm::new();
        if let Err(error) = &alarm {
            tracing::warn!(%error, "no timer for the pauses of a bus: each frame wakes the daemon");
        }
        Self { rhythm: alarm.ok().map(|alarm| (rhythm, alarm)), pause: None, on: false }
    }

    /// Whether the task rests at present.
    pub fn is_on(&self) -> bool {
        self.on
    }

    /// Waits for the end of the pause.
    pub async fn over(&mut self) {
        let Some((_, alarm)) = &self.rhythm else { return pending().await };
        if let Err(error) = alarm.rung().await {
            tracing::warn!(%error, "the timer for the pauses of a bus: each frame wakes the daemon from now on");
            self.rhythm = None;
        }
        self.on = false;
    }

    /// The boards were spoken to: the pause is over, and their rhythm has to be learned anew.
    pub fn forget(&mut self) {
        (self.on, self.pause) = (false, None);
        if let Some((rhythm, _)) = &mut self.rhythm {
            rhythm.forget();
        }
    }

    /// Learns from what was read, and begins a pause if there is nothing to wait for.
    pub fn after(&mut self, batch: &Batch) {
        let Some((rhythm, alarm)) = &mut self.rhythm else { return };
        rhythm.hear(&batch.frames, self.pause.take());
        if !batch.events.is_empty() {
            rhythm.forget();
        }
        let begun = ClockReading::now().time;
        if let Some(until) = rhythm.pause(begun)
            && alarm.set(until.since(Time::default())).is_ok()
        {
            (self.on, self.pause) = (true, Some(Pause { begun, until }));
        }
    }
}
