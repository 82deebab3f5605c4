//! Why a procedure was ended, in words that say what to do.

use std::fmt;
use std::time::Duration;

/// No gauge of a vented bag reads more at the beginning, kPa.
pub(super) const AT_REST_MAX_KPA: f64 = 2.0;
/// The self-test rises to this, kPa.
pub(super) const TEST_KPA: f64 = 5.0;
/// The leak is read at this pressure, kPa; a bag may lose so much (kPa/min).
pub(super) const LEAK_KPA: f64 = 20.0;
pub(super) const LEAK_MAX_KPA_PER_MIN: f64 = 3.4;

/// Why a procedure was ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Stop {
    /// Somebody asked for it.
    Asked(String),
    /// This program did not run for so long.
    Held(Duration),
    /// The gauge has said nothing for so long.
    GaugeSilent(Duration),
    /// The drive has not answered for so long, or with another set point than it was given.
    DriveSilent(Duration),
    /// The bag is beyond the limit.
    TooHigh {
        /// What the gauge reads, kPa.
        kpa: f64,
        /// The limit, kPa.
        highest_kpa: f64,
    },
    /// The gauge reads so many kPa above ambient.
    BelowZero(f64),
    /// The bag was not vented at the beginning.
    NotAtRest(f64),
    /// The pressure rises much faster than it should.
    TooFast {
        /// In the last second, kPa/s.
        kpa_per_s: f64,
    },
    /// The bag does not follow the set point.
    Apart {
        /// What the gauge reads, kPa.
        gauge_kpa: f64,
        /// The set point, kPa.
        set_kpa: f64,
    },
    /// All of it takes longer than it may.
    TooLong(Duration),
    /// The self-test did not reach its pressure.
    NoRise(f64),
    /// The drive went on when nobody spoke to it: it has no limit of its own.
    NoOwnLimit(Duration),
    /// The bag does not vent.
    NoVent(f64),
    /// The bag leaks, kPa/min.
    Leak(f64),
    /// The session did not take its zero in time.
    NoZero,
    /// The session wants more than the drive may give.
    Target {
        /// The session's target, kPa.
        target_kpa: f64,
        /// The limit, kPa.
        highest_kpa: f64,
    },
    /// The session does not see its target reached.
    NoTarget(f64),
    /// The session has ended by itself.
    Session,
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Asked(by) => write!(f, "{by} ended it"),
            Self::Held(held) => write!(f, "this program was held up for {:.1} s", held.as_secs_f64()),
            Self::GaugeSilent(Duration::MAX) => f.write_str("the bag's gauge says nothing: `taxeld health` says why"),
            Self::GaugeSilent(age) => {
                write!(
                    f,
                    "the bag's gauge has said nothing for {:.1} s; check its line, then begin anew",
                    age.as_secs_f64()
                )
            }
            Self::DriveSilent(age) => write!(
                f,
                "the drive has not taken a command for {:.1} s; check its line and its supply",
                age.as_secs_f64()
            ),
            Self::TooHigh { kpa, highest_kpa } => write!(f, "the bag is at {kpa:.1} kPa, limit {highest_kpa:.1}"),
            Self::BelowZero(kpa) => write!(
                f,
                "the gauge reads {kpa:.1} kPa: expected pressure below ambient as a positive number; check its sign and reference"
            ),
            Self::NotAtRest(kpa) => write!(
                f,
                "the bag is not vented: its gauge reads {kpa:.1} kPa, limit {AT_REST_MAX_KPA}; open the valve, then begin anew"
            ),
            Self::TooFast { kpa_per_s } => write!(f, "the pressure rises by {kpa_per_s:.1} kPa in a second"),
            Self::Apart { gauge_kpa, set_kpa } => write!(
                f,
                "the bag does not follow the drive: gauge {gauge_kpa:.1} kPa, set point {set_kpa:.1} kPa; is the bag tight, and are both in kPa below ambient?"
            ),
            Self::TooLong(limit) => write!(f, "it takes longer than {:.0} s (total_s)", limit.as_secs_f64()),
            Self::NoRise(kpa) => write!(
                f,
                "self-test: the gauge reads {kpa:.1} kPa where {TEST_KPA} were asked for; is the pump on, the bag closed, the gauge this bag's?"
            ),
            Self::NoOwnLimit(limit) => write!(
                f,
                "self-test: the drive holds the pressure although it was told nothing for {:.1} s; it has no time limit of its own: \
                 name another fail_safe",
                limit.as_secs_f64()
            ),
            Self::NoVent(kpa) => {
                write!(
                    f,
                    "the bag does not vent: its gauge reads {kpa:.1} kPa; open the valve by hand and switch the pump off"
                )
            }
            Self::Leak(kpa_per_min) => write!(
                f,
                "the bag loses {kpa_per_min:.1} kPa/min at {LEAK_KPA} kPa, limit {LEAK_MAX_KPA_PER_MIN}; seal it"
            ),
            Self::NoZero => f.write_str("the session has not taken its zero; does something press on the skin?"),
            Self::Target { target_kpa, highest_kpa } => write!(
                f,
                "the session's target is {target_kpa:.0} kPa, and highest_kpa of the drive is {highest_kpa:.0}; begin anew with --target {:.0}",
                highest_kpa - 1.0
            ),
            Self::NoTarget(kpa) => {
                write!(
                    f,
                    "the session does not see its target reached: the bag stays at {kpa:.1} kPa; is the pump at its end?"
                )
            }
            Self::Session => f.write_str("the session has ended by itself"),
        }
    }
}
