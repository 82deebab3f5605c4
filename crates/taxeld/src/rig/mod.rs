//! Gauges of a vacuum rig that are on no bus of the robot. Each is a bus of its own, on which its readings are frames.

mod link;
#[cfg(test)]
mod tests;

use std::time::Duration;

use taxel_can::{Batch, BusEvent, ClockReading, Pause, Remote, RemoteBus};
use taxel_rig::{Speech, Talk};
use taxel_wire::{TimedFrame, reading};
use tokio::time::{Instant, sleep_until};

pub use link::{At, Link};

/// A gauge that has not said a line for so long has stopped. A micro board that was just plugged in takes two seconds to begin.
const SILENT_AFTER: Duration = Duration::from_secs(3);
/// From one question to the next, for a gauge that has to be asked: a trend needs four readings a second.
pub const ASK_EVERY: Duration = Duration::from_millis(50);
/// A question without an answer is asked again after so long.
const ANSWER_WITHIN: Duration = Duration::from_millis(500);

/// A gauge, and how it talks.
#[derive(Clone, Debug)]
pub struct Line {
    /// Where it is.
    pub at: At,
    /// What is asked, and what it says.
    pub speech: Speech,
}

/// A question as it is sent: on a command line, and in single quotes of TOML, the end of a line is two characters.
pub fn unescaped(text: &str) -> String {
    text.replace("\\r", "\r").replace("\\n", "\n")
}

/// A gauge that is listened to.
pub struct Gauge {
    line: Line,
    open: Option<Open>,
}

/// A gauge as a bus.
pub fn line_bus(line: Line) -> RemoteBus<Gauge> {
    RemoteBus::new(Gauge { line, open: None })
}

struct Open {
    link: Link,
    talk: Talk,
    /// When it said something last, or it was opened.
    heard: Instant,
    /// When it was asked last, and when it is to be asked next.
    asked: Instant,
    ask_at: Instant,
}

impl Remote for Gauge {
    async fn more(&mut self, pause: &mut Pause, batch: &mut Batch) -> Result<(), String> {
        if self.open.is_none() {
            pause.wait().await;
            let link = self.line.at.open().await?;
            let (talk, now) = (Talk::begin(self.line.speech.is_asked()), Instant::now());
            self.open = Some(Open { link, talk, heard: now, asked: now, ask_at: now });
        }
        let Some(open) = &mut self.open else { return Ok(()) };
        let heard = match open.next(&self.line).await {
            Ok(heard) => heard,
            Err(why) => {
                self.open = None;
                return Err(format!("{}: {why}", self.line.at));
            }
        };
        let time = ClockReading::now().time; // a reading is as old as its line
        let (mut unread, mut newest) = (None, None);
        for said in heard {
            match said {
                Ok(value) => newest = value.or(newest),
                Err(why) => unread = Some((unread.map_or(0, |(lines, _)| lines) + 1, why)),
            }
        }
        if let Some(value) = newest {
            // Lines that were read together have one time: the last of them is the pressure then.
            batch.frames.push(TimedFrame { time, frame: reading::frame(0, value) });
            pause.end();
        }
        if let Some((lines, why)) = unread {
            batch.events.push(BusEvent::Unread { lines, why: format!("{}: {why}", self.line.at) });
        }
        Ok(())
    }
}

impl Open {
    /// What it says next, at least one reading or what is none; asks for it where that is needed.
    async fn next(&mut self, line: &Line) -> Result<Vec<Result<Option<f64>, String>>, String> {
        let mut buffer = [0; 1024];
        loop {
            tokio::select! {
                count = self.link.read(&mut buffer) => {
                    let said = self.talk.take(&line.speech, &buffer[..count.map_err(|error| error.to_string())?]);
                    if !said.is_empty() {
                        (self.heard, self.ask_at) = (Instant::now(), self.asked + ASK_EVERY);
                        return Ok(said);
                    }
                }
                () = sleep_until(self.ask_at), if line.speech.is_asked() => {
                    let question = self.talk.question(&line.speech);
                    self.link.write(&question).await.map_err(|error| error.to_string())?;
                    self.asked = Instant::now();
                    self.ask_at = self.asked + ANSWER_WITHIN;
                }
                () = sleep_until(self.heard + SILENT_AFTER) => {
                    let seconds = SILENT_AFTER.as_secs();
                    return Err(match (self.talk.babbles(), line.speech.is_asked()) {
                        (true, _) => "bytes come and no lines: is its rate right? `taxeld scan --serial` tries the rates".to_owned(),
                        (false, false) => format!("no line came for {seconds} s: is the gauge on, or does it need poll?"),
                        (false, true) => format!("no answer came for {seconds} s: is the gauge on?"),
                    });
                }
            }
        }
    }
}
