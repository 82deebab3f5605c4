//! How a patch takes its zero and loses it.

use std::time::Duration;
use taxel_model::{Sign, TaxelModel};
use taxel_skin::{TaxelSite, Time};

use crate::bring_up::BringUpState::Incomplete;
use crate::command::{Done, Rejection, RequestId};
use crate::drift::Drift;
use crate::faults::FaultDetector;
use crate::io::{Now, Output};
use crate::live::{Live, ScanEnd};
use crate::model_set::ModelSet;
use crate::patch::PatchEngine;
use crate::record::Record;
use crate::rest::{RestStatistics, RestVerdict, TaxelBaseline, first_baseline, judge, judge_first, lift};
use crate::tare::{Purpose, Watched};

/// The lift test looks at windows of this length.
const LIFT_WINDOW: Duration = Duration::from_secs(2);

impl PatchEngine {
    /// Something may have moved the zero: live force is invalid until rest is proven again.
    pub(crate) fn lose_zero(&mut self, reason: impl Into<String>) {
        self.tare.lose(reason);
        if self.tare.watching() == Some(&Purpose::AtStart) {
            self.tare.stop_watching(); // it has seen what was before; the next scan begins another
        }
        if let Some(drift) = &mut self.drift {
            drift.end();
        }
        self.rebuild_tables();
    }

    /// An operator asks for a zero.
    pub(crate) fn start_tare(
        &mut self,
        now: Now,
        request: RequestId,
        confirmed_by: Option<String>,
        out: &mut Vec<Output>,
    ) {
        if let Some(session) = self.session.as_ref().filter(|s| s.view().state.is_open()) {
            let (number, state) = (session.view().number, session.view().state.name());
            let why = format!("session {number} is {state} and takes the zero itself; abort it first");
            out.push(Output::Reply(request, Err(Rejection::FailedPrecondition(why))));
            return;
        }
        self.watch(now, Purpose::Operator { request, confirmed_by }, out);
    }

    pub(crate) fn watch(&mut self, now: Now, purpose: Purpose, out: &mut Vec<Output>) {
        let statistics = self.rest_statistics();
        if let Some(Purpose::Operator { request, .. }) = self.tare.watch(now.time, statistics, purpose) {
            let why = "another tare began before this one had seen enough".to_owned();
            out.push(Output::Reply(request, Err(Rejection::FailedPrecondition(why))));
        }
    }

    /// Whole scans are what rest is judged by.
    pub(crate) fn watch_rest(&mut self, now: Now, end: ScanEnd, out: &mut Vec<Output>) {
        let by_itself = self.plan.tare.at_start && !self.tare.ever_taken() && self.model_set.is_some();
        if by_itself && self.tare.watching().is_none() && self.is_set_up() {
            self.watch(now, Purpose::AtStart, out);
        }
        // A session needs every module. A live zero does without the silent ones: they have none, and no force.
        let partial = matches!(self.tare.watching(), Some(Purpose::AtStart | Purpose::Operator { .. }));
        if self.tare.watching().is_none() || !(end.whole || partial) {
            return;
        }
        self.tare.push(end.whole, sound_counts(&self.faults, &self.live, self.plan.patch.taxels()));
        let (duration, scans_min) = (self.plan.tare.duration, self.plan.tare.rest.scans_min);
        if let Some(watched) = self.tare.full_look(now.time, duration, scans_min) {
            self.conclude(now, watched, out);
        } else if end.whole {
            self.look_first(now);
        }
    }

    /// At start a few scans may do for a zero that is marked; the watch goes on and decides.
    fn look_first(&mut self, now: Now) {
        // Of boards that did not all answer after a bring-up nothing is taken for granted.
        let Some(set) = self.model_set.as_ref().filter(|_| !matches!(self.bring_up.state(), Incomplete(_))) else {
            return;
        };
        let Some(seen) = self.tare.first_look(now.time, self.plan.tare.first_scans) else { return };
        let full_scans = self.plan.tare.duration.as_secs_f64() / self.plan.period.as_secs_f64();
        let verdict = judge_first(seen, &set.baseline, &signs(set), &self.plan.tare.rest, full_scans);
        if !matches!(verdict, RestVerdict::Rest { .. }) {
            self.tare.explain(format!("rest is not proven yet: {verdict}"));
            return;
        }
        let (baseline, scans) = (first_baseline(seen, &set.baseline), seen.count());
        self.tare.accept_provisionally(now.wall_ns, baseline, &verdict, scans);
        self.begin_drift(now);
        self.rebuild_tables();
    }

