//! What a wrong force, or a time without one, may come from.

use std::time::Duration;

use taxel_skin::Time;

use crate::kinds::{Kind, Kinds};

/// What ended so long ago may still show: silence is judged after 150 ms, a power cycle after a second.
const AFTERMATH: Duration = Duration::from_millis(1500);

/// A fault that began so long ago and still lasts names a lie before anything else.
const FRESH: Duration = Duration::from_secs(10);

/// Whether a fault leaves the counts alone: only sessions and the disk see it.
const fn is_harmless(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::GaugeSilent | Kind::GaugeStuck | Kind::GaugeOffset | Kind::GaugeSpikes | Kind::BagLeak | Kind::StoreFails
    )
}

/// What goes on, what has just ended, and what a zero or a model set keeps of it.
#[derive(Debug)]
pub struct Suspects {
    begun: Vec<u32>,
    /// When each kind began last.
    newest: Vec<Option<Time>>,
    ended: Vec<Option<Time>>,
    /// What may have moved the counts since the zero was taken.
    since_zero: Kinds,
    /// What made a load the zero of a board: its taxels rest beyond the rail, whatever zero the daemon takes.
    boards: Kinds,
    /// What went wrong while the models in use were gathered.
    models: Kinds,
    /// Why there is no force now; `None` while there is one.
    blame: Option<Kinds>,
    /// All that ever happened.
    pub ever: Kinds,
}

impl Suspects {
    /// The daemon has just started, which counts as a restart: its first zero takes its time.
    pub fn new(now: Time) -> Self {
        let mut ended = vec![None; Kind::ALL.len()];
        ended[Kind::Restart as usize] = Some(now);
        Self {
            begun: vec![0; Kind::ALL.len()],
            newest: vec![None; Kind::ALL.len()],
            ended,
            since_zero: Kinds::default(),
            boards: Kinds::default(),
            models: Kinds::default(),
            blame: None,
            ever: Kinds::default(),
        }
    }

    pub fn begin(&mut self, kind: Kind, now: Time) {
        self.begun[kind as usize] += 1;
        self.newest[kind as usize] = Some(now);
        self.ever.insert(kind);
        if kind.is_fault() && !is_harmless(kind) {
            self.since_zero.insert(kind);
        }
    }

    pub fn end(&mut self, kind: Kind, now: Time) {
        self.begun[kind as usize] = self.begun[kind as usize].saturating_sub(1);
        self.ended[kind as usize] = Some(now);
    }

    /// Something that takes no time.
    pub fn happened(&mut self, kind: Kind, now: Time) {
        self.begin(kind, now);
        self.end(kind, now);
    }

    /// A zero was taken: what went on meanwhile stays in it.
    pub fn zero_taken(&mut self, now: Time, under: Option<Kind>) {
        self.since_zero = Kinds::default();
        let mut kept = self.present(now);
        Kind::ALL.iter().filter(|kind| !kind.is_fault()).for_each(|kind| kept.remove(*kind));
        [Kind::BoardsUnderLoad, Kind::ZeroUnderLoad, Kind::ZeroWhileChanging]
            .into_iter()
            .for_each(|kind| kept.remove(kind));
        self.since_zero = kept;
        if let Some(kind) = under {
            self.since_zero.insert(kind);
            self.ever.insert(kind);
        }
    }

    /// Models are in use that were gathered under these.
    pub fn models_of(&mut self, kinds: Kinds) {
        self.models = kinds;
    }

    /// A board has taken its zero, under a load or not. Only a configuration reaches all of them.
    pub fn board_zero(&mut self, kind: Kind, loaded: bool) {
        if loaded {
            self.boards.insert(kind);
            self.ever.insert(kind);
        } else if kind == Kind::BoardsUnderLoad {
            self.boards = Kinds::default();
        }
    }

    /// What a wrong force may come from now.
    pub fn present(&self, now: Time) -> Kinds {
        let mut kinds = self.since_zero.or(self.models).or(self.boards);
        for &kind in Kind::ALL {
            let (begun, ended) = (self.begun[kind as usize], self.ended[kind as usize]);
            if begun > 0 || ended.is_some_and(|ended| now < ended + AFTERMATH) {
                kinds.insert(kind);
            }
        }
        kinds
    }

    /// The kind that names what it may come from: a fault that has just begun, else what zero or models went through,
    /// else the newest fault.
    pub fn principal(&self, kinds: Kinds, now: Time) -> Option<Kind> {
        let root = [Kind::BoardsUnderLoad, Kind::ZeroWhileChanging, Kind::ZeroUnderLoad, Kind::LoadInSession];
        let newest = |kinds: &mut dyn Iterator<Item = Kind>| kinds.max_by_key(|kind| self.newest[*kind as usize]);
        let faults = || kinds.iter().filter(|kind| kind.is_fault() && !root.contains(kind));
        let fresh = |kind: &Kind| {
            let began = self.newest[*kind as usize].is_some_and(|began| now < began + FRESH);
            began && self.begun[*kind as usize] > 0 && !is_harmless(*kind)
        };
        newest(&mut faults().filter(fresh))
            .or_else(|| root.into_iter().find(|kind| kinds.has(*kind)))
            .or_else(|| newest(&mut faults()))
    }

    /// Notes whether there is a force; what its absence comes from, if there is none.
    pub fn force_is(&mut self, there: bool, now: Time) -> Option<Kinds> {
        let present = self.present(now);
        self.blame = match self.blame {
            _ if there => None,
            None => Some(present),
            // What the operator does to have it back is not why it went.
            Some(blame) => {
                Some(present.iter().filter(|kind| kind.is_fault()).fold(blame, |all, kind| all.or(Kinds::one(kind))))
            }
        };
        self.blame
    }
}
