//! Board bring-up as the robots' own host does it, and its proof: none of these commands is acknowledged, so only
//! frames from every enabled module show that it worked.
//!
//! 0x4D clears the enable mask and 0x50 takes the board's zero anew, so a bring-up always loses the tare.

use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::{Board, Patch, Time};
use taxel_wire::Frame;
use taxel_wire::icub::{BoardConfig, Command, TriangleConfig};

/// Between 0x4D and the first 0x50.
const AFTER_BOARD_CONFIG: Duration = Duration::from_millis(10);
/// A board measures its offsets after a 0x50.
const AFTER_TRIANGLES: Duration = Duration::from_millis(500);
/// Between the exceptions and the start.
const BEFORE_START: Duration = Duration::from_millis(10);
/// Time in which every enabled module has to be heard after the start.
const PROOF_WITHIN: Duration = Duration::from_secs(2);
/// The protocol version that is asked for; boards answer with their own.
const PROTOCOL: (u8, u8) = (1, 0);

/// The values that a board is configured with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSetup {
    /// Command 0x4D.
    pub board: BoardConfig,
    /// Command 0x50, first the defaults and then the exceptions.
    pub triangles: Vec<TriangleConfig>,
}

/// Where the bring-up of a patch stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BringUpState {
    /// The plan has no settings: the daemon only listens.
    Listening,
    /// Commands are being sent.
    Configuring,
    /// All commands are out; frames of every module are awaited.
    Proving,
    /// Every enabled module has been heard.
    Verified,
    /// These modules stayed silent: positions in the patch's module list.
    Incomplete(Vec<usize>),
}

/// A command and when it is due.
#[derive(Clone, Debug)]
struct Step {
    due: Time,
    board: usize,
    frame: Frame,
}

/// The bring-up of one patch.
#[derive(Clone, Debug)]
pub struct BringUp {
    state: BringUpState,
    /// In the order in which they are due.
    steps: VecDeque<Step>,
    heard: Vec<bool>,
    proof_until: Time,
}

impl BringUp {
    /// Nothing is sent until [`BringUp::start`].
    #[must_use]
    pub fn new(modules: usize) -> Self {
        let heard = vec![false; modules];
        Self { state: BringUpState::Listening, steps: VecDeque::new(), heard, proof_until: Time::default() }
    }

    /// Lays out all commands from `now` on. Without settings the patch is only listened to.
    pub fn start(&mut self, now: Time, patch: &Patch, setups: &[BoardSetup]) {
        self.steps.clear();
        self.heard.fill(false);
        if setups.is_empty() {
            self.state = BringUpState::Listening;
            return;
        }
        self.state = BringUpState::Configuring;
        let (configured, tared) = (now + AFTER_BOARD_CONFIG, now + AFTER_BOARD_CONFIG + AFTER_TRIANGLES);
        for (index, (board, setup)) in patch.boards().iter().zip(setups).enumerate() {
            self.plan(now, index, board, Command::QueryFirmware { protocol: PROTOCOL });
            self.plan(now, index, board, Command::SetBoardConfig(setup.board));
            for (n, triangles) in setup.triangles.iter().enumerate() {
                let due = if n == 0 { configured } else { tared };
                self.plan(due, index, board, Command::SetTriangles(*triangles));
            }
            self.plan(tared + BEFORE_START, index, board, Command::Start);
        }
        self.steps.make_contiguous().sort_by_key(|step| step.due); // stable: a board's commands keep their order
        self.proof_until = tared + BEFORE_START + PROOF_WITHIN;
    }

    /// Lays out the commands of devices that are described by their signals: each with its device's position and how long
    /// after `now` it is due.
    pub fn start_devices(&mut self, now: Time, commands: impl Iterator<Item = (usize, Duration, Frame)>) {
        self.heard.fill(false);
        self.steps = commands.map(|(board, after, frame)| Step { due: now + after, board, frame }).collect();
        self.steps.make_contiguous().sort_by_key(|step| step.due); // stable: commands of one time keep their order
        self.state = if self.steps.is_empty() { BringUpState::Listening } else { BringUpState::Configuring };
        self.proof_until = self.steps.back().map_or(now, |step| step.due) + PROOF_WITHIN;
    }

    fn plan(&mut self, due: Time, board: usize, at: &Board, command: Command) {
        self.steps.push_back(Step { due, board, frame: command.encode(at.address) });
    }

    /// The next command that is due, with the position of its board; call until there is none.
    ///
    /// Who comes late moves all that follows, because boards need the waits between the commands, and so do patches that
    /// share a board: the second's configuration must not come after the first has enabled its modules.
    pub fn next_due(&mut self, now: Time) -> Option<(usize, Frame)> {
        let due = self.steps.front().is_some_and(|step| step.due <= now);
        let step = if due { self.steps.pop_front()? } else { return None };
        let late = now.since(step.due);
        self.steps.iter_mut().for_each(|step| step.due = step.due + late);
        self.proof_until = self.proof_until + late;
        if self.steps.is_empty() {
            self.state = BringUpState::Proving;
        }
        Some((step.board, step.frame))
    }

    /// When the next command is due, or the proof must have come.
    #[must_use]
    pub fn deadline(&self) -> Option<Time> {
        let proof = (self.state == BringUpState::Proving).then(|| self.proof_until + Duration::from_nanos(1));
        self.steps.front().map(|step| step.due).or(proof)
    }

