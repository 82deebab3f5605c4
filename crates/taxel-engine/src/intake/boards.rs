//! What is known of a board beside its counts, and when its zero can no longer be trusted.

use std::time::Duration;
use taxel_skin::Time;
use taxel_wire::icub::{FirmwareVersion, Message, StatusWord};

use crate::plan::LiveLimits;

/// MTB3 and MTB4 take their zero anew, without a word, after this many lost acknowledgements (icub-firmware).
const NO_ACKS_TO_SILENT_TARE: u32 = 5;

/// A board that was not heard for so long does not stream: three of the longest periods.
pub const SILENT_AFTER: Duration = Duration::from_millis(300);

/// Why a board's zero may be another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suspicion {
    /// In words that name the board.
    pub why: String,
    /// Whether the board has surely taken a new zero, or may have lost it unnoticed. Else the counts have to show it.
    pub certain: bool,
}

/// What one patch learns of a board that another patch has, too.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BoardNews {
    /// A module of it came whole, with this status.
    Heard(Time, StatusWord),
    /// It said something of itself.
    Said(Message),
    /// The counts of its modules show that it has a new zero; why.
    Moved(String),
}

/// What is learnt of a board's zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ZeroSign {
    /// It may have another.
    Suspect(Suspicion),
    /// It is a described device that is not well from now on.
    Unwell,
    /// It is one that is well again, and why it is suspect.
    Well(Suspicion),
    /// It has a new one: the counts of another patch that has modules of it have shown that; why, in words that name the board.
    Moved(String),
}

/// One board.
#[derive(Clone, Debug, Default)]
pub struct BoardState {
    /// `board 13`, to begin a sentence with.
    name: String,
    last: Option<Time>,
    status_errors: u64,
    /// Since the board was last known to begin its own count anew.
    no_acks: u32,
    overflows: u64,
    /// From when to when the host may have lost frames, as reported last: so much of a silence need not be the board's.
    lost: Option<[Time; 2]>,
    /// Since when a described device has said that it is not well.
    unwell_since: Option<Time>,
    celsius: Option<f64>,
    firmware: Option<FirmwareVersion>,
}

impl BoardState {
    /// Nothing heard of the board of this name.
    pub fn new(name: String) -> Self {
        Self { name, ..Self::default() }
    }

    /// A described device sent counts, and `is_well` or not by its own status. While it is not it may take a new zero, as one
    /// does that starts or calibrates itself, and its counts show nothing. Returns what is new.
    pub fn on_device(&mut self, time: Time, is_well: bool, limits: &LiveLimits) -> Option<ZeroSign> {
        match (is_well, self.unwell_since) {
            (false, None) => {
                self.unwell_since = Some(time);
                Some(ZeroSign::Unwell)
            }
            (true, Some(since)) => {
                self.unwell_since = None;
                let unwell = time.since(since);
                let seconds = unwell.as_secs_f64();
                let name = &self.name;
                let why =
                    format!("{name} was not well by its own status for {seconds:.2} s and may have taken a new zero");
                Some(ZeroSign::Well(Suspicion { why, certain: unwell > limits.power_cycle_after }))
            }
            _ => None,
        }
    }

    /// A module of the board came whole. Returns why the board is suspect, if it is.
    pub fn on_module(&mut self, time: Time, status: StatusWord, limits: &LiveLimits) -> Option<Suspicion> {
        let silence = self.last.map(|last| time.since(last));
        let unheard = self.last.map_or(Duration::ZERO, |last| self.lost_between(last, time));
        self.last = Some(time);
        self.status_errors += u64::from(!status.is_ok());
        let no_ack = status.no_ack().then(|| self.on_no_ack()); // counted whatever else is found
        if let Some(silence) = silence.filter(|&s| s > limits.stale_after) {
            let seconds = silence.as_secs_f64();
            if silence.saturating_sub(unheard) > limits.power_cycle_after {
                self.no_acks = 0; // it counts from its start, too
                let why = format!("{} was silent for {seconds:.1} s and may have lost its power", self.name);
                return Some(Suspicion { why, certain: true });
            }
            let why = format!("{} was not heard for {seconds:.2} s", self.name);
            let not_heard = Suspicion { why, certain: false };
            return no_ack.filter(|suspicion| suspicion.certain).or(Some(not_heard));
        }
        no_ack
    }

