//! What is asked of a patch: zeros, sessions, models and known loads.

use std::sync::Arc;
use std::time::Duration;

use taxel_skin::counted;

use crate::calibration::transition::{Trigger, commanded};
use crate::calibration::view::SessionView;
use crate::intake::gauge::GaugeAtRest;
use crate::loads::load::Validation;
use crate::loads::load::{KnownLoad, Load};
use crate::loads::owner::LoadRead;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::patch::owner::{BEING_CONFIGURED, Patch};
use crate::request::{ErrorReason, Rejection, RequestId};
use crate::zero::view::TareView;
use crate::zero::watch::Purpose;

/// A gauge that is heard four times a second, as a ramp needs it, has not been silent for so long.
const GAUGE_SILENT_AFTER: Duration = Duration::from_secs(2);

impl Patch {
    /// An operator asks for a zero; the answer comes later.
    ///
    /// # Errors
    /// [`Rejection`] while a session takes the zero itself, or while the boards are being configured.
    pub fn tare(&mut self, now: Now, request: RequestId, confirmed_by: Option<String>) -> Result<(), Rejection> {
        self.check_no_session("it takes the zero itself; abort it first")?;
        self.check_set_up()?;
        self.with_zero(now, |zero, events| zero.watch(now.time, Purpose::Operator { request, confirmed_by }, events));
        Ok(())
    }

    /// The zero that was proven for `request` is on disk, or why not. Returns the zero that holds now.
    ///
    /// # Errors
    /// [`Rejection`] if something moved the zero meanwhile.
    pub fn adopt_zero(&mut self, request: RequestId) -> Result<TareView, Rejection> {
        let lost = |why| ErrorReason::ZeroLost.because(format!("the zero was lost while it was written down: {why}"));
        let view = self.zero.adopt(request).map_err(lost)?;
        self.use_zero();
        self.dirty = true;
        Ok(view)
    }

    /// The zero that was proven for `request` could not be written down.
    pub fn reject_zero(&mut self, request: RequestId) {
        self.zero.reject(request);
    }

    /// Refuses what cannot be while a session holds the patch; `then` says what to do.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with the session and its state.
    pub fn check_no_session(&self, then: &str) -> Result<(), Rejection> {
        self.session().map_or(Ok(()), |session| session.check_closed(then))
    }

    /// Refuses what needs boards that send while they are being configured, which takes their zero anew.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`].
    pub fn check_set_up(&self) -> Result<(), Rejection> {
        let set_up = self.has_begun && self.intake.bring_up().is_done();
        ErrorReason::BoardsNotConfigured
            .unless(set_up, || format!("{BEING_CONFIGURED}: ask again when they are verified"))
    }

    /// Refuses to configure boards while a load is felt: they would take it for nothing, and nobody could tell later.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with the force.
    pub fn check_unloaded(&self) -> Result<(), Rejection> {
        let Some((total, taxels)) = self.felt.filter(|(_, taxels)| *taxels > 0) else { return Ok(()) };
        let (name, newton) = (self.name(), total.0);
        let why = format!(
            "{} of patch `{name}` read {newton:.2} N, and boards that are configured take what lies on \
             them for nothing: unload the skin first",
            counted(taxels, "taxel", "taxels")
        );
        Err(ErrorReason::SkinLoaded.because(why))
    }

    /// Refuses what needs an unloaded skin while the bag presses on it, or while the gauge reads what a vented bag cannot
    /// have: its pressure is above the air's or equal to it, so what is below is an offset of the gauge.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with the pressure and the limit.
    pub fn check_vented(&self, now: Now) -> Result<(), Rejection> {
        let limits = &self.plan.session;
        // A ramp's zero waits until the gauge is heard.
        let Some((time, pressure)) = self.intake.gauge().newest() else { return Ok(()) };
        let gauge = &self.plan.fit.gauge;
        let (kpa, limit) = (pressure.0, limits.vented_below.0);
        // Three standard deviations of what is stated of the gauge, beside the noise that sessions allow for.
        let stated = limits.noise_band.0 + 3.0 * gauge.offset_kpa.hypot(gauge.noise_kpa);
        // The weather is as far from the guess on either side.
        let (least, wrong) = match self.plan.takes_ambient() {
            true => (-limit, "set `gauge.ambient_kpa` to the air pressure of your place"),
            false => (-stated, "the gauge's scale or offset is wrong"),
        };
        if now.time.since(time) > limits.gauge_timeout || (least..=limit).contains(&kpa) {
            return Ok(());
        }
        Err(if kpa > limit {
            let why = format!(
                "the bag is at {kpa:.1} kPa and presses on the skin: vent it below {limit:.1} kPa first; if it is vented, {wrong}"
            );
            ErrorReason::BagPresses.because(why)
        } else {
            let why = format!(
                "the gauge reads {kpa:.2} kPa, and a vented bag has no less than {least:.2} kPa: set the gauge's zero, \
                 or state its uncertainty in `gauge.offset_uncertainty_kpa`"
            );
            ErrorReason::GaugeOffset.because(why)
        })
    }

    /// Refuses a ramp while the gauge is silent. Just after the start it is still listened for.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with when it was last heard.
    pub fn check_gauge_heard(&self, now: Now) -> Result<(), Rejection> {
        if self.plan.session.typed {
            return Ok(());
        }
        let gauge = self.intake.gauge();
        let listens = gauge.newest().is_none() && now.time.since(self.started) <= GAUGE_SILENT_AFTER;
        match gauge.silence(now.time, GAUGE_SILENT_AFTER).filter(|_| !listens) {
            None => Ok(()),
            Some(why) => Err(ErrorReason::NoPressureSensor
                .because(format!("the gauge is silent: {why}; `taxeld health` shows its readings as they come"))),
        }
    }

