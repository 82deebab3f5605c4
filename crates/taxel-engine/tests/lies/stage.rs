//! What everybody in a story acts on.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::command::Command;
use taxel_engine::snapshot::PatchSnapshot;
use taxel_sim::{CONVERSION, PumpCommand, World};
use taxel_skin::{Newton, Time};
use taxel_wire::Frame;
use taxel_wire::icub::Command as BoardCommand;

use crate::daemon::Daemon;
use crate::house::{House, Part, SLOT};
use crate::kinds::{Kind, Kinds};
use crate::suspects::Suspects;
use crate::tally::unseen_in_watch_n;
use crate::truth::Truth;

/// A zero is watched for a second, over scans as old as a sample can be.
const WATCH: Duration = Duration::from_millis(1100);
/// A bag that presses by less changes no force that matters, in kPa.
const BAG_KPA: f64 = 0.01;
/// A force that matters to a zero, in newton: two grams.
const LOAD_N: f64 = 0.02;

/// The world, the daemon, and what is known of both that the daemon does not know.
pub struct Stage {
    pub house: &'static House,
    /// The patch whose force is judged.
    pub watched: usize,
    /// Whether the positions of its taxels are known to the daemon.
    pub has_positions: bool,
    pub world: World,
    pub daemon: Daemon,
    pub suspects: Suspects,
    pub truth: Truth,
    /// Masses on the watched patch, as far as hands have to do with them.
    pub loads: usize,
    /// Until when loads come, roll or go.
    changes_until: Time,
    /// A board takes its zero with its next conversion: until when, and why.
    zero_due: Option<(Time, Kind)>,
    begin: Time,
    told: Vec<(f64, String)>,
    epoch: Option<u64>,
    /// What lay on the skin all the while its zero was taken and since, N.
    in_zero_n: f64,
    /// By how little a greater load changed while the zero was watched, N; `None` where it changed by much, or none lay there.
    changed_n: Option<f64>,
    active: Option<String>,
    /// What went on while the last session gathered.
    session: Kinds,
}

impl Stage {
    /// Those that are `cleared` name no lie.
    pub fn new(
        house: &'static House,
        (watched, has_positions): (usize, bool),
        world: World,
        daemon: Daemon,
        cleared: Kinds,
    ) -> Self {
        let begin = world.now();
        Self {
            house,
            watched,
            has_positions,
            world,
            daemon,
            suspects: Suspects::new(begin, cleared),
            truth: Truth::default(),
            loads: 0,
            changes_until: begin,
            zero_due: None,
            begin,
            told: Vec::new(),
            epoch: None,
            in_zero_n: 0.0,
            changed_n: None,
            active: Some(house.parts[watched].set.id.clone()),
            session: Kinds::default(),
        }
    }

