//! The procedure of a drive: a pump and a valve that calibrate a skin by themselves. Pure: what is seen comes in, what the drive is
//! told goes out. The owner of the line calls it twenty times a second.
//!
//! `Armed -> SelfTest -> LeakTest -> Tare -> Ramp -> Hold -> (Fall ->) Vent -> (Tare ... ->) Done`, and from each of them
//! `SafeVent`, from which nothing leads back. The session is an ordinary one of the daemon: the drive only moves the pressure.
//!
//! Pressures are kPa below ambient, counted from what the gauge of the vented bag read at the beginning, so that an offset of the
//! gauge is no pressure.

mod control;
mod given;
mod stop;
mod watch;

use std::time::Duration;

pub use given::{Abilities, Ask, Limits, Order, Phase, Programme, Seen};
pub use stop::Stop;

use control::Control;
use stop::{AT_REST_MAX_KPA, LEAK_KPA, LEAK_MAX_KPA_PER_MIN, TEST_KPA};
use watch::Watch;

/// Before anything is pumped, gauge and drive are waited for so long: a micro board that was just plugged in begins anew.
const HEARD_WITHIN: Duration = Duration::from_secs(5);
/// Readings that what the gauge reads at rest is the mean of: a second of them.
const AT_REST_READINGS: u32 = 20;
/// A bag is vented below this, kPa.
const VENTED_KPA: f64 = 1.0;
/// A bag that is not vented after so long does not vent.
const VENT_WITHIN: Duration = Duration::from_secs(10);
/// The self-test reaches this share of its pressure within so long.
const TEST_SHARE: f64 = 0.8;
const TEST_WITHIN: Duration = Duration::from_secs(15);
/// What the self-test may overshoot by, kPa.
const TEST_OVER_KPA: f64 = 3.0;
/// A drive's own limit has ended what it held so long after the last command, beyond the limit itself.
const OWN_LIMIT_SLACK: Duration = Duration::from_secs(4);
/// The leak is read after so long, over so long.
const LEAK_SETTLE: Duration = Duration::from_secs(3);
const LEAK_OVER: Duration = Duration::from_secs(6);
/// The session has taken its zero within so long.
const TARE_WITHIN: Duration = Duration::from_secs(120);
/// A ramp that gets no further for so long does not.
const STANDS_MAX: Duration = Duration::from_secs(8);
/// A ramp goes so far beyond the session's target, kPa, so that the session sees it reached.
const BEYOND_TARGET_KPA: f64 = 0.5;

/// Where the procedure is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// The bag is vented; what the gauge reads is taken for zero.
    Armed,
    /// A small rise, what the drive does when nobody speaks to it, and a vent.
    SelfTest,
    /// How much the closed bag loses.
    LeakTest,
    /// The session takes its zero, under a vented bag.
    Tare,
    /// The pressure rises.
    Ramp,
    /// It stays until the session goes on.
    Hold,
    /// It falls.
    Fall,
    /// The bag is vented.
    Vent,
    /// All is done, and the bag is vented.
    Done,
    /// It was ended, and the bag is vented as far as the drive does as it is told.
    SafeVent,
}

/// What a state remembers.
#[derive(Clone, Debug)]
enum Now {
    Armed { sum_kpa: f64, readings: u32 },
    Rise,
    Silence { last_order: Duration },
    TestVent,
    LeakRise(Control),
    Leak(Slope),
    LeakVent,
    Tare { asked: bool },
    Ramp(Control),
    Hold { set_kpa: f64 },
    Fall(Control),
    Vent,
    Done,
    SafeVent { why: Stop, vented: bool, aborted: bool },
}

/// The slope of a straight line through readings, by least squares.
#[derive(Clone, Copy, Debug, Default)]
struct Slope {
    count: f64,
    sums: [f64; 4],
}

impl Slope {
    fn push(&mut self, s: f64, kpa: f64) {
        self.count += 1.0;
        for (sum, value) in self.sums.iter_mut().zip([s, kpa, s * s, s * kpa]) {
            *sum += value;
        }
    }

