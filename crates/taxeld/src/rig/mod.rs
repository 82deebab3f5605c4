//! Gauges of a vacuum rig that are on no bus of the robot. Each is a bus of its own, on which its readings are frames.

mod link;
#[cfg(test)]
mod tests;

use std::time::Duration;

use taxel_can::{Batch, BusEvent, ClockReading, FrameSource, NotSent, SendError, SourceError};
use taxel_rig::{Lines, Template};
use taxel_wire::{Frame, TimedFrame, reading};
use tokio::time::{Instant, sleep, sleep_until};

pub use link::{At, BAUD_RATES, BAUD_USUAL, Link};

/// Pauses between attempts grow from the first to the second.
const PAUSES: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(5)];
/// A gauge that has not said a line for so long has stopped. A micro board that was just plugged in takes two seconds to begin.
const SILENT_AFTER: Duration = Duration::from_secs(3);
/// A question without an answer is asked again after so long.
const ANSWER_WITHIN: Duration = Duration::from_millis(500);

/// How a gauge talks.
#[derive(Clone, Debug)]
pub struct Line {
    /// Where it is.
    pub at: At,
    /// The rate of a serial device.
    pub baud: u32,
    /// The question that it answers with a line; empty where it prints by itself.
    pub poll: String,
    /// From one question to the next.
    pub every: Duration,
    /// What a line looks like.
    pub template: Template,
}

/// A gauge that prints text, as a bus. Nothing can be sent to it.
pub struct LineBus {
    line: Line,
    open: Option<Open>,
    /// Before the next attempt to open it.
    pause: Duration,
    /// What was told last: that readings come, or why not.
    told: Option<BusEvent>,
}

struct Open {
    link: Link,
    lines: Lines,
    /// When a line came last, or it was opened.
    heard: Instant,
    /// When it was asked last, and when it is to be asked next.
    asked: Instant,
    ask_at: Instant,
    /// Whether bytes came that made no line.
    babbles: bool,
}

impl LineBus {
    /// Reads this line.
    pub const fn new(line: Line) -> Self {
        Self { line, open: None, pause: Duration::ZERO, told: None }
    }

    /// After a pause that grows until a reading comes.
    async fn connect(&mut self) -> Result<Open, String> {
        sleep(self.pause).await;
        self.pause = (2 * self.pause).clamp(PAUSES[0], PAUSES[1]);
        let link = self.line.at.open(self.line.baud).await?;
        let lines = if self.line.poll.is_empty() { Lines::default() } else { Lines::from_the_first() };
        let now = Instant::now();
        Ok(Open { link, lines, heard: now, asked: now, ask_at: now, babbles: false })
    }

    /// Waits for lines and appends what they say; or why none came.
    async fn more(&mut self, batch: &mut Batch) -> Result<(), String> {
        if self.open.is_none() {
            self.open = Some(self.connect().await?);
        }
        let Some(open) = &mut self.open else { return Ok(()) };
        let heard = match open.lines_of(&self.line).await {
            Ok(heard) => heard,
            Err(why) => {
                self.open = None;
                return Err(format!("{}: {why}", self.line.at));
            }
        };
        let time = ClockReading::now().time; // a reading is as old as its line
        let (mut unread, mut newest) = (None, None);
        for line in &heard {
            match self.line.template.read(line) {
                Ok(value) => newest = Some(value),
                Err(why) => unread = Some((unread.map_or(0, |(lines, _)| lines) + 1, why)),
            }
        }
        if let Some(value) = newest {
            // Lines that were read together have one time: the last of them is the pressure then.
            batch.frames.push(TimedFrame { time, frame: reading::frame(0, value) });
            self.pause = Duration::ZERO;
        }
        if let Some((lines, why)) = unread {
            batch.events.push(BusEvent::Unread { lines, why: format!("{}: {why}", self.line.at) });
        }
        Ok(())
    }
}

impl Open {
    /// The next lines, at least one; asks for them where that is needed.
    async fn lines_of(&mut self, line: &Line) -> Result<Vec<String>, String> {
        let mut buffer = [0; 1024];
        loop {
            tokio::select! {
                count = self.link.read(&mut buffer) => {
                    let mut lines = self.lines.take(&buffer[..count.map_err(|error| error.to_string())?]);
                    self.babbles = self.lines.is_endless();
                    lines.retain(|said| said != line.poll.trim()); // an echo of the question
                    if !lines.is_empty() {
                        (self.heard, self.ask_at) = (Instant::now(), self.asked + line.every);
                        return Ok(lines);
                    }
                }
                () = sleep_until(self.ask_at), if !line.poll.is_empty() => {
                    self.link.write(line.poll.as_bytes()).await.map_err(|error| error.to_string())?;
                    self.asked = Instant::now();
                    self.ask_at = self.asked + ANSWER_WITHIN;
                }
                () = sleep_until(self.heard + SILENT_AFTER) => {
                    let seconds = SILENT_AFTER.as_secs();
                    return Err(match (self.babbles, line.poll.is_empty()) {
                        (true, _) => "bytes come and no lines: is baud right? `taxeld scan --serial` tries the rates".to_owned(),
                        (false, true) => format!("no line came for {seconds} s: is the gauge on, or does it need poll?"),
                        (false, false) => format!("no answer to poll came for {seconds} s: is the gauge on?"),
                    });
                }
            }
        }
    }
}

impl FrameSource for LineBus {
    async fn next(&mut self, batch: &mut Batch) -> Result<(), SourceError> {
        batch.clear();
        while batch.is_empty() {
            let event = match self.more(batch).await {
                Ok(()) => BusEvent::Up,
                Err(why) => BusEvent::SourceDown { why },
            };
            if self.told.as_ref() != Some(&event) {
                self.told = Some(event.clone());
                batch.events.push(event);
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: &Frame) -> Result<(), SendError> {
        Err(SendError { id: frame.id, why: NotSent::ListenOnly })
    }
}
