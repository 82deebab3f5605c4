//! What must hold of everything that the engine puts out, whatever happens to it.

pub mod check {
    use taxel_engine::calibration::{SessionState, SessionView};
    use taxel_engine::plan::PatchPlan;
    use taxel_engine::snapshot::{Catalogue, ForceSample, ForceState, PatchSnapshot, TaxelState};
    use taxel_skin::Time;

    use crate::host::SLOT;

    /// A reader must be able to trust any single snapshot.
    pub fn snapshot(plan: &PatchPlan, now: Time, before: Option<&PatchSnapshot>, snapshot: &PatchSnapshot) {
        assert_eq!(snapshot.sequence, before.map_or(1, |b| b.sequence + 1), "a sequence without gaps");
        assert!(snapshot.time <= now, "a snapshot from the future: {:?} at {now:?}", snapshot.time);
        assert!(before.is_none_or(|b| b.time <= snapshot.time), "the newest frame grows older");
        assert_eq!(snapshot.taxels.len(), plan.patch.taxels().len());
        // Silence is looked for at each tick.
        let oldest = now - (plan.live.stale_after + SLOT);
        for (taxel, state) in snapshot.taxels.iter().enumerate() {
            check_taxel(taxel, state, oldest);
        }
        check_force(&snapshot.force);
        check_active(plan, snapshot);
        let stale = snapshot.taxels.iter().filter(|t| t.stale).count();
        assert_eq!(snapshot.force.stale as usize, stale, "stale taxels");
        let tare = snapshot.tare.as_ref().expect("a snapshot tells of its zero");
        assert!(tare.baseline_median.is_finite() && tare.noise_median.is_finite(), "{tare:?}");
        assert!(tare.valid || snapshot.force.total.is_none(), "a force without a zero");
        assert!(!tare.reason.is_empty(), "a zero, or the lack of one, has its reason");
    }

    fn check_taxel(taxel: usize, state: &TaxelState, oldest: Time) {
        let reading = [state.pressure_kpa, state.sigma_kpa];
        assert!(reading.iter().flatten().all(|x| x.is_finite()), "taxel {taxel}: {state:?}");
        assert!(state.pressure_kpa.is_none_or(|p| p >= 0.0), "a skin cannot be pulled, taxel {taxel}: {state:?}");
        assert!(state.sigma_kpa.is_none_or(|s| s >= 0.0), "taxel {taxel}: {state:?}");
        assert!(state.seen || state.stale, "taxel {taxel} was never heard and is not stale");
        assert!(state.stale || state.time >= oldest, "taxel {taxel} is stale and does not say so: {state:?}");
        if state.stale || !state.calibrated {
            assert!(reading == [None; 2] && !state.active, "a value without ground, taxel {taxel}: {state:?}");
        }
    }

    fn check_force(force: &ForceSample) {
        let given = matches!(force.state, ForceState::Ok | ForceState::Degraded);
        assert_eq!(force.total.is_some(), given, "{:?} with {:?}", force.state, force.total);
        assert_eq!(force.total_sigma.is_some(), given, "{:?} with {:?}", force.state, force.total_sigma);
        let is_good = force.state == ForceState::Ok && !force.unbounded;
        assert_eq!(force.reasons.is_empty(), is_good, "{:?}: {:?}", force.state, force.reasons);
        assert!(force.reasons.iter().all(|reason| !reason.text().is_empty()));
        let vectors = [force.resultant, force.moment, force.centre_of_pressure];
        assert!(given || (vectors == [None; 3] && force.contacts.is_empty()), "{:?} with a vector", force.state);
        let mut numbers: Vec<f64> = force.total.iter().chain(&force.total_sigma).map(|n| n.0).collect();
        numbers.extend(force.low().iter().chain(&force.most(1.0)).map(|n| n.0));
        numbers.extend(vectors.iter().flatten().flatten());
        numbers.extend(force.contacts.iter().flat_map(|c| [c.force_n, c.centre[0], c.centre[1], c.centre[2]]));
        assert!(numbers.iter().all(|x| x.is_finite()), "{force:?}");
        assert!(force.total.is_none_or(|n| n.0 >= 0.0) && force.total_sigma.is_none_or(|n| n.0 >= 0.0), "{force:?}");
    }

    /// The taxels that are called active are those that the total is made of.
    fn check_active(plan: &PatchPlan, snapshot: &PatchSnapshot) {
        let active = || snapshot.taxels.iter().zip(&plan.areas).filter(|(taxel, _)| taxel.active);
        assert_eq!(snapshot.force.active as usize, active().count(), "active taxels");
        let Some(total) = snapshot.force.total else { return };
        let sum: f64 = active().map(|(taxel, area)| f64::from(taxel.pressure_kpa.unwrap_or(0.0)) * area.0 * 1e-3).sum();
        // To the active taxels come those beside them, by their readings below the threshold, and what all lie off: with 0.03 N
        // a count, 1.5 counts and no more than one.
        let active = active().count() as f64;
        let slack =
            1e-3 + 1e-3 * total.0 + if active > 0.0 { 0.1 * (2.0 + 2.0 * active).sqrt() + 0.03 * active } else { 0.0 };
        // Unread taxels that are filled are in the total, too.
        let fits = sum < total.0 + slack && (plan.outputs.fill || sum > total.0 - slack);
        assert!(fits, "{sum} N on active taxels, {} N in the total", total.0);
    }

    pub fn session(view: &SessionView) {
        let numbers = [view.pressure_kpa, view.rate_kpa_per_s, view.remaining_s, Some(view.coverage)];
        assert!(numbers.iter().flatten().all(|x| x.is_finite()), "{view:?}");
        assert!((0.0..=1.0).contains(&view.coverage) && view.target_kpa.is_finite(), "{view:?}");
        assert!(view.durable <= view.accepted && view.responding.0 <= view.responding.1, "{view:?}");
        assert!(view.remaining_s.is_none_or(|s| s >= 0.0), "{view:?}");
    }

    /// A client that reads that a session is in review asks for its model set.
    pub fn model_set_is_there(view: &SessionView, catalogue: &Catalogue) {
        let Some(id) = view.model_set.as_ref().filter(|_| view.state == SessionState::Review) else { return };
        let there = catalogue.model_sets.iter().any(|set| set.id == **id);
        assert!(there, "session {} names model set {id} before that is to be had", view.number);
    }
}
