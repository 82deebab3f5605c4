//! The table of fits and disks: what takes effect once it is written, and what a restart finds.

use taxel_engine::calibration::SessionState as S;

use super::state::{Model, Pending, Since};
use super::step::{Disk, Set};

impl Model {
    pub(super) fn fit_ends(&mut self, fit: usize, well: bool) {
        self.fits[fit].out = false;
        if !self.awaits(fit) {
            return;
        }
        if well {
            self.recorded.known.insert(Set::Fit(fit));
            self.pending.push(Pending::Fitted { fit });
        } else {
            self.enter(self.fits[fit].session, S::Failed);
        }
    }

    /// All that was recorded so far is on disk, and what waited for that takes effect.
    pub(super) fn write(&mut self) {
        self.on_disk = self.recorded.clone();
        let mut other_models = false;
        for pending in std::mem::take(&mut self.pending) {
            match pending {
                Pending::Activate { request, set } => {
                    other_models = true;
                    self.settle(request, true);
                    self.put_to_use(set);
                }
                Pending::Import { request, set } => {
                    self.settle(request, true);
                    self.live.known.insert(set);
                }
                // A zero that was judged by the models of before is none.
                Pending::Zero { request, good, confirmed } => {
                    let good = good && !other_models;
                    self.unseen &= !good;
                    self.unjudged.take_if(|since| good && (confirmed || *since == Since::Others));
                    self.settle(request, good);
                }
                Pending::End { request, number, state } => {
                    self.settle(request, true);
                    self.enter(number, state);
                }
                Pending::Fitted { fit } => {
                    self.live.known.insert(Set::Fit(fit));
                    if self.awaits(fit) {
                        let session = self.fits[fit].session;
                        self.live.sessions.insert(session, (S::Review, Some(Set::Fit(fit))));
                        self.enter(session, S::Review);
                    }
                }
            }
        }
    }

    fn put_to_use(&mut self, set: Set) {
        self.live.active = Some(set);
        let is_own = |fit: usize| self.fits[fit].rest.is_some_and(|rest| self.begun.contains(&rest));
        let own = matches!(set, Set::Fit(fit) if is_own(fit));
        if let Some(since) = self.unjudged.replace(if own { Since::Own } else { Since::Others }) {
            self.just_trusted |= own && since == Since::Others;
            self.unseen = !own || (self.unseen && since != Since::Others);
        } else {
            self.unjudged = None;
        }
    }

    /// A caller that waits for the disk is refused, and no session can go on.
    pub(super) fn disk_fails(&mut self) {
        self.disk = Disk::Failed;
        for pending in std::mem::take(&mut self.pending) {
            if let Pending::Activate { request, .. }
            | Pending::Import { request, .. }
            | Pending::Zero { request, .. }
            | Pending::End { request, .. } = pending
            {
                self.settle(request, false);
            }
        }
        if let Some((number, _)) = self.open() {
            self.enter(number, S::Failed);
        }
    }

    /// Only what is on disk is left. Of it, what was open is interrupted, and no zero.
    pub(super) fn restart(&mut self) {
        let mut live = self.on_disk.clone();
        let newest = live.sessions.keys().next_back().copied();
        for (state, _) in live.sessions.values_mut() {
            if matches!(state, S::Taring | S::Ramping | S::Fitting) {
                *state = S::Interrupted;
            }
        }
        self.recorded = self.on_disk.clone();
        self.next_session = newest.unwrap_or(0) + 1;
        self.live = live;
        self.fits.iter_mut().for_each(|fit| fit.out = false);
        (self.held, self.tare, self.disk) = (None, None, Disk::Fast);
        self.pending.clear();
        self.waiting.clear();
        self.settled.clear();
        // The boards stream as they were configured, and the store of these tests keeps no suspicions.
        (self.gauge_fresh, self.boards_ready, self.heard, self.unseen) = (false, false, false, false);
        (self.unjudged, self.whole, self.falsely_confirmed) = (None, false, false);
        self.begun.clear();
    }
}
