//! The state of buses and boards, as an operator has to know it.

use taxel_skin::Time;

/// What a bus tells beside its frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusNotice {
    /// Frames can come again.
    Up,
    /// No frame can come; why.
    Down(String),
    /// The kernel lost so many frames that this process had asked for.
    Dropped(u64),
    /// So much came that is no reading of the gauge on the line; why the last of it is none.
    Unread(u64, String),
    /// The controller reported an error (bus-off, error-passive, ...).
    ControllerError(String),
    /// The controller reported that errors have become few again; in words.
    ControllerRecovered(String),
    /// The controller left the bus: nothing it sends can be trusted until it is back.
    BusOff,
}

/// One bus, live.
#[derive(Clone, Debug, Default)]
pub struct BusState {
    /// What the world sees.
    pub health: BusHealth,
    /// The problem is an error that the controller reported, and not why no frame can come.
    reported: bool,
    /// When it was reported last that no frame can come.
    down_at: Option<Time>,
}

impl BusState {
    /// Frames came, the newest of them received at this time: the bus is up, whatever was reported before. Those that were
    /// received before it went down say nothing: what a socket holds then is read after the error. Gives whether that is
    /// news.
    pub fn on_frames(&mut self, received: Time) -> bool {
        if self.down_at.is_some_and(|down| received <= down) {
            return false;
        }
        let news = !std::mem::replace(&mut self.health.up, true);
        if news {
            self.health.problem.clear();
        }
        news
    }

    /// Counts a frame, or a scan that was handed over, whose content is not one of ours; which, and why.
    pub fn refuse(&mut self, why: String) {
        self.health.malformed += 1;
        self.health.last_malformed = why;
    }

    /// Takes a notice that comes `now`; returns why the boards are suspect, if they are.
    pub fn on_notice(&mut self, now: Time, notice: BusNotice) -> Option<String> {
        let health = &mut self.health;
        match notice {
            BusNotice::Up => {
                (health.up, self.down_at) = (true, None);
                health.problem.clear();
            }
            BusNotice::Down(why) => self.on_down(now, why),
            BusNotice::Dropped(frames) => health.dropped += frames,
            BusNotice::Unread(lines, why) => {
                health.malformed += lines;
                health.last_malformed = why;
            }
            BusNotice::ControllerError(what) => (health.problem, self.reported) = (what, true),
            BusNotice::ControllerRecovered(_) if self.reported => health.problem.clear(),
            BusNotice::ControllerRecovered(_) => {}
            BusNotice::BusOff => {
                self.on_down(now, "bus-off: the controller left the bus".to_owned());
                return Some("the controller went bus-off; boards may have lost their zero meanwhile".to_owned());
            }
        }
        None
    }

    fn on_down(&mut self, now: Time, why: String) {
        (self.health.up, self.health.problem) = (false, why);
        (self.reported, self.down_at) = (false, Some(now));
    }
}

/// One bus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BusHealth {
    /// Whether frames can come.
    pub up: bool,
    /// Why not, or the last error the controller reported.
    pub problem: String,
    /// Frames that were understood.
    pub frames: u64,
    /// Frames whose identifier concerns nobody here.
    pub foreign: u64,
    /// Frames with an identifier of ours and a content that is not.
    pub malformed: u64,
    /// Text of the last malformed one.
    pub last_malformed: String,
    /// Frames lost in the kernel.
    pub dropped: u64,
}

/// One board.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardHealth {
    /// Its patch.
    pub patch: String,
    /// Its bus.
    pub bus: u8,
    /// Its address.
    pub address: u8,
    /// What bring-up has come to: `listening`, `configuring`, `verified`, `incomplete: ...`.
    pub bring_up: String,
    /// Modules that are enabled, and those of them that are fresh.
    pub modules: (u32, u32),
    /// Whole modules received.
    pub scans: u64,
    /// Heads without tail and tails without head.
    pub orphans: u64,
    /// Tails whose status word named a trouble.
    pub status_errors: u64,
    /// Temperature in Celsius, where the board sends it.
    pub celsius: Option<f64>,
    /// Firmware, where the board answered.
    pub firmware: Option<String>,
    /// Warnings about it.
    pub warnings: Vec<String>,
}
