//! The state of buses and boards, as an operator has to know it.

use taxel_skin::Time;
use taxel_wire::Frame;

use crate::bring_up::BringUpState;
use crate::io::BusNotice;
use crate::patch::PatchEngine;
use crate::snapshot::{BoardHealth, BusHealth};

/// One bus, live.
#[derive(Clone, Debug, Default)]
pub struct BusLive {
    /// Whether frames can come.
    pub up: bool,
    /// Frames that were understood.
    pub frames: u64,
    /// Frames of no concern.
    pub foreign: u64,
    malformed: u64,
    last_malformed: String,
    dropped: u64,
    problem: String,
}

impl BusLive {
    /// Counts a frame of ours whose content is not.
    pub fn refuse(&mut self, frame: &Frame, why: String) {
        self.malformed += 1;
        self.last_malformed = format!("{}: {why}", frame.id);
    }

    /// Takes a notice; returns why the boards' zero is in doubt, if it is.
    pub fn on_notice(&mut self, notice: BusNotice) -> Option<String> {
        match notice {
            BusNotice::Up => {
                self.up = true;
                self.problem.clear();
            }
            BusNotice::Down(why) => {
                self.up = false;
                self.problem = why;
            }
            BusNotice::Dropped(frames) => self.dropped += frames,
            BusNotice::ControllerError(what) => self.problem = what,
            BusNotice::BusOff => {
                self.up = false;
                self.problem = "bus-off: the controller left the bus".to_owned();
                return Some("the controller went bus-off; boards may have lost their zero unseen".to_owned());
            }
        }
        None
    }

    /// What the world sees.
    #[must_use]
    pub fn view(&self) -> BusHealth {
        BusHealth {
            up: self.up,
            problem: self.problem.clone(),
            frames: self.frames,
            foreign: self.foreign,
            malformed: self.malformed,
            last_malformed: self.last_malformed.clone(),
            dropped: self.dropped,
        }
    }
}

impl PatchEngine {
    /// One entry per board.
    pub(crate) fn board_health(&self, _now: Time) -> Vec<BoardHealth> {
        let boards = self.plan.patch.boards().iter().zip(&self.boards).enumerate();
        let view = |(position, (board, live)): (usize, (&taxel_skin::Board, &crate::boards::BoardLive))| {
            let modules = || {
                let sites = self.plan.patch.modules().iter().zip(self.live.modules());
                sites.filter(move |(site, _)| site.board as usize == position).map(|(_, module)| module)
            };
            let orphans = |m: &crate::live::ModuleLive| m.pairer.orphans().heads + m.pairer.orphans().tails;
            BoardHealth {
                patch: self.plan.patch.name().to_owned(),
                bus: board.bus.0,
                address: board.address.get(),
                bring_up: self.bring_up_in_words(position),
                modules: (modules().count() as u32, modules().filter(|m| !m.stale).count() as u32),
                scans: modules().map(|m| m.scans).sum(),
                orphans: modules().map(orphans).sum(),
                status_errors: live.status_errors(),
                celsius: live.celsius(),
                firmware: live.firmware(),
                warnings: live.warnings(),
            }
        };
        boards.map(view).collect()
    }

    fn bring_up_in_words(&self, board: usize) -> String {
        match self.bring_up.state() {
            BringUpState::Listening => "listening".to_owned(),
            BringUpState::Configuring | BringUpState::Proving => "configuring".to_owned(),
            BringUpState::Verified => "verified".to_owned(),
            BringUpState::Incomplete(silent) => {
                let sites = self.plan.patch.modules();
                let mine = silent.iter().map(|&m| sites[m]).filter(|site| site.board as usize == board);
                let modules: Vec<String> = mine.map(|site| site.module.to_string()).collect();
                if modules.is_empty() {
                    "verified".to_owned()
                } else {
                    format!("incomplete: no frame from modules {}", modules.join(", "))
                }
            }
        }
    }
}