    /// Refuses the zero of a ramp while the gauge is not heard or moves: what it reads then is its own zero, which is taken off
    /// all pressures of the ramp.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with what it read, or when last.
    pub fn check_gauge_at_rest(&self, now: Now) -> Result<(), Rejection> {
        let gauge = self.intake.gauge();
        let (reason, why) = match gauge.at_rest(now.time, self.plan.session.gauge_rest()) {
            GaugeAtRest::Still { .. } => return Ok(()),
            _ if self.plan.session.typed => return Ok(()),
            GaugeAtRest::Moves(least, most) => (
                ErrorReason::GaugeOffset,
                format!(
                    "the gauge read {least:.2} to {most:.2} kPa within a second, and what it reads unloaded is taken off the \
                     pressures: wait until bag and gauge stand still; if it is the gauge's noise, raise \
                     `session.noise_band_kpa`"
                ),
            ),
            GaugeAtRest::NotHeard => (
                ErrorReason::NoPressureSensor,
                gauge.silence(now.time, self.plan.session.gauge_timeout).unwrap_or_else(|| {
                    "the gauge has been heard for less than a second, or not twice in each half of it".to_owned()
                }),
            ),
        };
        Err(reason.because(why))
    }

    /// What should be seen to before the pump runs, a line each. `left_out` are modules that a session does without.
    pub fn look(&self, now: Now, left_out: &[u16]) -> Vec<String> {
        let session = &self.plan.session;
        self.intake.look(now.time, (!session.typed).then_some(session.gauge_timeout), left_out)
    }

    /// What an operator asks of the session that the patch holds, and why.
    ///
    /// # Errors
    /// [`Rejection`] if it cannot be in the session's present state, or while the bag presses.
    pub fn command_session(
        &mut self,
        now: Now,
        (command, why): (Trigger, &str),
    ) -> Result<Arc<SessionView>, Rejection> {
        let view = self.held_session()?;
        commanded(view.number, view.state, command)?; // before what only matters in the right state
        if command == Trigger::StartRamp {
            self.check_gauge_heard(now)?;
            self.check_vented(now)?;
        }
        self.with_session(now, |session, _| session.command(now, command, why)).transpose()?;
        self.held_session()
    }

    /// The session that the patch holds.
    ///
    /// # Errors
    /// [`Rejection`] if it holds none.
    pub fn held_session(&self) -> Result<Arc<SessionView>, Rejection> {
        let view = self.session().cloned();
        view.map(Arc::new).ok_or_else(|| Rejection::NotFound(ErrorReason::SessionUnknown, "session".to_owned()))
    }

    /// The operator of the session that the patch holds types what a dial shows.
    ///
    /// # Errors
    /// [`Rejection`] if no ramp is under way, or why it is no plateau.
    pub fn take_plateau(&mut self, now: Now, kpa: f64) -> Result<Arc<SessionView>, Rejection> {
        self.with_session(now, |session, _| session.take_plateau(now, kpa)).transpose()?;
        self.held_session()
    }

    /// Another model set is in use from now on.
    pub fn set_models(&mut self, set: Arc<ModelSet>) {
        self.intake.expect_noise(&set.baseline);
        self.zero.on_models(&set);
        self.force.set_models(set, self.zero.residue_counts());
        self.force.move_zero(self.zero.in_force(), self.zero.as_taken(), self.zero.residue_counts()); // it may be one for other models
        self.force.set_confirmed(self.zero.confirmed());
        self.zero.weigh(&self.force.newton_per_count());
        self.dirty = true;
    }

    /// The set that was in use before the start is not used; why is said with every force that is missing, until another
    /// one is.
    pub fn refuse_models(&mut self, why: &str) {
        self.force.refuse_models(why);
        self.dirty = true;
    }

    /// Begins to read a known load.
    ///
    /// # Errors
    /// [`Rejection`] if there is no force to read, or the load cannot be.
    pub fn begin_load(&mut self, now: Now, request: RequestId, load: KnownLoad) -> Result<(), Rejection> {
        self.check_no_session("finish or abort it first")?;
        self.check_vented(now)?;
        let no_models = || "no model set is in use: there is no force to compare".to_owned();
        ErrorReason::NoModelSet.unless(self.force.models().is_some(), no_models)?;
        let no_zero = || format!("there is no valid zero: {}", self.zero.view().reason);
        ErrorReason::ZeroLost.unless(self.force.is_ready(), no_zero)?;
        self.loads.begin(now.time, request, load)
    }

    /// A load that was read, with all that it depends on.
    ///
    /// # Errors
    /// [`Rejection`] if it could not be read.
    pub fn complete_load(&self, now: Now, number: u64, read: LoadRead) -> Result<Arc<Load>, Rejection> {
        let model_set = self.force.models().map(|set| set.id.clone()).unwrap_or_default();
        Ok(Arc::new(Load { number, wall_ns: now.wall_ns, model_set, ..read.outcome? }))
    }

    /// A load that is on disk.
    pub fn keep_load(&mut self, load: Arc<Load>) {
        self.loads.keep(load);
    }

    /// All known loads, judged.
    pub fn validate(&self) -> Validation {
        self.loads.validation(self.force.models().map(|set| set.id.clone()))
    }
}
