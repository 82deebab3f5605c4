//! What a procedure is given, and what it gives.

use std::time::Duration;

/// Limits that hold whatever the programme says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Highest pressure, kPa.
    pub highest_kpa: f64,
    /// How long the highest pressure of a ramp is held while the session does not go on.
    pub hold: Duration,
    /// How long all of it may last.
    pub total: Duration,
}

/// What the drive can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Abilities {
    /// It vents by itself when it has been told nothing for so long.
    pub own_limit: Option<Duration>,
    /// It can close the bag with its pump off, so that the leak can be read.
    pub holds: bool,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Programme {
    /// Rate of rise and fall, kPa/s.
    pub kpa_per_s: f64,
    /// Rises of the session; the bag is vented between them.
    pub ramps: u32,
}

/// What the session is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// There is none yet.
    None,
    /// It takes its zero.
    Taring,
    /// It gathers samples of a rise.
    Rising,
    /// It gathers samples of a fall.
    Falling,
    /// It computes models, or waits for what comes next.
    Over,
    /// It has ended without models.
    Failed,
}

/// What is known at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Now, on a clock that does not stand still.
    pub now: Duration,
    /// What the bag's gauge read last, kPa below ambient, and how long ago.
    pub gauge: Option<(f64, Duration)>,
    /// The same of the drive's own gauge, if it has one.
    pub own: Option<(f64, Duration)>,
    /// How long ago the drive answered as it should, with the set point that it was given.
    pub answer_age: Duration,
    /// What the session is at.
    pub phase: Phase,
    /// Its target, kPa; not read before it rises.
    pub target_kpa: f64,
}

/// What the drive is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// This pressure, kPa below ambient.
    Set(f64),
    /// Pump off, valve closed.
    Hold,
    /// Valve open.
    Vent,
    /// Nothing, not even a question: its own limit is tried.
    Silence,
}

/// What the session is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// To begin.
    Begin,
    /// Another ramp.
    Ramp,
    /// To stop.
    Abort,
}
