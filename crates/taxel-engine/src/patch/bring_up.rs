//! When the boards of a patch are configured: at once where nothing can press on them, else after a look at the skin, and
//! together with the patches that share one of them, because a board that is configured forgets the modules of all.

use std::time::Duration;
use taxel_skin::Time;

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::force::reason::ReasonCode;
use crate::now::Now;
use crate::patch::owner::{BEING_CONFIGURED, Effects, Intent, Patch, Ready, VOUCH_LASTS};
use crate::zero::watch::Purpose;

/// Boards that were not heard for so long after the start do not stream: three of the longest periods.
const SILENT_BOARDS_AFTER: Duration = Duration::from_millis(300);

/// What is held against the zeros of boards that were configured while nothing could show what lay on them.
const CONFIGURED_UNSEEN: &str =
    "the boards were configured while no model set was active: what lay on them then reads as nothing";

impl Patch {
    /// Starts the boards and waits for rest.
    pub fn start(&mut self, now: Now, effects: &mut Effects<'_>) {
        self.started = now.time;
        let mut events = Vec::new();
        self.zero.lose(ReasonCode::ZeroNotTaken, "no zero has been taken since start", &mut events);
        self.on_zero_events(now, events, effects);
        // Boards that stream already show whether something lies on them, if there are models.
        self.bring_up_waits = self.plan.configures();
        self.without_look = self.force.models().is_none();
        if self.bring_up_waits {
            self.silent_until = now.time + SILENT_BOARDS_AFTER;
        } else {
            self.on_boards_ready(now.time, Ready::Unseen, effects);
        }
    }

    /// Boards that do not stream are configured at once; the others are looked at first, and for as long as those of other
    /// patches are not ready: a load may come meanwhile.
    pub(super) fn begin_bring_up(&mut self, now: Now, effects: &mut Effects<'_>) {
        if !self.bring_up_waits {
            return;
        }
        self.ready.take_if(|(ready, said)| *ready == Ready::Vouched && now.time >= *said + VOUCH_LASTS);
        let watching = self.zero.watching().is_some();
        if self.without_look && (watching || !self.shows_loads()) {
            return self.configure_unseen(now, effects); // whoever watches for a zero waits until that is done
        }
        if watching || matches!(self.ready, Some((Ready::Vouched, _))) {
            return;
        }
        if self.shows_loads() || (self.ready.is_none() && self.intake.newest().is_some()) {
            self.look_before_bring_up(now, effects);
        } else if self.ready.is_none() && now.time >= self.silent_until {
            self.on_boards_ready(now.time, Ready::Unseen, effects);
        }
    }

    /// Without models there is nothing to be seen but whether they stream.
    fn configure_unseen(&mut self, now: Now, effects: &mut Effects<'_>) {
        let heard = self.intake.newest().is_some() || now.time >= self.silent_until;
        if self.ready.is_none() && heard {
            self.on_boards_ready(now.time, Ready::Unseen, effects);
        }
    }

    /// Whether its counts show what presses on it.
    pub(super) fn shows_loads(&self) -> bool {
        self.force.models().is_some() && self.intake.silent_taxels() < self.taxels()
    }

    /// The boards may be configured: now, or once that holds of all patches that share one of them.
    pub(super) fn on_boards_ready(&mut self, now: Time, ready: Ready, effects: &mut Effects<'_>) {
        self.ready = Some((ready, now));
        if self.shares_boards && self.plan.configures() {
            self.bring_up_waits = true;
            effects.intents.push(Intent::BoardsReady);
        } else {
            self.configure_boards(now);
        }
    }

    /// Whether the boards may be configured as far as this patch knows.
    #[must_use]
    pub fn is_ready_for_bring_up(&self) -> bool {
        let ready = match self.ready {
            Some((Ready::Seen | Ready::Vouched, _)) => true,
            Some((Ready::Unseen, _)) => !self.shows_loads(), // where they have begun to send it is looked first
            None => false,
        };
        !self.plan.configures() || ready
    }

    /// When the look ended that found nothing on the boards, if one did.
    #[must_use]
    pub fn looked(&self) -> Option<Time> {
        self.ready.filter(|(ready, _)| *ready == Ready::Seen && self.plan.configures()).map(|(_, ended)| ended)
    }

    /// How long a look takes at least and at the most, of boards that send: it ends with a scan.
    #[must_use]
    pub fn look_lasts(&self) -> [Duration; 2] {
        let scans = u32::try_from(self.plan.tare.rest.scans_min).unwrap_or(u32::MAX);
        let least = self.plan.tare.duration.max(self.plan.period.saturating_mul(scans));
        [least, least + self.plan.period]
    }