    /// How far the board's own count was when we began to listen is not known, so any lost acknowledgement may be the
    /// one that makes it take a new zero; of five, one surely did.
    fn on_no_ack(&mut self) -> Suspicion {
        self.no_acks += 1;
        let certain = self.no_acks >= NO_ACKS_TO_SILENT_TARE;
        let name = &self.name;
        let why = if certain {
            self.no_acks = 0;
            format!(
                "{name} reported {NO_ACKS_TO_SILENT_TARE} lost acknowledgements and then takes a new zero by itself"
            )
        } else {
            format!("{name} reported a lost acknowledgement and may have taken a new zero")
        };
        Suspicion { why, certain }
    }

    /// Whether it streams.
    pub fn is_heard(&self, now: Time) -> bool {
        self.last.is_some_and(|last| now.since(last) <= SILENT_AFTER)
    }

    /// It is configured anew, and its counts of everything begin anew with it.
    pub const fn on_bring_up(&mut self) {
        self.no_acks = 0;
    }

    /// The host may have lost frames of so long a time before `now`. Times that overlap are one: none is lost twice.
    pub fn on_frames_lost(&mut self, now: Time, gap: Duration) {
        let begin = now - gap;
        self.lost = match self.lost {
            Some([from, to]) if begin <= to => Some([from.min(begin), to.max(now)]),
            _ => Some([begin, now]),
        };
    }

    fn lost_between(&self, from: Time, to: Time) -> Duration {
        self.lost.map_or(Duration::ZERO, |[begin, end]| end.min(to).since(begin.max(from)))
    }

    /// It said something of itself.
    pub fn on_message(&mut self, message: Message) {
        match message {
            Message::Thermometer { deci_celsius, .. } => self.celsius = Some(f64::from(deci_celsius) / 10.0),
            Message::FirmwareVersion { version, .. } => self.firmware = Some(version),
            Message::BoardOverflow { .. } => self.overflows += 1,
            Message::Head { .. } | Message::Tail { .. } => {} // a module that the plan does not read
        }
    }

    /// Tails whose status word named a trouble.
    pub const fn status_errors(&self) -> u64 {
        self.status_errors
    }

    /// Temperature in Celsius, where the board sends it.
    pub const fn celsius(&self) -> Option<f64> {
        self.celsius
    }

    /// Firmware in words.
    pub fn firmware(&self) -> Option<String> {
        self.firmware.map(|f| {
            let ((major, minor, build), protocol) = (f.app, f.protocol);
            format!("type {}, {major}.{minor}.{build}, protocol {}.{}", f.board_type, protocol.0, protocol.1)
        })
    }

