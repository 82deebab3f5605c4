//! What the writing process does, drawn from a seed, and what a store holds after each of it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use taxel_engine::calibration::SessionState;
use taxel_engine::record::{KeptZero, Record, Sample, TakenZero};

use crate::tests::fixture::*;

/// Most events of a burst: batches that are handed over without waiting for each other.
const BURST_MAX: usize = 4;

/// Something that is done to a store, and acknowledged.
pub enum Event {
    /// A batch, which is stored.
    Write(Vec<Record>),
    /// A batch whose last record does not follow: it is refused, and the store has to be started again.
    Refused(Vec<Record>),
    /// The store is closed and opened again.
    Reopen,
}

/// What a store holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Held {
    /// Ids of model sets.
    pub sets: BTreeSet<String>,
    /// The active one.
    pub active: Option<String>,
    /// Samples of each session.
    pub sessions: BTreeMap<u64, u64>,
    /// Known loads.
    pub loads: usize,
    /// What is known of the zero.
    pub zero: KeptZero,
    /// Requests in the audit log, and results.
    pub asked: usize,
    pub answered: usize,
}

impl Held {
    fn with(mut self, event: &Event) -> Self {
        let Event::Write(records) = event else { return self };
        for record in records {
            match record {
                Record::Session(view) => drop(self.sessions.entry(view.number).or_default()),
                Record::Sample { session, .. } => *self.sessions.entry(*session).or_default() += 1,
                Record::ModelSet(set) => drop(self.sets.insert(set.id.clone())),
                Record::Activated { model_set, .. } => self.active = Some(model_set.clone()),
                Record::ModelSetDeleted { model_set } => drop(self.sets.remove(model_set)),
                Record::SessionDeleted { session } => drop(self.sessions.remove(session)),
                Record::Load(_) => self.loads += 1,
                Record::Zero { zero, .. } => self.zero.clone_from(zero),
                Record::Asked(_) => self.asked += 1,
                Record::Answered(_) => self.answered += 1,
                Record::Ramp { .. } => {}
            }
        }
        self
    }
}

/// The counts of a sample that bear the number of its session, so that they can be found on a disk.
pub fn signature(session: u64) -> Vec<u8> {
    format!("<<session-{session:06}>>").into_bytes()
}

pub fn signed(session: u64, index: u64) -> Sample {
    let words: Vec<u16> = signature(session).as_chunks().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
    Sample { counts: words.into(), ..sample(index) }
}

/// All events of a run.
pub struct Plan {
    events: Vec<Event>,
    /// How many events each burst has.
    bursts: Vec<usize>,
}

impl Plan {
    /// The first so many events of a seed.
    pub fn new(seed: u64, events: usize) -> Self {
        let mut drawing = Drawing { random: Random(seed), ..Drawing::default() };
        let events: Vec<_> = (0..events).map(|_| drawing.event()).collect();
        let mut random = Random(!seed);
        let mut bursts: Vec<usize> = Vec::new();
        let mut room = 0;
        for event in &events {
            // What ends a run is done when all before it is acknowledged.
            let alone = !matches!(event, Event::Write(_));
            match bursts.last_mut() {
                Some(burst) if room > 0 && !alone => *burst += 1,
                _ => {
                    bursts.push(1);
                    room = 1 + random.below(BURST_MAX);
                }
            }
            room = if alone { 0 } else { room - 1 };
        }
        Self { events, bursts }
    }

    pub fn bursts(&self) -> impl Iterator<Item = &[Event]> {
        self.bursts.iter().scan(0, |at, burst| {
            *at += burst;
            self.events.get(*at - burst..*at)
        })
    }

    /// What is written, one event after the other.
    pub fn writes(&self) -> impl Iterator<Item = (usize, &[Record])> {
        self.events.iter().enumerate().filter_map(|(number, event)| match event {
            Event::Write(records) => Some((number, records.as_slice())),
            Event::Refused(_) | Event::Reopen => None,
        })
    }

    /// What a store holds after the first so many events.
    pub fn after(&self, events: usize) -> Held {
        self.events.iter().take(events).fold(Held::default(), Held::with)
    }

    /// Sessions that the first so many events delete.
    pub fn deleted(&self, events: usize) -> impl Iterator<Item = u64> {
        let records = self.writes().take_while(move |(number, _)| *number < events).flat_map(|(_, records)| records);
        records.filter_map(|record| match record {
            Record::SessionDeleted { session } => Some(*session),
            _ => None,
        })
    }
}

