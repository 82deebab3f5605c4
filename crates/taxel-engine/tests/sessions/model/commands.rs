//! The table of commands: which are done, in which states, and what follows.

use taxel_engine::calibration::SessionState as S;

use super::state::{Model, Pending};
use super::step::{Answer, Disk, Set, Step};

impl Model {
    /// Gives a command.
    pub(super) fn command(&mut self, step: Step) -> Answer {
        let request = self.requests;
        if self.disk == Disk::Failed && step != Step::BringUp {
            return Answer::Refused;
        }
        match step {
            Step::StartRamp(number) | Step::FinishRamp(number) | Step::Abort(number)
                if self.is_changing() && !self.gathers(number) =>
            {
                Answer::Refused
            }
            Step::Discard(_) | Step::Activate(_) | Step::Import(_) if self.is_changing() => Answer::Refused,
            Step::StartSession => {
                if self.open().is_some() || self.presses() || self.gauge_gone() {
                    return Answer::Refused;
                }
                let number = self.next_session;
                self.next_session += 1;
                self.held = Some(number);
                self.want_zero(number);
                Answer::Done
            }
            Step::StartRamp(number) => {
                let can = matches!(self.state(number), Some(S::Review | S::Interrupted | S::Failed | S::Aborted));
                if !can || self.presses() || self.gauge_gone() || !self.take_up(number) {
                    return Answer::Refused;
                }
                self.want_zero(number);
                Answer::Done
            }
            Step::FinishRamp(number) => {
                let can = matches!(self.state(number), Some(S::Ramping | S::Interrupted | S::Failed));
                if !can || !self.take_up(number) {
                    return Answer::Refused;
                }
                self.fit(number);
                Answer::Done
            }
            Step::Abort(number) => self.abort(request, number),
            Step::Discard(number) => self.discard(request, number),
            Step::Activate(set) => self.activate(request, set),
            Step::Import(set) => {
                self.recorded.known.insert(set);
                self.pending.push(Pending::Import { request, set });
                Answer::Later
            }
            Step::Tare { confirmed } => {
                if self.open().is_some() || !self.boards_ready {
                    return Answer::Refused;
                }
                self.end_tare();
                self.tare = Some((request, confirmed));
                Answer::Later
            }
            _ => {
                if self.open().is_some() || self.presses() {
                    return Answer::Refused;
                }
                self.lose_zero();
                (self.boards_ready, self.whole) = (false, false);
                (self.unseen, self.unjudged) = (false, None); // it is confirmed
                Answer::Done
            }
        }
    }

    fn activate(&mut self, request: u64, set: Set) -> Answer {
        let discarded = self.owner(set).is_some_and(|number| self.state(number) == Some(S::Discarded));
        if !self.live.known.contains(&set) || discarded {
            return Answer::Refused;
        }
        self.recorded.active = Some(set);
        self.pending.push(Pending::Activate { request, set });
        Answer::Later
    }

    fn abort(&mut self, request: u64, number: u64) -> Answer {
        if !self.gathers(number) && self.state(number) != Some(S::Interrupted) {
            return Answer::Refused;
        }
        // What the patch holds ends at once.
        if self.held == Some(number) {
            self.enter(number, S::Aborted);
            return Answer::Done;
        }
        self.end(request, number, S::Aborted)
    }

    fn discard(&mut self, request: u64, number: u64) -> Answer {
        let Some((state, set)) = self.live.sessions.get(&number).copied() else { return Answer::Refused };
        let can = matches!(state, S::Review | S::Discarded | S::Aborted | S::Failed | S::Interrupted);
        if !can || (set.is_some() && self.live.active == set) {
            return Answer::Refused;
        }
        self.end(request, number, S::Discarded)
    }

    /// A session that gathers nothing ends once that is on disk.
    fn end(&mut self, request: u64, number: u64, state: S) -> Answer {
        let Some((_, set)) = self.live.sessions.get(&number).copied() else { return Answer::Refused };
        self.recorded.sessions.insert(number, (state, set));
        self.pending.push(Pending::End { request, number, state });
        Answer::Later
    }

    /// Whether a session can go on; it holds the patch then. Its samples are in memory or on disk.
    fn take_up(&mut self, number: u64) -> bool {
        let can = self.held == Some(number) || self.open().is_none();
        if can {
            self.held = Some(number);
        }
        can
    }

    fn want_zero(&mut self, number: u64) {
        self.end_tare();
        self.enter(number, S::Taring);
        self.idle_s = (0.0, 0.0);
    }
}
