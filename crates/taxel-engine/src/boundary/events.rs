//! What happened that an operator may ask for later: zeros, faults, activations, sessions and buses, with their times.
//!
//! [`EventWatch`] derives it from what the engine puts out, so that an event says what every reader was shown, and nothing
//! else. Zeros, sessions, activations and buses are reported each; of faults of taxels those that come and end.

use crate::boundary::catalogue::Catalogue;
use crate::boundary::fault_events::FaultLog;
use crate::boundary::output::Output;
use crate::boundary::snapshot::{Health, PatchSnapshot};
use crate::calibration::view::{SessionState, SessionView};

/// What sort of thing happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EventKind {
    /// A zero was taken.
    Tared,
    /// The zero does not hold any more.
    ZeroLost,
    /// Taxels have a fault that they did not have.
    FaultsCame,
    /// Taxels have a fault no more.
    FaultsWent,
    /// A model set came into use.
    Activated,
    /// A session reached another state.
    Session,
    /// Frames can come from a bus.
    BusUp,
    /// No frame can come from a bus.
    BusDown,
}

/// One thing that happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When, nanoseconds since 1970.
    pub wall_ns: i64,
    /// What sort of thing.
    pub kind: EventKind,
    /// The patch that it is about; empty of a bus.
    pub patch: String,
    /// What happened and why, in words.
    pub text: String,
    /// The taxels that it is about, ascending.
    pub taxels: Vec<u16>,
    /// The session that it is about.
    pub session: Option<u64>,
    /// The model set that it is about.
    pub model_set: Option<String>,
    /// The bus that it is about, by its position in the plan.
    pub bus: Option<u8>,
}

impl Event {
    fn new(wall_ns: i64, kind: EventKind, patch: &str, text: String) -> Self {
        let patch = patch.to_owned();
        Self { wall_ns, kind, patch, text, taxels: Vec::new(), session: None, model_set: None, bus: None }
    }
}

/// What was last reported of a patch.
#[derive(Debug)]
struct PatchSeen {
    name: String,
    epoch: u64,
    /// Whether the zero held.
    held: bool,
    faults: FaultLog,
    session: Option<(u64, SessionState)>,
    active: Option<String>,
}

/// Watches what the engine puts out.
#[derive(Debug)]
pub struct EventWatch {
    patches: Vec<PatchSeen>,
    /// Whether each bus was up; `None` before the first health.
    buses: Vec<Option<bool>>,
}

impl EventWatch {
    /// For patches of these names. `active`: the sets that are in use from the start, by patch.
    #[must_use]
    pub fn new<'a>(patches: impl IntoIterator<Item = &'a str>, active: &[(String, String)]) -> Self {
        let in_use = |name: &str| active.iter().find(|(patch, _)| patch == name).map(|(_, set)| set.clone());
        let seen = |name: &str| PatchSeen {
            name: name.to_owned(),
            epoch: 0,
            held: false,
            faults: FaultLog::new(),
            session: None,
            active: in_use(name),
        };
        Self { patches: patches.into_iter().map(seen).collect(), buses: Vec::new() }
    }

    /// Looks at something that the engine put out at this time; what it means goes to `events`.
    pub fn look(&mut self, wall_ns: i64, output: &Output, events: &mut Vec<Event>) {
        match output {
            Output::Patch(index, snapshot) => {
                if let Some(patch) = self.patches.get_mut(*index) {
                    patch.zero(wall_ns, snapshot, events);
                    patch.faults(wall_ns, snapshot, events);
                }
            }
            Output::Session(index, view) => {
                if let Some(patch) = self.patches.get_mut(*index) {
                    patch.session(wall_ns, view, events);
                }
            }
            Output::Health(health) => self.buses(wall_ns, health, events),
            Output::Catalogue(catalogue) => self.activations(wall_ns, catalogue, events),
            _ => {}
        }
    }

    fn buses(&mut self, wall_ns: i64, health: &Health, events: &mut Vec<Event>) {
        self.buses.resize(health.buses.len(), None);
        for (number, (before, bus)) in (0_u8..).zip(self.buses.iter_mut().zip(&health.buses)) {
            let was = before.replace(bus.up);
            // A bus that has not come up yet is no news; that it went down is.
            if was == Some(bus.up) || (was.is_none() && !bus.up) {
                continue;
            }
            let (kind, word) = if bus.up { (EventKind::BusUp, "up") } else { (EventKind::BusDown, "down") };
            let why = if bus.problem.is_empty() { String::new() } else { format!(": {}", bus.problem) };
            let event = Event::new(wall_ns, kind, "", format!("bus {number} is {word}{why}"));
            events.push(Event { bus: Some(number), ..event });
        }
    }

    fn activations(&mut self, wall_ns: i64, catalogue: &Catalogue, events: &mut Vec<Event>) {
        for (name, active) in &catalogue.active {
            let Some(patch) = self.patches.iter_mut().find(|patch| patch.name == *name) else { continue };
            if patch.active == *active {
                continue;
            }
            let before = std::mem::replace(&mut patch.active, active.clone());
            if let Some(set) = active {
                let before = before.map_or_else(String::new, |before| format!("; before it: {before}"));
                let event = Event::new(wall_ns, EventKind::Activated, name, format!("{set} is in use{before}"));
                events.push(Event { model_set: Some(set.clone()), ..event });
            }
        }
    }
}

impl PatchSeen {
    fn zero(&mut self, wall_ns: i64, snapshot: &PatchSnapshot, events: &mut Vec<Event>) {
        let Some(tare) = snapshot.tare.as_ref().filter(|tare| tare.epoch != self.epoch) else { return };
        self.epoch = tare.epoch;
        let held = std::mem::replace(&mut self.held, tare.valid);
        let kind = match (held, tare.valid) {
            (_, true) => EventKind::Tared,
            (true, false) => EventKind::ZeroLost,
            (false, false) => return, // there was none to lose
        };
        events.push(Event::new(wall_ns, kind, &self.name, tare.reason.clone()));
    }

    fn faults(&mut self, wall_ns: i64, snapshot: &PatchSnapshot, events: &mut Vec<Event>) {
        let Some(now) = snapshot.taxels.faults() else { return };
        let news = [EventKind::FaultsCame, EventKind::FaultsWent].into_iter().zip(self.faults.look(wall_ns, now));
        for (kind, (text, taxels)) in news.filter_map(|(kind, news)| Some((kind, news?))) {
            events.push(Event { taxels, ..Event::new(wall_ns, kind, &self.name, text) });
        }
    }

    fn session(&mut self, wall_ns: i64, view: &SessionView, events: &mut Vec<Event>) {
        let state = Some((view.number, view.state));
        if std::mem::replace(&mut self.session, state) == state {
            return;
        }
        let reason = if view.reason.is_empty() { String::new() } else { format!(": {}", view.reason) };
        let text = format!("session {} is {}{reason}", view.number, view.state.name());
        let event = Event::new(wall_ns, EventKind::Session, &self.name, text);
        let model_set = view.model_set.as_deref().map(str::to_owned);
        events.push(Event { session: Some(view.number), model_set, ..event });
    }
}
