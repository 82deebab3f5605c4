//! Where everything stands, and what its changes need.

use std::collections::{BTreeMap, BTreeSet};

use taxel_engine::calibration::SessionState as S;

use super::step::{Answer, Disk, Set, VENTED_KPA};

/// What has come into use since a zero was taken that no models were there to judge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Since {
    Nothing,
    Own,
    Others,
}

/// What readers see, and what a store keeps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Facts {
    /// State and model set of each session.
    pub sessions: BTreeMap<u64, (S, Option<Set>)>,
    pub known: BTreeSet<Set>,
    pub active: Option<Set>,
    /// Sessions with a ramp.
    pub ramped: BTreeSet<u64>,
}

impl Facts {
    /// The state of a session as readers see it: one whose set is in use is ACTIVE, unless it is open or laid aside.
    pub fn seen(&self, number: u64) -> Option<S> {
        let (state, set) = *self.sessions.get(&number)?;
        let stays = matches!(state, S::Taring | S::Ramping | S::Fitting | S::Discarded);
        Some(if !stays && set.is_some() && set == self.active { S::Active } else { state })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pending {
    Activate { request: u64, set: Set },
    Import { request: u64, set: Set },
    Zero { request: u64, good: bool, confirmed: bool },
    Fitted { fit: usize },
    End { request: u64, number: u64, state: S },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fit {
    pub session: u64,
    /// The zero of the last ramp that the session had then, to which the models refer.
    pub rest: Option<u64>,
    /// It has not come back, and the daemon that asked for it still runs.
    pub out: bool,
}

#[derive(Clone, Debug)]
pub struct Model {
    pub live: Facts,
    /// What all records together say.
    pub(super) recorded: Facts,
    /// What of it is on disk.
    pub on_disk: Facts,
    pub disk: Disk,
    pub(super) next_session: u64,
    /// The session that the patch holds or held last: its samples are in memory.
    pub(super) held: Option<u64>,
    pub(super) pending: Vec<Pending>,
    pub fits: Vec<Fit>,
    pub(super) kpa: u32,
    pub(super) gauge_fresh: bool,
    pub(super) boards_ready: bool,
    /// Whether a frame has come since the start.
    pub(super) heard: bool,
    /// They were configured while there was no force that would have shown a load, and no zero has been taken since.
    pub(super) unseen: bool,
    /// A session took a zero all the same, which counts only for the models that refer to one taken since the start; and
    /// whether models are in use since, these or others.
    pub(super) unjudged: Option<Since>,
    pub(super) begun: BTreeSet<u64>,
    /// How many zeros sessions have taken, and which of them was the last of each session.
    pub(super) zeros: u64,
    pub(super) rests: BTreeMap<u64, u64>,
    /// Somebody confirmed a zero while the bag pressed: boards that are configured after that contradict it.
    pub(super) falsely_confirmed: bool,
    /// Whether all modules were heard together since the boards were configured.
    pub(super) whole: bool,
    /// Zeros need no confirmation any more, since the last time that passed: a watch that goes on may end at once.
    pub(super) just_trusted: bool,
    /// A zero that an operator waits for: request, and whether it was confirmed.
    pub(super) tare: Option<(u64, bool)>,
    /// How long the open session has come no further, at least and at most.
    pub(super) idle_s: (f64, f64),
    /// Furthest pressure of the ramp.
    pub(super) reached_kpa: u32,
    /// Commands given so far: the number of the last request.
    pub requests: u64,
    /// The requests that have no answer yet.
    pub waiting: BTreeSet<u64>,
    /// What came of the last step, if it was a command.
    pub answer: Option<Answer>,
    /// What was answered later, and whether it was done.
    pub settled: BTreeMap<u64, bool>,
    /// Whether samples entered with the last step.
    pub grew: bool,
}

impl Model {
    pub fn new() -> Self {
        Self {
            live: Facts::default(),
            recorded: Facts::default(),
            on_disk: Facts::default(),
            disk: Disk::Fast,
            next_session: 1,
            held: None,
            pending: Vec::new(),
            fits: Vec::new(),
            kpa: 0,
            gauge_fresh: false,
            boards_ready: false,
            heard: false,
            unseen: true,
            unjudged: None,
            begun: BTreeSet::new(),
            zeros: 0,
            rests: BTreeMap::new(),
            falsely_confirmed: false,
            whole: true,
            just_trusted: false,
            tare: None,
            idle_s: (0.0, 0.0),
            reached_kpa: 0,
            requests: 0,
            waiting: BTreeSet::new(),
            answer: None,
            settled: BTreeMap::new(),
            grew: false,
        }
    }

    /// The session that holds the patch.
    pub fn open(&self) -> Option<(u64, S)> {
        let open = |(number, (state, _)): (&u64, &(S, Option<Set>))| {
            matches!(state, S::Taring | S::Ramping | S::Fitting).then_some((*number, *state))
        };
        self.live.sessions.iter().find_map(open)
    }

    /// The pressure in the bag.
    pub fn kpa(&self) -> u32 {
        self.kpa
    }

    pub(super) fn state(&self, number: u64) -> Option<S> {
        self.live.seen(number)
    }

    /// Whether an activation or the end of a session waits for the disk: no other change of sessions and sets begins.
    pub(super) fn is_changing(&self) -> bool {
        self.pending.iter().any(|pending| matches!(pending, Pending::Activate { .. } | Pending::End { .. }))
    }

    /// Whether a session gathers.
    pub(super) fn gathers(&self, number: u64) -> bool {
        matches!(self.state(number), Some(S::Taring | S::Ramping | S::Fitting))
    }

    /// Whether the bag is known to press.
    pub(super) fn presses(&self) -> bool {
        self.gauge_fresh && self.kpa > VENTED_KPA
    }

    /// Whether the gauge is known to be silent: the last pass went without it.
    pub(super) fn gauge_gone(&self) -> bool {
        self.heard && !self.gauge_fresh
    }

    pub(super) fn enter(&mut self, number: u64, state: S) {
        let session = self.live.sessions.entry(number).or_insert((state, None));
        session.0 = state;
        self.recorded.sessions.insert(number, *session);
    }

    pub(super) fn fit(&mut self, number: u64) {
        self.enter(number, S::Fitting);
        let rest = self.rests.get(&number).filter(|_| self.recorded.ramped.contains(&number)).copied();
        self.fits.push(Fit { session: number, rest, out: true });
    }

    /// The session of this daemon that a set came from.
    pub(super) fn owner(&self, set: Set) -> Option<u64> {
        let names = |(number, (_, of)): (&u64, &(S, Option<Set>))| (*of == Some(set)).then_some(*number);
        self.live.sessions.iter().find_map(names)
    }

    /// Whether a fit is the last that its session asked for, and it waits for it.
    pub(super) fn awaits(&self, fit: usize) -> bool {
        let session = self.fits[fit].session;
        let last = self.fits.iter().rposition(|other| other.session == session);
        last == Some(fit) && self.state(session) == Some(S::Fitting)
    }

    /// A request that waited is answered.
    pub(super) fn settle(&mut self, request: u64, done: bool) {
        self.waiting.remove(&request);
        self.settled.insert(request, done);
    }

    /// An operator who waits for a zero is told that there is none.
    pub(super) fn end_tare(&mut self) {
        if let Some((request, _)) = self.tare.take() {
            self.settle(request, false);
        }
    }

    /// Zeros that are being written down are none any more.
    pub(super) fn void_zeros(&mut self) {
        for pending in &mut self.pending {
            if let Pending::Zero { good, .. } = pending {
                *good = false;
            }
        }
    }

    pub(super) fn lose_zero(&mut self) {
        self.unseen |= self.unjudged == Some(Since::Nothing);
        self.unjudged.take_if(|since| *since != Since::Own);
        self.end_tare();
        self.void_zeros();
        if let Some((number, S::Ramping)) = self.open() {
            self.enter(number, S::Failed);
        }
    }
}