    /// The counts at rest now: the zero as it was taken, with the drift since.
    pub(crate) fn zero_now(&self) -> Option<Vec<TaxelBaseline>> {
        let zero = self.tare.baseline()?;
        Some(self.drift.as_ref().map_or_else(|| zero.to_vec(), |drift| drift.applied_to(zero)))
    }

    /// Standard uncertainty, in counts, of what was added to the zero because of drift; 0 where it is not followed.
    #[must_use]
    pub fn drift_sigma_counts(&self) -> f64 {
        self.drift.as_ref().filter(|_| self.tare.view().valid).map_or(0.0, |drift| drift.view().sigma_counts)
    }

    /// What keeps a force at this zero from being a good one.
    pub(crate) fn zero_shortcomings(&self) -> impl Iterator<Item = String> {
        let provisional = self.tare.view().provisional_scans;
        let provisional = provisional.map(|scans| format!("the zero rests on {scans} scans so far"));
        provisional.into_iter().chain(self.drift.as_ref().and_then(Drift::shortcoming))
    }

    /// The zero follows the temperature, where that is asked for and no session holds the patch.
    pub(crate) fn follow_drift(&mut self, now: Now, end: ScanEnd) {
        let Some(drift) = &mut self.drift else { return };
        let (faults, modules) = (&self.faults, self.live.modules());
        let moved = if self.session.as_ref().is_some_and(|s| s.view().state.is_open()) {
            drift.hold(now);
            false
        } else {
            let pads = |module: usize| (!modules[module].stale).then_some(modules[module].thermal);
            let sound = |taxel: usize| faults.faults(taxel).is_empty();
            drift.on_scan(Now { time: end.time, ..now }, self.live.counts(), pads, sound)
        };
        self.tare.set_drift(*drift.view());
        if moved {
            self.move_tables();
        }
    }

    /// A zero was taken: drift begins anew.
    fn begin_drift(&mut self, now: Now) {
        if let (Some(drift), Some(zero)) = (&mut self.drift, self.tare.baseline()) {
            drift.begin(now, zero);
            self.tare.set_drift(*drift.view());
        }
    }

    /// A skin that becomes lighter than its zero was not at rest when that was taken.
    pub(crate) fn watch_lift(&mut self) {
        let Some(set) = self.model_set.as_deref().filter(|_| self.tare.view().valid) else { return };
        self.lift_watch.push(sound_counts(&self.faults, &self.live, self.plan.patch.taxels()));
        let scans = LIFT_WINDOW.as_secs_f64() / self.plan.period.as_secs_f64();
        if self.lift_watch.count() as f64 >= scans {
            let zero = self.zero_now().unwrap_or_default();
            self.lift = lift(&zero, &self.lift_watch, &signs(set), &self.plan.tare.rest);
            self.lift_watch = self.rest_statistics();
        }
    }

    /// Empty statistics that know the modules.
    pub(crate) fn rest_statistics(&self) -> RestStatistics {
        RestStatistics::new(self.plan.patch.taxels().len()).in_modules(self.modules.iter().cloned())
    }

    pub(crate) fn tick_rest(&mut self, now: Now, out: &mut Vec<Output>) {
        if let Some(watched) = self.tare.tick(now.time, self.plan.tare.duration) {
            self.conclude(now, watched, out);
        }
    }

    /// The watch is over: rest is proven, vouched for, or refused.
    fn conclude(&mut self, now: Now, watched: Watched, out: &mut Vec<Output>) {
        let Some(statistics) = watched.statistics else {
            let why = format!("no rest could be watched: {}", self.silence(now.time));
            self.refuse_zero(now, watched.purpose, why, out);
            return;
        };
        let set = self.model_set.as_deref();
        let reference = set.map(|set| set.baseline.as_slice());
        let signs = set.map(signs).unwrap_or_default();
        let verdict = judge(&statistics, reference, &signs, &self.plan.tare.rest);
        // In its first session a skin has nothing to be compared with: its zero is what the models refer to, and the
        // gauge shows that the bag does not press.
        let first = matches!((&verdict, &watched.purpose), (RestVerdict::Unproven { .. }, Purpose::Session { .. }));
        let rest = first || matches!(verdict, RestVerdict::Rest { .. });
        let enough = !matches!(verdict, RestVerdict::NotEnough { .. });
        let vouched = watched.purpose.confirmed_by().map(str::to_owned);
        if rest || (enough && vouched.is_some()) {
            self.take_zero(now, watched.purpose, statistics.baseline(), &verdict, vouched.as_deref(), out);
        } else {
            self.refuse_zero(now, watched.purpose, verdict.to_string(), out);
        }
    }