    /// The patch that is watched.
    pub fn part(&self) -> &'static Part {
        &self.house.parts[self.watched]
    }

    /// The true force on a patch.
    pub fn force_on(&self, patch: usize) -> Newton {
        let part = &self.house.parts[patch];
        self.world.true_force_about(|taxel| part.has(taxel))
    }

    pub fn now(&self) -> Time {
        self.world.now()
    }

    /// How much of a load the zero may hide, because it has lain there all the while that was taken and since, in newton.
    pub const fn in_zero_n(&self) -> f64 {
        self.in_zero_n
    }

    /// Whether a lie is by more than the little that changed while the zero was watched: what rested there makes it one.
    pub fn is_of_what_rested(&self, excess_n: f64) -> bool {
        self.changed_n.is_some_and(|changed_n| excess_n > changed_n)
    }

    /// Seconds since the story began.
    pub fn seconds(&self) -> f64 {
        self.now().seconds_since(self.begin)
    }

    /// Another line of the story.
    pub fn tell(&mut self, what: impl Into<String>) {
        self.told.push((self.seconds(), what.into()));
    }

    /// The last lines of the story.
    pub fn last_lines(&self, lines: usize) -> Vec<String> {
        let first = self.told.len().saturating_sub(lines);
        self.told[first..].iter().map(|(seconds, what)| format!("{seconds:8.2} s  {what}")).collect()
    }

    /// The truth may just have changed at once.
    pub fn note_truth(&mut self) {
        let now = self.world.now();
        self.truth.note(now, self.force_on(self.watched).0);
        self.in_zero_n = self.in_zero_n.min(self.truth.newest());
        if now <= self.changes_until || self.world.true_pressure().0 > BAG_KPA {
            self.note_modules();
        }
        if let Some((until, kind)) = self.zero_due {
            if self.truth.newest() > LOAD_N {
                self.suspects.board_zero(kind, true);
            }
            self.zero_due = Some((until, kind)).filter(|_| now < until);
        }
    }

    /// From now on, for so long, something on the skin changes.
    pub fn changes(&mut self, over: Duration) {
        self.note_modules();
        self.changes_until = self.changes_until.max(self.now() + over + 2 * SLOT);
    }

    /// What bears on each module: of the true force, in the shares of what its taxels feel. A layer spreads some of a load
    /// to where no taxel is, so that what all feel is not all there is.
    fn note_modules(&mut self) {
        let (part, area) = (self.part(), self.world.skin().taxel_area());
        let pressures: Vec<_> = self.world.true_taxel_pressures().collect();
        let mut newton = vec![0.0; part.patch().modules().len()];
        for (site, taxel) in part.patch().taxels().iter().zip(&part.taxels) {
            newton[usize::from(site.module)] += pressures[usize::from(taxel.0)].on(area).0;
        }
        let felt: f64 = newton.iter().sum();
        if felt > 0.0 {
            let scale = self.force_on(self.watched).0 / felt;
            newton.iter_mut().for_each(|newton| *newton *= scale);
        }
        self.truth.note_modules(self.world.now(), newton.into());
    }

    pub fn pump(&mut self, command: PumpCommand) {
        self.tell(format!("pump: {command:?}"));
        self.world.pump(command);
    }

    /// The operator gives a command.
    pub fn give(&mut self, kind: Kind, command: Command) {
        let words = match &command {
            Command::Import { model_set, .. } => format!("Import {} of session {:?}", model_set.id, model_set.session),
            other => format!("{other:?}"),
        };
        let request = self.daemon.command(command);
        self.tell(format!("command {}: {words}", request.0));
        self.suspects.happened(kind, self.world.now());
    }

    pub fn restart(&mut self) {
        self.tell("the daemon starts");
        self.daemon.start();
        self.epoch = None;
    }

    /// Tells the answers, and follows zero, session and models.
    pub fn follow(&mut self) {
        for (request, reply) in std::mem::take(&mut self.daemon.replies) {
            self.tell(format!("reply to {}: {reply}", request.0));
        }
        let now = self.now();
        if self.daemon.sessions[self.watched].as_ref().is_some_and(|session| session.state.is_open()) {
            self.session = self.session.or(self.suspects.present(now));
            if self.loads > 0 {
                self.session.insert(Kind::LoadInSession);
                self.suspects.ever.insert(Kind::LoadInSession);
            }
        }
        let mut active = self.daemon.catalogue.active.iter();
        let active = active.find(|(patch, _)| patch == self.part().name()).and_then(|(_, set)| set.as_ref());
        if self.daemon.is_running() && active != self.active.as_ref() {
            self.active = active.cloned();
            let foreign = self.active.as_ref().is_some_and(|id| *id != self.part().set.id);
            let mut kinds = if foreign { self.session } else { Kinds::default() };
            Kind::ALL.iter().filter(|kind| !kind.is_fault()).for_each(|kind| kinds.remove(*kind));
            for zero in [Kind::BoardsUnderLoad, Kind::ZeroWhileChanging, Kind::ZeroUnderLoad] {
                if kinds.has(zero) {
                    kinds.remove(zero);
                    kinds.insert(Kind::LoadInSession);
                }
            }
            self.suspects.models_of(kinds);
            self.tell(format!("active models: {:?}", self.active));
        }
    }

    /// The daemon sends to the boards. Configuring one makes what lies there its zero.
    pub fn send(&mut self, frame: &Frame) {
        if let Some((board, BoardCommand::SetTriangles(_))) = BoardCommand::decode(frame)
            && self.part().has_board(board)
        {
            self.board_zero(Kind::BoardsUnderLoad);
            self.zero_due = Some((self.now() + CONVERSION + 2 * SLOT, Kind::BoardsUnderLoad));
        }
        self.world.send(self.now(), frame);
    }

    /// A board takes its zero now.
    pub fn board_zero(&mut self, kind: Kind) {
        self.suspects.board_zero(kind, self.truth.newest() > LOAD_N);
    }

    /// The boards are configured by somebody else.
    pub fn bring_up_by_another(&mut self) {
        self.tell("the robot's own software brings the boards up");
        self.suspects.happened(Kind::BringUp, self.world.now());
        self.board_zero(Kind::BoardsUnderLoad);
        self.world.bring_up_boards(self.world.now());
    }

    /// A session begins: what it will gather is not yet touched by anything.
    pub fn new_session(&mut self) {
        self.session = Kinds::default();
    }

    /// A snapshot tells of its zero: a new one is judged by what lay on the skin while it was taken.
    pub fn follow_zero(&mut self, snapshot: &Arc<PatchSnapshot>) {
        let Some(tare) = snapshot.tare.as_ref().filter(|tare| self.epoch != Some(tare.epoch)) else { return };
        self.epoch = Some(tare.epoch);
        if !tare.valid {
            self.tell(format!("no zero: {}", tare.reason));
            return;
        }
        let (least, greatest) = self.truth.range(snapshot.time - WATCH, snapshot.time);
        // What changed within the watch's noise beside a greater load that lay there throughout is not what makes the zero wrong.
        let changed = greatest - least;
        let unseen = unseen_in_watch_n(snapshot.taxels.len());
        let under = match greatest {
            newton if newton <= LOAD_N => None,
            _ if changed > LOAD_N && (changed >= unseen || changed >= least) => Some(Kind::ZeroWhileChanging),
            _ => Some(Kind::ZeroUnderLoad),
        };
        let now = self.now();
        self.suspects.zero_taken(now, under);
        self.in_zero_n = if under.is_some() { least } else { 0.0 };
        // A zero over a great change is to blame on that, whatever rested there.
        self.changed_n = (changed < least.min(1.2 * unseen)).then_some(changed);
        self.tell(format!("zero {} under {least:.3} to {greatest:.3} N: {}", tare.epoch, tare.reason));
    }
}
