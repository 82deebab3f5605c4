//! What the engine has to do, as a table of its own: states of a session and of the daemon against everything that can
//! happen. Nothing in here is taken from the engine but the names of the states.

mod commands;
mod disk;
pub mod state;
pub mod step;
mod time;

pub use state::{Facts, Model};
pub use step::{Answer, Disk, Passing, Set, Step};

impl Model {
    /// What comes of a step.
    pub fn apply(&mut self, step: Step) {
        self.grew = false;
        self.answer = step.is_command().then(|| {
            self.requests += 1;
            self.command(step)
        });
        if self.answer == Some(Answer::Later) {
            self.waiting.insert(self.requests);
        }
        match step {
            Step::Pass(how) => self.pass(how),
            Step::BusOff => self.lose_zero(),
            Step::FitEnds { fit, well } => self.fit_ends(fit, well),
            Step::DiskSlow => self.disk = Disk::Slow,
            Step::DiskWrites => self.write(),
            Step::DiskFast => {
                self.write();
                self.disk = Disk::Fast;
            }
            Step::DiskFails => self.disk_fails(),
            Step::Restart => self.restart(),
            _ => {}
        }
        if self.disk == Disk::Fast {
            while !self.pending.is_empty() {
                self.write();
            }
            self.on_disk = self.recorded.clone();
        }
    }
}