    /// A whole module was received.
    pub fn heard(&mut self, module: usize) {
        if self.state != BringUpState::Proving && !matches!(self.state, BringUpState::Incomplete(_)) {
            return;
        }
        self.heard[module] = true;
        if self.heard.iter().all(|&h| h) {
            self.state = BringUpState::Verified;
        }
    }

    /// Time passed: an unproven bring-up becomes incomplete. Returns whether it has just become so.
    pub fn tick(&mut self, now: Time) -> bool {
        let over = self.state == BringUpState::Proving && now > self.proof_until;
        if over {
            let silent = self.heard.iter().enumerate().filter(|(_, h)| !**h).map(|(m, _)| m).collect();
            self.state = BringUpState::Incomplete(silent);
        }
        over
    }

    /// Where it stands.
    #[must_use]
    pub const fn state(&self) -> &BringUpState {
        &self.state
    }

    /// Whether commands are still to be sent, so that silence and re-tares are expected.
    #[must_use]
    pub const fn is_busy(&self) -> bool {
        matches!(self.state, BringUpState::Configuring)
    }

    /// Whether the boards are expected to send.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        !matches!(self.state, BringUpState::Configuring | BringUpState::Proving)
    }

    /// The bring-up of one board in words; `modules` are the positions and names of its modules.
    #[must_use]
    pub fn in_words(&self, modules: impl Iterator<Item = (usize, String)>) -> String {
        match &self.state {
            BringUpState::Listening => "listening".to_owned(),
            BringUpState::Configuring | BringUpState::Proving => "configuring".to_owned(),
            BringUpState::Verified => "verified".to_owned(),
            BringUpState::Incomplete(silent) => {
                let mine: Vec<String> = modules.filter(|(m, _)| silent.contains(m)).map(|(_, name)| name).collect();
                if mine.is_empty() {
                    return "verified".to_owned();
                }
                format!("incomplete: no frame from modules {}", mine.join(", "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::{BoardAddress, BusIndex, Module, ModuleKind};

    fn patch() -> Patch {
        let modules =
            vec![(Module::from_nibble(0), ModuleKind::Triangle), (Module::from_nibble(1), ModuleKind::Triangle)];
        let board = |address| Board {
            bus: BusIndex(0),
            address: BoardAddress::new(address).unwrap(),
            modules: modules.clone(),
        };
        Patch::new("p", vec![board(13), board(12)]).unwrap()
    }

    fn setup() -> BoardSetup {
        let triangles = |shift| TriangleConfig {
            first: Module::from_nibble(0),
            last: Module::from_nibble(15),
            shift,
            enabled: true,
            cdc_offset: 0x2200,
        };
        let board = BoardConfig { kind: 0, period_ms: 50, no_load: 240 };
        BoardSetup { board, triangles: vec![triangles(2), triangles(3)] }
    }

    fn ms(ms: i64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn commands_come_in_the_hosts_order_with_its_waits() {
        let mut bring_up = BringUp::new(4);
        bring_up.start(ms(0), &patch(), &[setup(), setup()]);
        let mut seen = Vec::new();
        for t in 0..600 {
            while let Some((board, frame)) = bring_up.next_due(ms(t)) {
                seen.push((t, board, frame.bytes()[0]));
            }
        }
        let expected: Vec<(i64, usize, u8)> = [
            (0, vec![(0, 0x1C), (0, 0x4D), (1, 0x1C), (1, 0x4D)]),
            (10, vec![(0, 0x50), (1, 0x50)]),
            (510, vec![(0, 0x50), (1, 0x50)]),
            (520, vec![(0, 0x07), (1, 0x07)]),
        ]
        .into_iter()
        .flat_map(|(t, list)| list.into_iter().map(move |(board, byte)| (t, board, byte)))
        .collect();
        assert_eq!(seen, expected);
        assert_eq!(bring_up.state(), &BringUpState::Proving);
    }

    #[test]
    fn the_waits_are_kept_however_late_somebody_asks() {
        let mut bring_up = BringUp::new(4);
        bring_up.start(ms(0), &patch(), &[setup(), setup()]);
        let mut stages = Vec::new();
        for t in (100..2_000).step_by(30) {
            let sent = std::iter::from_fn(|| bring_up.next_due(ms(t))).count();
            stages.extend((sent > 0).then_some((t, sent)));
        }
        assert_eq!(stages, [(100, 4), (130, 2), (640, 2), (670, 2)]);
    }

    #[test]
    fn only_frames_of_every_module_verify_it() {
        let mut bring_up = BringUp::new(4);
        bring_up.start(ms(0), &patch(), &[setup(), setup()]);
        bring_up.heard(3); // before the start: an old stream, proves nothing
        for t in 0..=520 {
            while bring_up.next_due(ms(t)).is_some() {}
        }
        for module in 0..3 {
            bring_up.heard(module);
        }
        bring_up.tick(ms(2_521));
        assert_eq!(bring_up.state(), &BringUpState::Incomplete(vec![3]));
        bring_up.heard(3);
        assert_eq!(bring_up.state(), &BringUpState::Verified, "a late module still completes it");
    }

    #[test]
    fn without_settings_nothing_is_sent() {
        let mut bring_up = BringUp::new(4);
        bring_up.start(ms(0), &patch(), &[]);
        assert_eq!(bring_up.next_due(ms(9_999)), None);
        assert_eq!(bring_up.state(), &BringUpState::Listening);
    }
}
