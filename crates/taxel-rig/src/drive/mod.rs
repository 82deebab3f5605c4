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
use watch::{GAUGE_AGE_MAX, Pace, Watch};

/// No gauge of a vented bag reads more at the beginning, kPa.
const AT_REST_MAX_KPA: f64 = 2.0;
/// The self-test rises to this, kPa.
const TEST_KPA: f64 = 5.0;
/// The leak is read at this pressure, kPa; a bag may lose so much (kPa/min).
const LEAK_KPA: f64 = 20.0;
const LEAK_MAX_KPA_PER_MIN: f64 = 3.4;
/// Before anything is pumped, gauge and drive are waited for so long: a micro board that was just plugged in begins anew.
const HEARD_WITHIN: Duration = Duration::from_secs(5);
/// Looks at the gauge of the vented bag, two seconds of them: their mean is its zero, and how often it changes is its pace.
const AT_REST_READINGS: u32 = 40;
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
/// The leak is read after so long, from the first to the last of so many seconds.
const LEAK_SETTLE: Duration = Duration::from_secs(3);
const LEAK_OVER_S: f64 = 6.0;
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
    Armed { gauge: Mean, own: Mean, pace: Pace },
    Rise,
    Silence { last_order: Duration },
    TestVent,
    LeakRise(Control),
    Leak([Mean; 2]),
    LeakVent,
    Tare { asked: bool },
    Ramp(Control),
    Hold { set_kpa: f64 },
    Fall(Control),
    Vent,
    Done,
    SafeVent { why: Stop, vented: bool, aborted: bool },
}

/// The mean of readings.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum_kpa: f64,
    readings: u32,
}

impl Mean {
    fn push(&mut self, kpa: f64) {
        (self.sum_kpa, self.readings) = (self.sum_kpa + kpa, self.readings + 1);
    }