    /// Per second.
    fn per_s(&self) -> f64 {
        let [s, kpa, squares, products] = self.sums.map(|sum| sum / self.count);
        (products - s * kpa) / (squares - s * s)
    }
}

/// A drive in its procedure.
#[derive(Clone, Debug)]
pub struct Drive {
    limits: Limits,
    abilities: Abilities,
    programme: Programme,
    now: Now,
    since: Duration,
    watch: Watch,
    /// What the gauge reads of a vented bag, kPa.
    rest_kpa: f64,
    ramps_left: u32,
    leak_kpa_per_min: Option<f64>,
}

impl Drive {
    /// A procedure that begins now, with a bag that should be vented. A process that was killed may have left it otherwise: so the
    /// first thing is to vent.
    #[must_use]
    pub fn new(now: Duration, limits: Limits, abilities: Abilities, programme: Programme) -> Self {
        Self {
            limits,
            abilities,
            programme,
            now: Now::Armed { sum_kpa: 0.0, readings: 0 },
            since: now,
            watch: Watch::new(now),
            rest_kpa: 0.0,
            ramps_left: programme.ramps,
            leak_kpa_per_min: None,
        }
    }

    /// Where it is.
    #[must_use]
    pub const fn state(&self) -> State {
        match self.now {
            Now::Armed { .. } => State::Armed,
            Now::Rise | Now::Silence { .. } | Now::TestVent => State::SelfTest,
            Now::LeakRise(_) | Now::Leak(_) | Now::LeakVent => State::LeakTest,
            Now::Tare { .. } => State::Tare,
            Now::Ramp(_) => State::Ramp,
            Now::Hold { .. } => State::Hold,
            Now::Fall(_) => State::Fall,
            Now::Vent => State::Vent,
            Now::Done => State::Done,
            Now::SafeVent { .. } => State::SafeVent,
        }
    }

    /// Why it was ended, and whether the gauge has shown the bag vented since.
    #[must_use]
    pub const fn stopped(&self) -> Option<(&Stop, bool)> {
        match &self.now {
            Now::SafeVent { why, vented, .. } => Some((why, *vented)),
            _ => None,
        }
    }

    /// What the closed bag loses, kPa/min, once it is known.
    #[must_use]
    pub const fn leak_kpa_per_min(&self) -> Option<f64> {
        self.leak_kpa_per_min
    }

    /// Ends it: somebody asked for that, or the line is broken.
    pub fn stop(&mut self, now: Duration, by: impl Into<String>) {
        if !matches!(self.now, Now::Done | Now::SafeVent { .. }) {
            self.safe_vent(now, Stop::Asked(by.into()));
        }
    }

    /// What is to be done now. To be called every 50 ms, and each order goes out, also the same one again: so a drive with a
    /// limit of its own hears that somebody is there.
    pub fn step(&mut self, seen: &Seen) -> (Order, Option<Ask>) {
        if !matches!(self.now, Now::Done | Now::SafeVent { .. }) {
            match self.go_on(seen) {
                Ok(done) => return done,
                Err(why) => self.safe_vent(seen.now, why),
            }
        }
        let Now::SafeVent { vented, aborted, .. } = &mut self.now else { return (Order::Vent, None) };
        let read = seen.gauge.filter(|(_, age)| *age < Duration::from_secs(1));
        *vented |= read.is_some_and(|(kpa, _)| kpa - self.rest_kpa < VENTED_KPA);
        // Whatever ended it, the session does not wait for a pressure that will not come.
        let is_open = matches!(seen.phase, Phase::Taring | Phase::Rising | Phase::Falling);
        let aborts = is_open && !std::mem::replace(aborted, true);
        (Order::Vent, aborts.then_some(Ask::Abort))
    }