    fn take_zero(
        &mut self,
        now: Now,
        purpose: Purpose,
        baseline: Vec<TaxelBaseline>,
        verdict: &RestVerdict,
        vouched: Option<&str>,
        out: &mut Vec<Output>,
    ) {
        self.tare.accept(now.wall_ns, baseline.clone(), verdict, vouched);
        self.faults.expect_noise(baseline.iter().map(|taxel| taxel.noise));
        self.begin_drift(now);
        self.rebuild_tables();
        let (patch, tare) = (self.plan.patch.name().to_owned(), self.tare.view().clone());
        out.push(Output::Record(Record::Tared { patch, tare: tare.clone(), baseline: baseline.clone() }));
        match purpose {
            Purpose::AtStart => {}
            Purpose::Operator { request, .. } => out.push(Output::Reply(request, Ok(Done::Tared(tare)))),
            Purpose::Session { .. } => self.session_zeroed(now, baseline, out),
        }
    }

    fn refuse_zero(&mut self, now: Now, purpose: Purpose, why: String, out: &mut Vec<Output>) {
        match purpose {
            Purpose::AtStart => {
                let why = format!("rest is not proven: {why}");
                if self.tare.view().provisional_scans.is_some() {
                    self.lose_zero(why);
                } else {
                    self.tare.explain(why);
                }
            }
            Purpose::Operator { request, .. } => {
                let hint = "if nothing touches the skin, say so with confirmed_by";
                let why = format!("rest is not proven: {why}; {hint}");
                out.push(Output::Reply(request, Err(Rejection::FailedPrecondition(why))));
            }
            Purpose::Session { confirmed_by } => self.session_restless(now, why, confirmed_by, out),
        }
        self.dirty = true;
    }

    /// Which modules keep a scan from being whole, in words.
    pub(crate) fn silence(&self, now: Time) -> String {
        let silent: Vec<String> = self
            .live
            .modules()
            .iter()
            .zip(self.plan.patch.modules())
            .filter(|(live, _)| live.stale)
            .map(|(live, site)| {
                let address = self.plan.patch.boards()[site.board as usize].address;
                let since = live.last.map_or_else(
                    || "never heard".to_owned(),
                    |last| format!("silent for {:.1} s", now.since(last).as_secs_f64()),
                );
                format!("board {address} module {} ({since})", site.module)
            })
            .collect();
        match silent.len() {
            0 => "too few whole scans came in time".to_owned(),
            n @ 1..=4 => format!("{n} modules are silent: {}", silent.join(", ")),
            n => format!("{n} modules are silent: {} and {} more", silent[..3].join(", "), n - 3),
        }
    }
}

/// The counts of one scan, without those of silent or faulty taxels.
fn sound_counts<'a>(
    faults: &'a FaultDetector,
    live: &'a Live,
    sites: &'a [TaxelSite],
) -> impl Iterator<Item = Option<f64>> + 'a {
    live.counts().iter().zip(sites).enumerate().map(|(taxel, (&count, site))| {
        let sound = faults.faults(taxel).is_empty() && !live.modules()[site.module as usize].stale;
        sound.then_some(f64::from(count))
    })
}

/// Which way pressure moves the count of each taxel.
fn signs(set: &ModelSet) -> Vec<i8> {
    set.taxels.iter().map(sign_of).collect()
}

/// Which way pressure moves the count, 0 where no model says.
fn sign_of(model: &TaxelModel) -> i8 {
    match (model.is_usable(), model.sign) {
        (false, _) => 0,
        (true, Sign::Rising) => 1,
        (true, Sign::Falling) => -1,
    }
}
