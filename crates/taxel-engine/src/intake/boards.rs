//! What is known of a board beside its counts, and when its zero can no longer be trusted.

use std::time::Duration;
use taxel_skin::Time;
use taxel_wire::icub::{FirmwareVersion, Message, StatusWord};

/// MTB3 and MTB4 take their zero anew, without a word, after this many lost acknowledgements (icub-firmware).
const NO_ACKS_TO_SILENT_TARE: u32 = 5;

/// Why a board's zero is in doubt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardDoubt {
    /// In words, to follow "board 13".
    pub why: String,
    /// Whether the board has surely taken a new zero, or may have lost it unseen. Else the counts have to show it.
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

/// How long a board may be silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SilenceLimits {
    /// After a longer silence its zero is in doubt.
    pub doubt_after: Duration,
    /// After a longer silence it may have lost its power.
    pub power_cycle_after: Duration,
}

/// One board.
#[derive(Clone, Debug, Default)]
pub struct BoardState {
    last: Option<Time>,
    status_errors: u64,
    /// Since the board was last known to begin its own count anew.
    no_acks: u32,
    overflows: u64,
    /// Of so long a time since the board was last heard the host may have lost frames: so much of a silence need not be the
    /// board's.
    unheard: Duration,
    /// Until when that is counted: the same time is not lost twice.
    unheard_until: Option<Time>,
    /// Since when a described device has said that it is not well.
    unwell_since: Option<Time>,
    celsius: Option<f64>,
    firmware: Option<FirmwareVersion>,
}

impl BoardState {
    /// A described device sent counts, and `is_well` or not by its own status. While it is not it may take a new zero, as one
    /// does that starts or calibrates itself, and its counts show nothing: as with a silence, what lay on it before is
    /// compared with what it reads afterwards.
    pub fn on_device(&mut self, time: Time, is_well: bool, limits: SilenceLimits) -> Option<BoardDoubt> {
        let begun = self.unwell_since;
        self.unwell_since = (!is_well).then(|| begun.unwrap_or(time));
        let seconds = time.since(begun.or(self.unwell_since)?);
        let why = format!(
            "has not been well by its own status for {:.2} s and may have taken a new zero",
            seconds.as_secs_f64()
        );
        Some(BoardDoubt { why, certain: seconds > limits.power_cycle_after })
    }

    /// A module of the board came whole. Returns why the board's zero is in doubt, if it is.
    pub fn on_module(&mut self, time: Time, status: StatusWord, limits: SilenceLimits) -> Option<BoardDoubt> {
        let silence = self.last.map(|last| time.since(last));
        let unheard = std::mem::take(&mut self.unheard);
        self.last = Some(time);
        self.status_errors += u64::from(!status.is_ok());
        let no_ack = status.no_ack().then(|| self.on_no_ack()); // counted whatever else is found
        if let Some(silence) = silence.filter(|&s| s > limits.doubt_after) {
            let seconds = silence.as_secs_f64();
            if silence.saturating_sub(unheard) > limits.power_cycle_after {
                self.no_acks = 0; // it counts from its start, too
                let why = format!("was silent for {seconds:.1} s and may have lost its power");
                return Some(BoardDoubt { why, certain: true });
            }
            let not_heard = BoardDoubt { why: format!("was not heard for {seconds:.2} s"), certain: false };
            return no_ack.filter(|doubt| doubt.certain).or(Some(not_heard));
        }
        no_ack
    }

    /// How far the board's own count was when we began to listen is not known, so any lost acknowledgement may be the
    /// one that makes it take a new zero; of five, one surely did.
    fn on_no_ack(&mut self) -> BoardDoubt {
        self.no_acks += 1;
        let certain = self.no_acks >= NO_ACKS_TO_SILENT_TARE;
        if certain {
            self.no_acks = 0;
            let why =
                format!("reported {NO_ACKS_TO_SILENT_TARE} lost acknowledgements and then takes a new zero by itself");
            return BoardDoubt { why, certain };
        }
        BoardDoubt { why: "reported a lost acknowledgement and may have taken a new zero".to_owned(), certain }
    }

    /// It is configured anew, and its counts of everything begin anew with it.
    pub const fn on_bring_up(&mut self) {
        self.no_acks = 0;
    }

    /// The host may have lost frames of so long a time before `now`.
    pub fn on_frames_lost(&mut self, now: Time, gap: Duration) {
        let counted = self.unheard_until.replace(now);
        let since = counted.map_or(gap, |until| gap.min(now.since(until)));
        self.unheard = self.unheard.saturating_add(since);
    }