    fn kpa(self) -> f64 {
        self.sum_kpa / f64::from(self.readings.max(1))
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
    /// What the gauge reads of a vented bag, and the drive's own, kPa.
    rest_kpa: f64,
    own_rest_kpa: f64,
    ramps_left: u32,
    leak_kpa_per_min: Option<f64>,
    gauges_differ: Option<(f64, f64)>,
}

type Step = Result<(Order, Option<Ask>), Stop>;

impl Drive {
    /// A procedure that begins now, with a bag that should be vented. A process that was killed may have left it otherwise: so the
    /// first thing is to vent.
    #[must_use]
    pub fn new(now: Duration, limits: Limits, abilities: Abilities, programme: Programme) -> Self {
        Self {
            limits,
            abilities,
            programme,
            now: Now::Armed { gauge: Mean::default(), own: Mean::default(), pace: Pace::default() },
            since: now,
            watch: Watch::new(now),
            rest_kpa: 0.0,
            own_rest_kpa: 0.0,
            ramps_left: programme.ramps,
            leak_kpa_per_min: None,
            gauges_differ: None,
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

    /// By how much the drive's own gauge has read more than the bag's at most, and at which of the bag's, kPa; venting does not count.
    #[must_use]
    pub const fn gauges_differ(&self) -> Option<(f64, f64)> {
        self.gauges_differ
    }

    /// Ends it: somebody asked for that, or the line is broken.
    pub fn stop(&mut self, now: Duration, by: impl Into<String>) {
        if !matches!(self.now, Now::Done | Now::SafeVent { .. }) {
            self.safe_vent(now, Stop(format!("{} ended it", by.into())));
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

    fn go_on(&mut self, seen: &Seen) -> Step {
        // While the drive is not spoken to, it answers nothing.
        let is_silent = matches!(self.now, Now::Silence { .. });
        let spoken_to = if is_silent { Duration::ZERO } else { seen.now.saturating_sub(self.since) };
        let answer_age = seen.answer_age.min(spoken_to);
        let gauge = seen.gauge.map(|(kpa, age)| (kpa - self.rest_kpa, age));
        let is_waiting = self.state() == State::Armed && seen.now.saturating_sub(self.since) < HEARD_WITHIN;
        self.watch.runs(seen.now)?;
        let kpa = match Watch::hear(&Seen { gauge, answer_age, ..*seen }) {
            Ok(kpa) => kpa,
            Err(_) if is_waiting => return Ok((Order::Vent, None)),
            Err(why) => return Err(why),
        };
        self.watch.look(seen.now, kpa, &self.limits, self.programme.kpa_per_s)?;
        let own = seen.own.filter(|(_, age)| *age <= GAUGE_AGE_MAX).map(|(kpa, _)| kpa - self.own_rest_kpa);
        if seen.phase == Phase::Failed {
            return Err(Stop("the session has ended by itself".to_owned()));
        }
        if let Some(own_kpa) = own.filter(|_| self.state() != State::Armed) {
            self.compare_gauges(seen.now, kpa, own_kpa)?;
        }
        match self.state() {
            State::Armed => self.armed(seen, kpa, own),
            State::SelfTest => self.self_test(seen.now, kpa),
            State::LeakTest => self.leak_test(seen.now, kpa),
            _ => self.session(seen, kpa),
        }
    }

    fn compare_gauges(&mut self, now: Duration, kpa: f64, own_kpa: f64) -> Result<(), Stop> {
        let (is_told, more_kpa) = (matches!(self.state(), State::Ramp | State::Hold | State::Fall), own_kpa - kpa);
        if is_told && self.gauges_differ.is_none_or(|(most_kpa, _)| more_kpa.abs() > most_kpa.abs()) {
            self.gauges_differ = Some((more_kpa, kpa));
        }
        self.watch.compare_gauges(now, kpa, own_kpa)
    }

    fn armed(&mut self, seen: &Seen, kpa: f64, own_kpa: Option<f64>) -> Step {
        let now = seen.now;
        let waited = now.saturating_sub(self.since);
        if let Now::Armed { gauge, own, pace } = &mut self.now {
            seen.gauge.iter().for_each(|(_, age)| pace.push(now, *age));
            if kpa.abs() <= AT_REST_MAX_KPA {
                gauge.push(kpa);
                own_kpa.into_iter().for_each(|kpa| own.push(kpa));
            } else if waited > VENT_WITHIN {
                return Err(Stop(format!(
                    "the bag is not vented: its gauge reads {kpa:.1} kPa, limit {AT_REST_MAX_KPA}; open the valve, then begin anew"
                )));
            }
            if gauge.readings >= AT_REST_READINGS {
                pace.is_enough()?;
                (self.rest_kpa, self.own_rest_kpa) = (gauge.kpa(), own.kpa());
                self.enter(now, Now::Rise);
            }
        }
        Ok((Order::Vent, None))
    }

    /// Vents until the gauge says so, then goes on.
    fn vent(&mut self, now: Duration, kpa: f64, next: Now) -> Step {
        if kpa < VENTED_KPA {
            self.enter(now, next);
        } else if now.saturating_sub(self.since) > VENT_WITHIN {
            return Err(Stop(format!(
                "the bag does not vent: its gauge reads {kpa:.1} kPa; open the valve by hand and switch the pump off"
            )));
        }
        Ok((Order::Vent, None))
    }

    fn self_test(&mut self, now: Duration, kpa: f64) -> Step {
        let waited = now.saturating_sub(self.since);
        if kpa > TEST_KPA + TEST_OVER_KPA {
            return Err(Stop(format!("self-test: the bag is at {kpa:.1} kPa where {TEST_KPA} were asked for")));
        }
        match (&self.now, self.abilities.own_limit) {
            (Now::Rise, own_limit) => {
                if kpa >= TEST_SHARE * TEST_KPA {
                    let next = if own_limit.is_some() { Now::Silence { last_order: now } } else { Now::TestVent };
                    self.enter(now, next);
                } else if waited > TEST_WITHIN {
                    return Err(no_rise(kpa, TEST_KPA));
                }
                Ok((Order::Set(TEST_KPA), None))
            }
            (Now::Silence { last_order }, Some(limit)) => {
                if kpa < 0.5 * TEST_SHARE * TEST_KPA {
                    self.enter(now, Now::TestVent);
                } else if now.saturating_sub(*last_order) > limit + OWN_LIMIT_SLACK {
                    return Err(Stop(format!(
                        "self-test: the drive holds the pressure although it was told nothing for {:.1} s; it has no time limit of its own: name another fail_safe",
                        limit.as_secs_f64()
                    )));
                }
                Ok((Order::Silence, None))
            }
            _ => {
                let rise = Control::new(now, kpa, LEAK_KPA, LEAK_KPA / 5.0);
                let leaks = self.abilities.holds && self.limits.highest_kpa >= LEAK_KPA;
                self.vent(now, kpa, if leaks { Now::LeakRise(rise) } else { Now::Tare { asked: false } })
            }
        }
    }

    fn leak_test(&mut self, now: Duration, kpa: f64) -> Step {
        let waited = now.saturating_sub(self.since);
        match &mut self.now {
            Now::LeakRise(rise) => {
                let set_kpa = rise.set_kpa(now, kpa, self.limits.highest_kpa);
                self.watch.compare(now, kpa, set_kpa)?;
                if rise.is_at_end() && kpa > TEST_SHARE * LEAK_KPA {
                    self.enter(now, Now::Leak([Mean::default(); 2]));
                } else if waited > TEST_WITHIN {
                    return Err(no_rise(kpa, LEAK_KPA));
                }
                Ok((Order::Set(set_kpa), None))
            }
            Now::Leak([first, last]) => {
                let over_s = waited.saturating_sub(LEAK_SETTLE).as_secs_f64();
                if waited >= LEAK_SETTLE && over_s < 1.0 {
                    first.push(kpa);
                } else if over_s >= LEAK_OVER_S - 1.0 {
                    last.push(kpa);
                }
                if over_s >= LEAK_OVER_S {
                    let kpa_per_min = 60.0 * (first.kpa() - last.kpa()) / (LEAK_OVER_S - 1.0);
                    self.leak_kpa_per_min = Some(kpa_per_min);
                    if kpa_per_min > LEAK_MAX_KPA_PER_MIN {
                        return Err(Stop(format!(
                            "the bag loses {kpa_per_min:.1} kPa/min at {LEAK_KPA} kPa, limit {LEAK_MAX_KPA_PER_MIN}; seal it"
                        )));
                    }
                    self.enter(now, Now::LeakVent);
                }
                Ok((Order::Hold, None))
            }
            _ => self.vent(now, kpa, Now::Tare { asked: false }),
        }
    }

    fn session(&mut self, seen: &Seen, kpa: f64) -> Step {
        let (now, phase) = (seen.now, seen.phase);
        let waited = now.saturating_sub(self.since);
        let (highest_kpa, target_kpa) = (self.limits.highest_kpa, seen.target_kpa);
        match &mut self.now {
            Now::Tare { asked } => {
                let ask = (!std::mem::replace(asked, true)).then_some(Ask::Begin);
                let ask = ask.map(|_| if phase == Phase::None { Ask::Begin } else { Ask::Ramp });
                if phase == Phase::Rising {
                    if target_kpa > highest_kpa {
                        return Err(Stop(format!(
                            "the session's target is {target_kpa:.0} kPa, and highest_kpa of the drive is {highest_kpa:.0}; begin anew with --target {:.0}",
                            highest_kpa - 1.0
                        )));
                    }
                    let end_kpa = (target_kpa + BEYOND_TARGET_KPA).min(highest_kpa);
                    self.ramps_left = self.ramps_left.saturating_sub(1);
                    self.enter(now, Now::Ramp(Control::new(now, kpa, end_kpa, self.programme.kpa_per_s)));
                } else if waited > TARE_WITHIN {
                    let words = "the session has not taken its zero; does something press on the skin?";
                    return Err(Stop(words.to_owned()));
                }
                return Ok((Order::Vent, ask));
            }
            Now::Ramp(control) | Now::Fall(control) => {
                let set_kpa = control.set_kpa(now, kpa, highest_kpa);
                let is_at_end = control.is_at_end();
                if control.stands_for(now) > STANDS_MAX {
                    return Err(Watch::does_not_follow(kpa, set_kpa));
                }
                self.watch.compare(now, kpa, set_kpa)?;
                self.follow(now, phase, kpa, is_at_end.then_some(set_kpa));
                return Ok((Order::Set(set_kpa), None));
            }
            Now::Hold { set_kpa } => {
                let set_kpa = *set_kpa;
                self.watch.compare(now, kpa, set_kpa)?;
                if waited > self.limits.hold {
                    return Err(Stop(format!(
                        "the session does not see its target reached: the bag stays at {kpa:.1} kPa; is the pump at its end?"
                    )));
                }
                self.follow(now, phase, kpa, None);
                return Ok((Order::Set(set_kpa), None));
            }
            _ => {}
        }
        self.vent(now, kpa, if self.ramps_left > 0 { Now::Tare { asked: false } } else { Now::Done })
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

fn no_rise(kpa: f64, asked_kpa: f64) -> Stop {
    Stop(format!(
        "self-test: the gauge reads {kpa:.1} kPa where {asked_kpa} were asked for; is the pump on, the bag closed, the gauge this bag's?"
    ))
}
