//! What a wrong force, or a time without one, may come from.

use std::time::Duration;

use taxel_skin::Time;

use crate::kinds::{Kind, Kinds};
use crate::truth::AGE_MAX;

/// What ended so long ago may still show: silence is judged after 150 ms, a power cycle after a second.
pub const AFTERMATH: Duration = Duration::from_millis(1500);

/// A fault that began so long before a lie and still lasts names it before anything else.
const FRESH: Duration = Duration::from_secs(10);

/// What zero and models went through; the first of these that holds names a lie.
const ROOTS: [Kind; 4] = [Kind::BoardsUnderLoad, Kind::ZeroWhileChanging, Kind::ZeroUnderLoad, Kind::LoadInSession];

/// What gives a board a zero of its own.
pub const RETARES: [Kind; 4] = [Kind::Glitch, Kind::BoardRetare, Kind::NoAcks, Kind::PowerCycle];

/// What keeps modules from being heard.
const MUTES: [Kind; 9] = [
    Kind::BoardSilent,
    Kind::OtherPeriod,
    Kind::ModuleSilent,
    Kind::ModuleUnplugged,
    Kind::FramesLost,
    Kind::FramesDuplicated,
    Kind::FramesSwapped,
    Kind::FramesHeld,
    Kind::Stall,
];

/// Whether a fault leaves the counts alone: only sessions and the disk see it.
const fn is_harmless(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::GaugeSilent | Kind::GaugeStuck | Kind::GaugeOffset | Kind::GaugeSpikes | Kind::BagLeak | Kind::StoreFails
    )
}

/// What is known of a lie when its cause is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Wrong {
    /// When the sample was taken.
    pub time: Time,
    /// The force reads less than the truth.
    pub too_little: bool,
    /// It did so already in the very first sample at this zero.
    pub of_zero: bool,
    /// It would not, had the zero not taken in what lay there.
    pub by_zero: bool,
    /// It is by more than what came while the zero was watched, and that was little: what rested there is to blame.
    pub rested: bool,
    /// Since when it has been told, by as much at some moment as it is now.
    pub since: Time,
}

/// From when to when something went on, once or several times at the same time.
#[derive(Clone, Copy, Debug)]
struct Spell {
    kind: Kind,
    began: Time,
    /// How many times it goes on.
    times: u32,
    /// When the last of them ended.
    ended: Option<Time>,
}

/// What goes on, what has just ended, and what a zero or a model set keeps of it.
#[derive(Debug)]
pub struct Suspects {
    /// What goes on, and what ended shortly ago.
    spells: Vec<Spell>,
    /// Those that have ended at least once.
    over: Kinds,
    /// Those that go on.
    going_on: Kinds,
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
    /// Those that name no lie: the same are told without them.
    cleared: Kinds,
}

impl Suspects {
    /// The daemon has just started, which counts as a restart: its first zero takes its time. Those that are `cleared` name
    /// no lie.
    pub fn new(now: Time, cleared: Kinds) -> Self {
        let mut ended = vec![None; Kind::ALL.len()];
        ended[Kind::Restart as usize] = Some(now);
        Self {
            spells: Vec::new(),
            over: Kinds::one(Kind::Restart),
            going_on: Kinds::default(),
            newest: vec![None; Kind::ALL.len()],
            ended,
            since_zero: Kinds::default(),
            boards: Kinds::default(),
            models: Kinds::default(),
            blame: None,
            ever: Kinds::default(),
            cleared,
        }
    }

    pub fn begin(&mut self, kind: Kind, now: Time) {
        match self.spells.iter_mut().find(|spell| spell.kind == kind && spell.times > 0) {
            Some(spell) => spell.times += 1,
            None => self.spells.push(Spell { kind, began: now, times: 1, ended: None }),
        }
        self.going_on.insert(kind);
        self.newest[kind as usize] = Some(now);
        self.ever.insert(kind);
        if kind.is_fault() && !is_harmless(kind) {
            self.since_zero.insert(kind);
        }
    }

