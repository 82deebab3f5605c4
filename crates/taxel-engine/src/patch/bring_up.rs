//! When the boards of a patch are configured: those that stream as this daemon configured them last are left alone, because a
//! configuration takes their zero anew.

use taxel_skin::Time;

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::force::reason::ReasonCode;
use crate::now::Now;
use crate::patch::owner::{BEING_CONFIGURED, Patch};

/// Why zeros need confirmation of boards that were configured while nothing could show what lay on them.
const CONFIGURED_UNCHECKED: &str =
    "the boards were configured while there was no force to show a load: one that lay there then reads as 0 N";

impl Patch {
    /// Begins to listen.
    pub fn start(&mut self, now: Now) {
        self.started = now.time;
        self.with_zero(now, |zero, events| {
            zero.lose(ReasonCode::ZeroNotTaken, "no zero has been taken since start", events)
        });
        self.has_begun = !self.plan.configures() && self.noted.zero.is_none(); // there is nothing to listen for
    }

    /// Whether nothing is left to be listened for at the start: every module streams, or the boards were configured already.
    pub fn is_heard(&self) -> bool {
        self.has_begun || self.intake.scan().whole
    }

    /// Whether each board has to be configured at the start: it is silent, or this daemon configured it otherwise last.
    pub fn boards_to_configure(&self, now: Time) -> Vec<bool> {
        let differs = self.noted.configured != Some(self.settings);
        let may = |board| !self.has_begun && self.plan.configures_board(board);
        let wanted = |(board, streams): (usize, bool)| may(board) && (differs || !streams);
        self.intake.streams(now).into_iter().enumerate().map(wanted).collect()
    }

    /// It has been listened whether the boards stream. Those that are `wanted` are configured; if none is, the patch goes on with
    /// the zero of before the start.
    pub fn begin(&mut self, now: Now, wanted: &[bool]) {
        if wanted.contains(&true) {
            return self.configure(now, wanted, false);
        }
        if std::mem::replace(&mut self.has_begun, true) {
            return;
        }
        self.intake.start_bring_up(now.time, wanted);
        if let Some(kept) = self.noted.zero.clone().filter(|_| self.noted.configured == Some(self.settings)) {
            self.with_zero(now, |zero, events| zero.go_on(kept, events));
        }
    }

    /// Configures the boards that are `wanted`: the zero is lost. Boards that stream may have borne a load, which only a force
    /// would have shown, unless it is `confirmed` that nothing touches the skin. Until then zeros need confirmation.
    pub fn configure(&mut self, now: Now, wanted: &[bool], confirmed: bool) {
        let streams = self.intake.streams(now.time);
        let streaming = streams.iter().zip(wanted).any(|(streams, wanted)| *streams && *wanted);
        let shows_loads = self.force.is_ready() && self.felt.is_some();
        let unchecked = streaming && !confirmed && !shows_loads;
        self.with_zero(now, |zero, events| zero.lose(ReasonCode::BoardsNotConfigured, BEING_CONFIGURED, events));
        self.zero.explain(ReasonCode::BoardsNotConfigured, BEING_CONFIGURED.to_owned());
        self.zero.on_bring_up(confirmed, unchecked.then_some(CONFIGURED_UNCHECKED));
        self.intake.start_bring_up(now.time, wanted);
        (self.has_begun, self.dirty) = (true, true);
    }

    /// What is known of zeros outlives the daemon, as those of the boards do.
    pub fn note_zero(&mut self) {
        if !self.has_begun || self.zero.is_being_written() {
            return; // the zero of before the start may be valid yet, or the next one is going to disk
        }
        if let Some(zero) = self.zero.news(self.settings, &self.noted) {
            self.noted = zero.clone();
            let patch = self.name().to_owned();
            self.out.push(Output::Record(Record::Zero { patch, zero }));
        }
    }
}