    fn go_on(&mut self, seen: &Seen) -> Result<(Order, Option<Ask>), Stop> {
        // While the drive is not spoken to, it answers nothing.
        let is_silent = matches!(self.now, Now::Silence { .. });
        let spoken_to = if is_silent { Duration::ZERO } else { seen.now.saturating_sub(self.since) };
        let answer_age = seen.answer_age.min(spoken_to);
        let gauge = seen.gauge.map(|(kpa, age)| (kpa - self.rest_kpa, age));
        let looked = self.watch.look(&Seen { gauge, answer_age, ..*seen }, &self.limits, self.programme.kpa_per_s);
        let is_waiting = self.state() == State::Armed && seen.now.saturating_sub(self.since) < HEARD_WITHIN;
        if is_waiting && matches!(looked, Err(Stop::GaugeSilent(_) | Stop::DriveSilent(_))) {
            return Ok((Order::Vent, None));
        }
        let kpa = looked?;
        if seen.phase == Phase::Failed {
            return Err(Stop::Session);
        }
        match self.state() {
            State::Armed => self.armed(seen.now, kpa),
            State::SelfTest => self.self_test(seen.now, kpa),
            State::LeakTest => self.leak_test(seen.now, kpa),
            _ => self.session(seen, kpa),
        }
    }

    fn armed(&mut self, now: Duration, kpa: f64) -> Result<(Order, Option<Ask>), Stop> {
        let waited = now.saturating_sub(self.since);
        if let Now::Armed { sum_kpa, readings } = &mut self.now {
            if kpa.abs() <= AT_REST_MAX_KPA {
                (*sum_kpa, *readings) = (*sum_kpa + kpa, *readings + 1);
            } else if waited > VENT_WITHIN {
                return Err(Stop::NotAtRest(kpa));
            }
            if *readings >= AT_REST_READINGS {
                self.rest_kpa = *sum_kpa / f64::from(*readings);
                self.enter(now, Now::Rise);
            }
        }
        Ok((Order::Vent, None))
    }

    fn self_test(&mut self, now: Duration, kpa: f64) -> Result<(Order, Option<Ask>), Stop> {
        let waited = now.saturating_sub(self.since);
        if kpa > TEST_KPA + TEST_OVER_KPA {
            return Err(Stop::TooHigh { kpa, highest_kpa: TEST_KPA + TEST_OVER_KPA });
        }
        match (&self.now, self.abilities.own_limit) {
            (Now::Rise, own_limit) => {
                if kpa >= TEST_SHARE * TEST_KPA {
                    let next = if own_limit.is_some() { Now::Silence { last_order: now } } else { Now::TestVent };
                    self.enter(now, next);
                } else if waited > TEST_WITHIN {
                    return Err(Stop::NoRise(kpa));
                }
                Ok((Order::Set(TEST_KPA), None))
            }
            (Now::Silence { last_order }, Some(limit)) => {
                if kpa < 0.5 * TEST_SHARE * TEST_KPA {
                    self.enter(now, Now::TestVent);
                } else if now.saturating_sub(*last_order) > limit + OWN_LIMIT_SLACK {
                    return Err(Stop::NoOwnLimit(limit));
                }
                Ok((Order::Silence, None))
            }
            _ => {
                if kpa < VENTED_KPA {
                    let rise = Control::new(now, kpa, LEAK_KPA, LEAK_KPA / 5.0);
                    let reaches = self.limits.highest_kpa >= LEAK_KPA;
                    let leaks = self.abilities.holds && reaches;
                    self.enter(now, if leaks { Now::LeakRise(rise) } else { Now::Tare { asked: false } });
                } else if waited > VENT_WITHIN {
                    return Err(Stop::NoVent(kpa));
                }
                Ok((Order::Vent, None))
            }
        }
    }

    fn leak_test(&mut self, now: Duration, kpa: f64) -> Result<(Order, Option<Ask>), Stop> {
        let waited = now.saturating_sub(self.since);
        match &mut self.now {
            Now::LeakRise(rise) => {
                let set_kpa = rise.set_kpa(now, kpa, self.limits.highest_kpa);
                self.watch.compare(now, kpa, set_kpa)?;
                if rise.is_at_end() && kpa > TEST_SHARE * LEAK_KPA {
                    self.enter(now, Now::Leak(Slope::default()));
                } else if waited > TEST_WITHIN {
                    return Err(Stop::NoRise(kpa));
                }
                Ok((Order::Set(set_kpa), None))
            }
            Now::Leak(slope) => {
                if waited >= LEAK_SETTLE {
                    slope.push(waited.as_secs_f64(), kpa);
                }
                if waited >= LEAK_SETTLE + LEAK_OVER {
                    let kpa_per_min = -60.0 * slope.per_s();
                    self.leak_kpa_per_min = Some(kpa_per_min);
                    if kpa_per_min > LEAK_MAX_KPA_PER_MIN {
                        return Err(Stop::Leak(kpa_per_min));
                    }
                    self.enter(now, Now::LeakVent);
                }
                Ok((Order::Hold, None))
            }
            _ => {
                if kpa < VENTED_KPA {
                    self.enter(now, Now::Tare { asked: false });
                } else if waited > VENT_WITHIN {
                    return Err(Stop::NoVent(kpa));
                }
                Ok((Order::Vent, None))
            }
        }
    }