    pub fn end(&mut self, kind: Kind, now: Time) {
        self.spells.retain(|spell| spell.ended.is_none_or(|ended| now <= ended + FRESH));
        if let Some(spell) = self.spells.iter_mut().find(|spell| spell.kind == kind && spell.times > 0) {
            spell.times -= 1;
            if spell.times == 0 {
                spell.ended = Some(now);
                self.going_on.remove(kind);
            }
        }
        self.ended[kind as usize] = Some(now);
        self.over.insert(kind);
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

    /// A board has taken its zero, under a load or not. Only a configuration reaches all of them: what they had before is
    /// gone then.
    pub fn board_zero(&mut self, kind: Kind, loaded: bool) {
        if kind == Kind::BoardsUnderLoad {
            self.boards = Kinds::default();
        }
        if loaded {
            self.boards.insert(kind);
            self.ever.insert(kind);
        }
    }

    /// What may have moved the counts since the zero was taken.
    pub fn since_zero(&self) -> Kinds {
        self.since_zero
    }

    /// What a wrong force may come from now.
    pub fn present(&self, now: Time) -> Kinds {
        let fresh = |kind: &Kind| self.ended[*kind as usize].is_some_and(|ended| now < ended + AFTERMATH);
        let all = self.since_zero.or(self.models).or(self.boards).or(self.going_on);
        self.over.iter().filter(fresh).fold(all, |all, kind| all.or(Kinds::one(kind)))
    }

    /// The kind that names what a force may be wrong by: a fault that has just begun and lasted when the sample was taken, a
    /// board's own zero under a load, what zero and models went through, or else the newest fault. What reads too little
    /// already in the very first sample at a zero comes from the zero or from its boards, as does what would hold but for the
    /// load that the zero has taken in, what reads too much rather from a fault that lasts or a board's own zero than from the
    /// daemon's, and what has been told for a while from nothing that began since.
    pub fn principal(&self, kinds: Kinds, wrong: Wrong) -> Option<Kind> {
        let Wrong { time, too_little, since, by_zero, .. } = wrong;
        let of_zero = too_little && (wrong.of_zero || by_zero);
        let newest = |kinds: &mut dyn Iterator<Item = Kind>| kinds.max_by_key(|kind| self.newest[*kind as usize]);
        // What keeps modules from being heard adds nothing to a force, unless there is nothing else that could.
        let may = |kind: &Kind| kind.is_fault() && !ROOTS.contains(kind) && !self.cleared.has(*kind);
        let faults = || kinds.iter().filter(may);
        let adds = |kind: &Kind| too_little || !MUTES.contains(kind);
        let began = |kind: &Kind| {
            let lasts = |spell: &&Spell| spell.ended.is_none_or(|ended| time <= ended + AGE_MAX);
            let in_time = |spell: &&Spell| (spell.began..spell.began + FRESH).contains(&since);
            let of_kind = self.spells.iter().filter(|spell| spell.kind == *kind);
            of_kind.filter(lasts).filter(in_time).map(|spell| spell.began).max()
        };
        let retared =
            |kind: &Kind| self.boards.has(*kind) && (of_zero || self.since_zero.has(*kind)) && !self.cleared.has(*kind);
        let retared = || RETARES.into_iter().filter(|_| too_little).find(retared);
        // What a zero has taken in makes a force too little, never too much: a fault that lasts adds to it sooner.
        let lasting =
            || newest(&mut faults().filter(|kind| adds(kind) && !is_harmless(*kind) && self.going_on.has(*kind)));
        // A board's own zero leaves residues on its taxels, either way.
        let own = || RETARES.into_iter().find(|kind| self.since_zero.has(*kind) && !self.cleared.has(*kind));
        let adding = || (!too_little).then(|| lasting().or_else(own)).flatten();
        let rests = |kind| if wrong.rested && kind == Kind::ZeroWhileChanging { Kind::ZeroUnderLoad } else { kind };
        let root = || ROOTS.into_iter().find(|kind| kinds.has(*kind)).map(rests);
        let begun =
            faults().filter(|kind| adds(kind) && !is_harmless(*kind)).filter_map(|kind| Some((began(&kind)?, kind)));
        let begun = begun.max().map(|(_, kind)| kind).filter(|_| !of_zero);
        begun
            .or_else(retared)
            .or_else(adding)
            .or_else(root)
            .or_else(|| newest(&mut faults().filter(|kind| adds(kind) && !is_harmless(*kind))))
            .or_else(|| newest(&mut faults().filter(|kind| !is_harmless(*kind))))
            .or_else(|| newest(&mut faults()))
    }

    /// The newest of what keeps modules from being heard, while it lasts and shortly after.
    pub fn mutes(&self, now: Time) -> Option<Kind> {
        let present = self.present(now);
        let may = |kind: &Kind| present.has(*kind) && !self.cleared.has(*kind);
        MUTES.iter().copied().filter(may).max_by_key(|kind| self.newest[*kind as usize])
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
