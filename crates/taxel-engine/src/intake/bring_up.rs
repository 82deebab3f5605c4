//! Board bring-up as the robots' own host does it, and its proof: none of these commands is acknowledged, so only
//! frames from every enabled module show that it worked.
//!
//! 0x4D clears the enable mask and 0x50 takes the board's zero anew, so a bring-up always loses the tare.

use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::{Board, Patch, Time};
use taxel_wire::Frame;
use taxel_wire::icub::{BoardConfig, Command, TriangleConfig};

use crate::intake::cells::DevicePlan;

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
    /// Nothing was sent: the daemon only listens, or has not heard yet whether the boards stream.
    Listening,
    /// Commands are being sent.
    Configuring,
    /// All commands are out; frames of every module are awaited.
    Proving,
    /// The boards stream and were left alone; frames of every module are awaited.
    LeftAlone,
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
    pub fn new(modules: usize) -> Self {
        let heard = vec![false; modules];
        Self { state: BringUpState::Listening, steps: VecDeque::new(), heard, proof_until: Time::default() }
    }

    /// Lays out the commands from `now` on: for skin boards as the robots' own host sends them, for described devices those of
    /// their plan. Only the boards that are `wanted` get any, and the others keep their zeros.
    pub fn start(&mut self, now: Time, patch: &Patch, setups: &[BoardSetup], devices: &[DevicePlan], wanted: &[bool]) {
        self.heard.fill(false);
        let is_wanted = |step: &Step| wanted.get(step.board) == Some(&true);
        self.steps = steps(now, patch, setups, devices).filter(is_wanted).collect();
        self.steps.make_contiguous().sort_by_key(|step| step.due); // stable: a board's commands keep their order
        let configured = !setups.is_empty() || devices.iter().any(DevicePlan::is_configured);
        self.state = match (configured, self.steps.is_empty()) {
            (false, _) => BringUpState::Listening,
            (true, true) => BringUpState::LeftAlone,
            (true, false) => BringUpState::Configuring,
        };
        self.proof_until = self.steps.back().map_or(now, |step| step.due) + PROOF_WITHIN;
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
    pub fn deadline(&self) -> Option<Time> {
        let proof = self.awaits_frames().then(|| self.proof_until + Duration::from_nanos(1));
        self.steps.front().map(|step| step.due).or(proof)
    }

    /// A whole module was received.
    pub fn heard(&mut self, module: usize) {
        if !self.awaits_frames() && !matches!(self.state, BringUpState::Incomplete(_)) {
            return;
        }
        self.heard[module] = true;
        if self.heard.iter().all(|&h| h) {
            self.state = BringUpState::Verified;
        }
    }

    /// Time passed: an unproven bring-up becomes incomplete. Returns whether it has just become so.
    pub fn tick(&mut self, now: Time) -> bool {
        let over = self.awaits_frames() && now > self.proof_until;
        if over {
            let silent = self.heard.iter().enumerate().filter(|(_, h)| !**h).map(|(m, _)| m).collect();
            self.state = BringUpState::Incomplete(silent);
        }
        over
    }

    const fn awaits_frames(&self) -> bool {
        matches!(self.state, BringUpState::Proving | BringUpState::LeftAlone)
    }

    /// Whether commands are still to be sent, so that silence and re-tares are expected.
    pub const fn is_busy(&self) -> bool {
        matches!(self.state, BringUpState::Configuring)
    }

    /// Whether the boards are expected to send.
    pub const fn is_done(&self) -> bool {
        !matches!(self.state, BringUpState::Configuring | BringUpState::Proving)
    }

    /// The bring-up of one board in words; `modules` are the positions and names of its modules.
    pub fn in_words(&self, modules: impl Iterator<Item = (usize, String)>) -> String {
        match &self.state {
            BringUpState::Listening | BringUpState::LeftAlone => "listening".to_owned(),
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

/// All commands, each board's own in their order.
fn steps<'a>(
    now: Time,
    patch: &'a Patch,
    setups: &'a [BoardSetup],
    devices: &'a [DevicePlan],
) -> impl Iterator<Item = Step> + 'a {
    let (configured, tared) = (now + AFTER_BOARD_CONFIG, now + AFTER_BOARD_CONFIG + AFTER_TRIANGLES);
    let of_board = move |(board, (at, setup)): (usize, (&Board, &'a BoardSetup))| {
        let (address, step) = (at.address, move |due, frame| Step { due, board, frame });
        let first = [Command::QueryFirmware { protocol: PROTOCOL }, Command::SetBoardConfig(setup.board)];
        let triangles = setup.triangles.iter().enumerate().map(move |(n, triangles)| {
            step(if n == 0 { configured } else { tared }, Command::SetTriangles(*triangles).encode(address))
        });
        let first = first.into_iter().map(move |command| step(now, command.encode(address)));
        first.chain(triangles).chain([step(tared + BEFORE_START, Command::Start.encode(address))])
    };
    let of_device = move |(board, device): (usize, &'a DevicePlan)| {
        device.commands.iter().map(move |&(after, frame)| Step { due: now + after, board, frame })
    };
    let boards = patch.boards().iter().zip(setups).enumerate().flat_map(of_board);
    boards.chain(devices.iter().enumerate().filter(|(_, device)| device.is_configured()).flat_map(of_device))
}

/// All commands with the positions of their boards.
pub fn commands<'a>(
    patch: &'a Patch,
    setups: &'a [BoardSetup],
    devices: &'a [DevicePlan],
) -> impl Iterator<Item = (usize, Frame)> + 'a {
    steps(Time::default(), patch, setups, devices).map(|step| (step.board, step.frame))
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::{Module, ModuleKind};

    fn patch() -> Patch {
        let board = |address| crate::tests::board(0, address, &[ModuleKind::Triangle; 2]);
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
        bring_up.start(ms(0), &patch(), &[setup(), setup()], &[], &[true; 2]);
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
        assert_eq!(bring_up.state, BringUpState::Proving);
    }

    #[test]
    fn the_waits_are_kept_however_late_somebody_asks() {
        let mut bring_up = BringUp::new(4);
        bring_up.start(ms(0), &patch(), &[setup(), setup()], &[], &[true; 2]);
        let mut stages = Vec::new();
        for t in (100..2_000).step_by(30) {
            let sent = std::iter::from_fn(|| bring_up.next_due(ms(t))).count();
            stages.extend((sent > 0).then_some((t, sent)));
        }
        assert_eq!(stages, [(100, 4), (130, 2), (640, 2), (670, 2)]);
    }

    #[test]
    fn a_board_that_is_not_wanted_gets_no_command_and_has_to_be_heard_all_the_same() {
        let mut bring_up = BringUp::new(4);
        bring_up.start(ms(0), &patch(), &[setup(), setup()], &[], &[false, true]);
        let sent: Vec<usize> = (0..=530).flat_map(|t| bring_up.next_due(ms(t))).map(|(board, _)| board).collect();
        assert!(sent.iter().all(|board| *board == 1) && bring_up.state == BringUpState::Proving, "{sent:?}");
        bring_up.start(ms(1_000), &patch(), &[setup(), setup()], &[], &[false; 2]);
        assert_eq!((bring_up.next_due(ms(9_999)), bring_up.is_done()), (None, true));
        (0..3).for_each(|module| bring_up.heard(module));
        bring_up.tick(ms(3_001));
        assert_eq!(bring_up.state, BringUpState::Incomplete(vec![3]));
    }
}