    /// What an operator should know of it.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(f) = self.firmware.filter(FirmwareVersion::loses_arbitrated_frames) {
            let (major, minor, _) = f.app;
            warnings
                .push(format!("firmware {major}.{minor} does not retransmit: lost frames are normal; update to 1.25"));
        }
        if self.overflows > 0 {
            warnings.push(format!("discarded its send queue {} times", self.overflows));
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: &LiveLimits = &LiveLimits {
        stale_after: Duration::from_millis(150),
        stale_share_max: 0.2,
        power_cycle_after: Duration::from_secs(1),
    };

    /// Whether a board is suspect, and for certain, that was silent from 1 s on for so long, of which the host may have heard nothing in these
    /// gaps, from and to, seconds.
    fn after(silence_s: f64, gaps_s: &[[f64; 2]]) -> Option<bool> {
        let mut board = BoardState::default();
        let suspicion = board.on_module(Time::from_seconds(1.0), StatusWord(0), LIMITS);
        assert_eq!(suspicion, None);
        for [from_s, to_s] in gaps_s {
            board.on_frames_lost(Time::from_seconds(*to_s), Duration::from_secs_f64(to_s - from_s));
        }
        let suspicion = board.on_module(Time::from_seconds(1.0 + silence_s), StatusWord(0), LIMITS);
        let again = board.on_module(Time::from_seconds(8.0 + silence_s), StatusWord(0), LIMITS);
        assert!(again.is_some_and(|suspicion| suspicion.certain), "a gap excuses one silence");
        suspicion.map(|suspicion| suspicion.certain)
    }

    #[test]
    fn a_gap_of_the_host_excuses_as_much_of_a_silence_as_it_was_long() {
        assert_eq!(after(0.1, &[]), None);
        assert_eq!(after(0.9, &[]), Some(false));
        assert_eq!(after(5.0, &[]), Some(true));
        assert_eq!(after(5.0, &[[2.0, 2.11]]), Some(true), "the host stood still for a moment");
        assert_eq!(after(5.0, &[[1.2, 5.7]]), Some(false));
        assert_eq!(after(1.4, &[[1.5, 2.0]]), Some(false));
        assert_eq!(after(1.4, &[[0.0, 0.9]]), Some(true), "before the silence");
        assert_eq!(after(3.0, &[[1.2, 1.3], [3.5, 3.9]]), Some(true), "the host may have heard in between");
        assert_eq!(after(3.0, &[[1.2, 2.0], [2.0, 3.2]]), Some(false));
        // A buffer that hovers at its end tells of it many times a second, and the host stood still besides.
        let hovering = (0..8).map(|n| 1.1 + 0.05 * f64::from(n)).map(|to_s| [to_s - 0.5, to_s]);
        let twice: Vec<[f64; 2]> = hovering.chain([[1.1, 1.5]]).collect();
        assert_eq!(after(3.0, &twice), Some(true), "the same time excuses no silence twice");
    }

    /// The host stood still for 1.8 s, and its buffer held the first half second of that.
    #[test]
    fn frames_of_the_beginning_of_a_gap_use_up_none_of_it() {
        let mut board = BoardState::default();
        board.on_module(Time::from_seconds(1.0), StatusWord(0), LIMITS);
        board.on_frames_lost(Time::from_seconds(2.8), Duration::from_secs_f64(1.8));
        assert_eq!(board.on_module(Time::from_seconds(1.05), StatusWord(0), LIMITS), None);
        board.on_frames_lost(Time::from_seconds(2.81), Duration::from_millis(500));
        assert_eq!(board.on_module(Time::from_seconds(1.15), StatusWord(0), LIMITS), None);
        let suspicion = board.on_module(Time::from_seconds(2.85), StatusWord(0), LIMITS).unwrap();
        assert!(!suspicion.certain, "{suspicion:?}");
    }

    #[test]
    fn up_to_a_limit_nothing_is_suspect_and_nothing_is_certain() {
        assert_eq!((after(0.15, &[]), after(0.16, &[])), (None, Some(false)));
        assert_eq!((after(1.0, &[]), after(1.01, &[])), (Some(false), Some(true)));
        let mut board = BoardState::default();
        let mut unwell_for = |seconds: f64| {
            board.on_device(Time::from_seconds(5.0), false, LIMITS);
            match board.on_device(Time::from_seconds(5.0 + seconds), true, LIMITS) {
                Some(ZeroSign::Well(suspicion)) => suspicion.certain,
                news => panic!("{news:?}"),
            }
        };
        assert!(!unwell_for(1.0) && unwell_for(1.01));
    }

    #[test]
    fn what_a_board_says_of_itself_is_told_in_words() {
        let mut board = BoardState::default();
        assert_eq!((board.firmware(), board.celsius(), board.warnings()), (None, None, Vec::new()));
        let sender = taxel_skin::BoardAddress::new(13).unwrap();
        board.on_message(Message::Thermometer { board: sender, deci_celsius: -15 });
        let firmware = |app| {
            let version = FirmwareVersion { board_type: 11, app, protocol: (1, 2), compatible: true };
            Message::FirmwareVersion { board: sender, version }
        };
        board.on_message(firmware((1, 24, 3)));
        (0..2).for_each(|_| board.on_message(Message::BoardOverflow { board: sender }));
        assert_eq!(board.firmware().unwrap(), "type 11, 1.24.3, protocol 1.2");
        assert_eq!(board.celsius(), Some(-1.5));
        let warnings = board.warnings();
        assert!(warnings[0].starts_with("firmware 1.24 does not retransmit"), "{warnings:?}");
        assert_eq!(warnings[1..], ["discarded its send queue 2 times"]);
        board.on_message(firmware((1, 25, 0)));
        assert_eq!(board.warnings().len(), 1);
    }
}