    /// It discarded its send queue.
    pub fn on_overflow(&mut self) {
        self.overflows += 1;
    }

    /// Its thermometer, in tenths of a degree Celsius.
    pub fn on_temperature(&mut self, deci_celsius: i16) {
        self.celsius = Some(f64::from(deci_celsius) / 10.0);
    }

    /// It told its firmware.
    pub fn on_firmware(&mut self, firmware: FirmwareVersion) {
        self.firmware = Some(firmware);
    }

    /// Tails whose status word named a trouble.
    #[must_use]
    pub const fn status_errors(&self) -> u64 {
        self.status_errors
    }

    /// Temperature in Celsius, where the board sends it.
    #[must_use]
    pub const fn celsius(&self) -> Option<f64> {
        self.celsius
    }

    /// Firmware in words.
    #[must_use]
    pub fn firmware(&self) -> Option<String> {
        self.firmware.map(|f| {
            let ((major, minor, build), protocol) = (f.app, f.protocol);
            format!("type {}, {major}.{minor}.{build}, protocol {}.{}", f.board_type, protocol.0, protocol.1)
        })
    }

    /// What an operator should know of it.
    #[must_use]
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

    const LIMITS: SilenceLimits =
        SilenceLimits { doubt_after: Duration::from_millis(150), power_cycle_after: Duration::from_secs(1) };

    /// What is held against a board that was silent for so long, of which the host heard nothing in these gaps, seconds.
    fn after(silence_s: f64, gaps_s: &[f64]) -> Option<bool> {
        let mut board = BoardState::default();
        let doubt = board.on_module(Time::from_seconds(1.0), StatusWord(0), LIMITS);
        assert_eq!(doubt, None);
        let gaps = gaps_s.iter().enumerate();
        gaps.for_each(|(n, gap)| {
            board.on_frames_lost(Time::from_seconds(1.5 + n as f64), Duration::from_secs_f64(*gap));
        });
        let doubt = board.on_module(Time::from_seconds(1.0 + silence_s), StatusWord(0), LIMITS);
        let again = board.on_module(Time::from_seconds(3.0 + silence_s), StatusWord(0), LIMITS);
        assert!(again.is_some_and(|doubt| doubt.certain), "a gap excuses one silence");
        doubt.map(|doubt| doubt.certain)
    }

    #[test]
    fn a_gap_of_the_host_excuses_as_much_of_a_silence_as_it_was_long() {
        assert_eq!(after(0.1, &[]), None);
        assert_eq!(after(0.9, &[]), Some(false));
        assert_eq!(after(5.0, &[]), Some(true));
        assert_eq!(after(5.0, &[0.11]), Some(true), "the host stood still for a moment");
        assert_eq!(after(5.0, &[4.5]), Some(false));
        assert_eq!(after(1.4, &[0.25, 0.25]), Some(false));
    }

    #[test]
    fn a_device_that_is_not_well_is_doubted_until_it_is_and_once_more_then() {
        let mut board = BoardState::default();
        let mut certain = |ms: i64, is_well| {
            board.on_device(Time::from_nanos(ms * 1_000_000), is_well, LIMITS).map(|doubt| doubt.certain)
        };
        assert_eq!([certain(0, true), certain(20, true)], [None, None]);
        assert_eq!([certain(40, false), certain(60, false), certain(840, true)], [Some(false); 3]);
        assert_eq!(certain(860, true), None);
        assert_eq!([certain(1_000, false), certain(2_000, false)], [Some(false); 2]);
        assert_eq!([certain(2_001, false), certain(3_000, true), certain(3_020, true)], [Some(true), Some(true), None]);
    }

    #[test]
    fn the_same_time_excuses_no_silence_twice() {
        let mut board = BoardState::default();
        board.on_module(Time::from_seconds(1.0), StatusWord(0), LIMITS);
        // A buffer that hovers at its end tells of it many times a second, and the host stood still besides.
        for n in 0..8 {
            board.on_frames_lost(Time::from_seconds(1.1 + 0.05 * f64::from(n)), Duration::from_millis(500));
        }
        board.on_frames_lost(Time::from_seconds(1.5), Duration::from_millis(400));
        let doubt = board.on_module(Time::from_seconds(3.0), StatusWord(0), LIMITS).unwrap();
        assert!(doubt.certain, "{doubt:?}");
    }
}