    /// It is asked for anew: what was seen before does not count any more. What somebody vouched for does, as long as it
    /// lasts, unless it is `of_this` patch.
    pub fn is_asked_anew(&mut self, of_this: bool) {
        self.ready.take_if(|(ready, _)| of_this || *ready != Ready::Vouched);
    }

    /// What a look found is too old: it is looked again, with the patches that share a board.
    pub fn look_again(&mut self) {
        self.ready.take_if(|(ready, _)| *ready == Ready::Seen);
        if matches!(self.zero.watching(), Some(Purpose::BeforeBringUp)) {
            self.zero.stop_watching();
        }
    }

    /// Configures the boards; nothing presses on them, or nothing can show it. Boards that stream may have borne a load then,
    /// as those of a robot do that is in use.
    pub fn configure_boards(&mut self, now: Time) {
        self.bring_up_waits = false;
        let without_look = std::mem::take(&mut self.without_look) || self.force.models().is_none();
        let ready = self.ready.take().map(|(ready, _)| ready);
        let unseen = without_look && matches!(ready, None | Some(Ready::Unseen));
        if matches!(self.zero.watching(), Some(Purpose::BeforeBringUp)) {
            self.zero.stop_watching(); // the look that went on while others were not ready
        }
        if self.plan.configures() {
            let models = self.force.models().map(|set| set.baseline.as_slice());
            let held = (unseen && self.intake.newest().is_some()).then_some(CONFIGURED_UNSEEN);
            self.zero.on_bring_up(models, ready == Some(Ready::Vouched), held);
        }
        self.intake.start_bring_up(now);
    }

    /// Configures the boards again: the zero is lost. Boards that stream are looked at first, since what is too light for a
    /// force may lie there, unless it is `confirmed` that nothing touches the skin. What is held against the zero holds until
    /// that is.
    pub fn bring_up_again(&mut self, now: Now, confirmed: bool, effects: &mut Effects<'_>) {
        let may_show = self.shows_loads() || now.time < self.silent_until; // just after the start it is still listened
        self.bring_up_waits = !confirmed && may_show;
        self.lose_zero(now, ReasonCode::BoardsNotConfigured, BEING_CONFIGURED, effects);
        if self.bring_up_waits {
            self.begin_bring_up(now, effects);
        } else {
            let before = self.ready.map_or(Ready::Unseen, |(ready, _)| ready); // it may have been vouched for
            self.on_boards_ready(now.time, if confirmed { Ready::Vouched } else { before }, effects);
        }
    }

    /// The boards were looked at before they are configured. Silent ones are configured, too; those that something
    /// presses on wait until it is gone, or until an operator asks for it.
    pub(super) fn on_looked(&mut self, now: Now, found: Result<Ready, String>, effects: &mut Effects<'_>) {
        if !self.bring_up_waits {
            return;
        }
        match found {
            Ok(ready) => {
                if self.ready.is_none() {
                    self.zero.explain(ReasonCode::BoardsNotConfigured, BEING_CONFIGURED.to_owned());
                    self.dirty = true;
                }
                self.on_boards_ready(now.time, ready, effects);
            }
            Err(why) => {
                self.ready = None;
                let hint = "if nothing touches the skin, ask for BringUp and say so with confirmed_by";
                let why = format!(
                    "the boards are not configured until a look at the skin finds nothing on it: {why}; {hint}"
                );
                self.zero.explain(ReasonCode::BoardsNotConfigured, why);
                self.look_before_bring_up(now, effects);
            }
        }
    }

    /// What is known of the zeros of the boards outlives the daemon, as these zeros do.
    pub fn note_board_zeros(&mut self, now: Now, out: &mut Vec<Output>) {
        if let Some(zeros) = self.zero.news_of_boards(&self.noted) {
            self.noted = zeros.clone();
            let patch = self.name().to_owned();
            out.push(Output::Record(Record::BoardZeros { patch, zeros, wall_ns: now.wall_ns }));
        }
    }

    /// Watches the skin before its boards are configured.
    pub(super) fn look_before_bring_up(&mut self, now: Now, effects: &mut Effects<'_>) {
        let mut events = Vec::new();
        self.zero.watch(now.time, Purpose::BeforeBringUp, &mut events);
        self.on_zero_events(now, events, effects);
    }
}