    fn session(&mut self, seen: &Seen, kpa: f64) -> Result<(Order, Option<Ask>), Stop> {
        let (now, phase) = (seen.now, seen.phase);
        let waited = now.saturating_sub(self.since);
        let (highest_kpa, target_kpa) = (self.limits.highest_kpa, seen.target_kpa);
        match &mut self.now {
            Now::Tare { asked } => {
                let ask = (!std::mem::replace(asked, true)).then_some(Ask::Begin);
                let ask = ask.map(|_| if phase == Phase::None { Ask::Begin } else { Ask::Ramp });
                if phase == Phase::Rising {
                    if target_kpa > highest_kpa {
                        return Err(Stop::Target { target_kpa, highest_kpa });
                    }
                    let end_kpa = (target_kpa + BEYOND_TARGET_KPA).min(highest_kpa);
                    self.enter(now, Now::Ramp(Control::new(now, kpa, end_kpa, self.programme.kpa_per_s)));
                } else if waited > TARE_WITHIN {
                    return Err(Stop::NoZero);
                }
                return Ok((Order::Vent, ask));
            }
            Now::Ramp(control) | Now::Fall(control) => {
                let set_kpa = control.set_kpa(now, kpa, highest_kpa);
                let is_at_end = control.is_at_end();
                if control.stands_for(now) > STANDS_MAX {
                    return Err(Stop::Apart { gauge_kpa: kpa, set_kpa });
                }
                self.watch.compare(now, kpa, set_kpa)?;
                self.follow(now, phase, kpa, is_at_end.then_some(set_kpa));
                return Ok((Order::Set(set_kpa), None));
            }
            Now::Hold { set_kpa } => {
                let set_kpa = *set_kpa;
                self.watch.compare(now, kpa, set_kpa)?;
                if waited > self.limits.hold {
                    return Err(Stop::NoTarget(kpa));
                }
                self.follow(now, phase, kpa, None);
                return Ok((Order::Set(set_kpa), None));
            }
            _ => {}
        }
        if kpa < VENTED_KPA {
            self.ramps_left = self.ramps_left.saturating_sub(1);
            self.enter(now, if self.ramps_left > 0 { Now::Tare { asked: false } } else { Now::Done });
        } else if waited > VENT_WITHIN {
            return Err(Stop::NoVent(kpa));
        }
        Ok((Order::Vent, None))
    }

    /// Goes where the session is: it sees its target reached, not the drive.
    fn follow(&mut self, now: Duration, phase: Phase, kpa: f64, at_end: Option<f64>) {
        let is_falling = matches!(self.now, Now::Fall(_));
        match (phase, at_end) {
            (Phase::Over | Phase::None, _) => self.enter(now, Now::Vent),
            (Phase::Falling, _) if !is_falling => {
                self.enter(now, Now::Fall(Control::new(now, kpa, 0.0, self.programme.kpa_per_s)));
            }
            // A fall that has come down ends by the vented bag.
            (Phase::Falling, Some(_)) => self.enter(now, Now::Vent),
            (_, Some(set_kpa)) => self.enter(now, Now::Hold { set_kpa }),
            _ => {}
        }
    }

    fn safe_vent(&mut self, now: Duration, why: Stop) {
        self.enter(now, Now::SafeVent { why, vented: false, aborted: false });
    }

    fn enter(&mut self, now: Duration, next: Now) {
        (self.now, self.since) = (next, now);
        self.watch.forget();
    }
}