/// What is there while events are drawn.
#[derive(Default)]
struct Drawing {
    random: Random,
    held: Held,
    /// The session that takes samples.
    open: Option<u64>,
    newest_session: u64,
    newest_set: i64,
    /// Requests of this run, and the ones among them that have no result.
    requests: u64,
    unanswered: Vec<u64>,
}

impl Drawing {
    fn event(&mut self) -> Event {
        let event = match self.random.below(20) {
            0 => Event::Reopen,
            1 => Event::Refused(self.refused()),
            2..=3 => Event::Write(self.deletion()),
            4..=6 => Event::Write(self.new_set()),
            7 => Event::Write(self.activation()),
            8..=9 => Event::Write(self.audited()),
            10 => Event::Write(vec![load(self.held.loads as u64 + 1)]),
            11 => Event::Write(vec![self.zero()]),
            _ => Event::Write(self.session()),
        };
        if matches!(event, Event::Reopen | Event::Refused(_)) {
            // A run knows of its own requests alone.
            (self.requests, self.unanswered) = (0, Vec::new());
        }
        self.held = std::mem::take(&mut self.held).with(&event);
        event
    }

    /// The open session begins, grows or ends.
    fn session(&mut self) -> Vec<Record> {
        let Some(number) = self.open else {
            self.newest_session += 1;
            self.open = Some(self.newest_session);
            return vec![session(self.newest_session, SessionState::Ramping), ramp(self.newest_session, 0)];
        };
        if self.random.below(6) == 0 {
            self.open = None;
            return vec![session(number, SessionState::Review)];
        }
        let from = self.held.sessions.get(&number).copied().unwrap_or(0);
        let samples = 1 + self.random.below(30) as u64;
        let sample = |index| Record::Sample { session: number, index, sample: signed(number, index) };
        (from..from + samples).map(sample).collect()
    }

    fn new_set(&mut self) -> Vec<Record> {
        self.newest_set += 1;
        let set = model_set(self.newest_set);
        let activation = activated(&set);
        let made = Record::ModelSet(Arc::new(set));
        if self.random.below(3) == 0 { vec![made] } else { vec![made, activation] }
    }

    /// One of the sets that are there comes into use.
    fn activation(&mut self) -> Vec<Record> {
        let sets: Vec<_> = self.held.sets.iter().cloned().collect();
        if sets.is_empty() {
            return self.new_set();
        }
        let model_set = sets[self.random.below(sets.len())].clone();
        vec![Record::Activated { patch: PATCH.to_owned(), model_set, wall_ns: 5 }]
    }

    /// Something is found against a zero, or another is taken.
    fn zero(&self) -> Record {
        let needs_confirmation =
            self.held.zero.needs_confirmation.is_none().then(|| format!("found with {} loads", self.held.loads));
        let mean: Vec<f64> = (0..self.held.asked % 4).map(|taxel| taxel as f64 / 8.0).collect();
        let taken = || TakenZero { noise: mean.clone(), mean: mean.clone(), ..TakenZero::default() };
        let zero = (!mean.is_empty()).then(|| Arc::new(taken()));
        let excused = needs_confirmation.as_ref().map(|why| format!("m-{}", why.len()));
        Record::Zero { patch: PATCH.to_owned(), zero: KeptZero { configured: None, needs_confirmation, excused, zero } }
    }

    /// A set that is not in use or a session that is over goes.
    fn deletion(&mut self) -> Vec<Record> {
        let idle = self.held.sets.iter().find(|&id| Some(id) != self.held.active.as_ref()).cloned();
        let over = self.held.sessions.keys().find(|&number| Some(*number) != self.open).copied();
        match (idle, over) {
            (Some(model_set), _) if self.random.below(2) == 0 => {
                vec![Record::ModelSetDeleted { model_set }]
            }
            (_, Some(session)) => vec![Record::SessionDeleted { session }],
            _ => self.session(),
        }
    }

    /// Somebody asks for something, or gets the answer.
    fn audited(&mut self) -> Vec<Record> {
        if let Some(request) = self.unanswered.pop() {
            return vec![answered(request)];
        }
        self.requests += 1;
        self.unanswered.push(self.requests);
        vec![asked(self.requests)]
    }

    /// A new set and its activation, then a sample that is not the next one.
    fn refused(&mut self) -> Vec<Record> {
        self.newest_set += 1;
        let set = model_set(self.newest_set);
        let activation = activated(&set);
        let sample = Record::Sample { session: self.newest_session, index: 1_000_000, sample: sample(0) };
        vec![Record::ModelSet(Arc::new(set)), activation, sample]
    }
}
