//! The engine's snapshots as messages. An age is computed here, so this runs last before a message goes out.

use std::time::{SystemTime, UNIX_EPOCH};

use taxel_engine::plan::PatchPlan;
use taxel_engine::snapshot::{
    Contact, FaultSet, ForceState, PatchSnapshot, RangeFlag, Reason, ReasonCode, TareView, TaxelState, Term,
};
use taxel_proto::{Timestamp, v1};
use taxel_skin::{Newton, Time};

use crate::freshness::Freshness;

/// An enumeration of the engine's as the one of the service with the same names.
macro_rules! same_names {
    ($(#[$doc:meta])* $visibility:vis $name:ident: $from:ty => $to:ty, $($variant:ident)+) => {
        $(#[$doc])*
        $visibility const fn $name(value: $from) -> $to {
            match value {
                $(<$from>::$variant => <$to>::$variant,)+
            }
        }
    };
}
pub(crate) use same_names;

/// When a message goes out and what it leaves behind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sending {
    /// The moment of sending on the run's clock.
    pub(crate) now: Time,
    /// Whether the snapshot is fresh at that moment.
    pub(crate) freshness: Freshness,
    /// Values that this reader does not get.
    pub(crate) skipped: u64,
}

/// A label in wall-clock time; none for the engine's "never", 0.
pub(crate) fn timestamp(wall_ns: i64) -> Option<Timestamp> {
    let (seconds, nanos) = (wall_ns.div_euclid(1_000_000_000), wall_ns.rem_euclid(1_000_000_000));
    (wall_ns != 0).then_some(Timestamp { seconds, nanos: nanos as i32 })
}

/// The present, nanoseconds since 1970.
pub(crate) fn wall_ns() -> i64 {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX)
}

pub(crate) fn vector(v: [f64; 3]) -> v1::Vector3 {
    let [x, y, z] = v;
    v1::Vector3 { x, y, z }
}

/// A figure that is known; the engine's "unknown" is infinite or NaN, which the wire does not carry.
pub(crate) fn known(figure: f64) -> Option<f64> {
    figure.is_finite().then_some(figure)
}

/// A sample: of each reason how many taxels it is about. One that was asked for once has, `in_full`, also which taxels, and what
/// the uncertainty is made of.
pub(crate) fn force(plan: &PatchPlan, snapshot: &PatchSnapshot, sending: Sending, in_full: bool) -> v1::ForceSample {
    let force = &snapshot.force;
    // A value without any frame has no time and so no age.
    let framed = snapshot.seen;
    let unseen = (!framed).then(|| Reason::new(ReasonCode::NoFrame, "no frame of this patch has come yet"));
    let reasons = || unseen.iter().chain(&force.reasons);
    let message = v1::ForceSample {
        sequence: snapshot.sequence,
        state: force_state(force.state).into(),
        total_n: force.total.and_then(|total| known(total.0)),
        total_sigma_n: force.total_sigma.and_then(|sigma| known(sigma.0)),
        low_n: force.low().and_then(|low| known(low.0)),
        high_n: force.high().and_then(|high| known(high.0)),
        undetected_n: force.undetected.and_then(|undetected| known(undetected.at_most().0)),
        budget: if in_full && force.total.is_some() { force.budget.terms().map(term).collect() } else { Vec::new() },
        zero_epoch: force.zero_epoch,
        step_n: force.step.and_then(|step| known(step.0)),
        age_s: framed.then(|| sending.now.since(snapshot.time).as_secs_f64()),
        monotonic_ns: framed.then(|| snapshot.time.as_nanos()),
        time: timestamp(snapshot.wall_ns).filter(|_| framed),
        skipped: sending.skipped,
        active: force.active,
        excluded: force.excluded,
        stale: force.stale,
        out_of_range: force.out_of_range,
        model_set: force.model_set.as_deref().unwrap_or_default().to_owned(),
        reasons: reasons().map(|reason| reason.text().to_owned()).collect(),
        causes: reasons().map(|reason| cause(reason, in_full)).collect(),
        patch: plan.patch.name().to_owned(),
        resultant_n: force.resultant.map(vector),
        moment_nm: force.moment.map(vector),
        centre_of_pressure_m: force.centre_of_pressure.map(vector),
        contacts: force.contacts.iter().map(contact).collect(),
        simulated: snapshot.simulated,
        max_age_s: plan.live.stale_after.as_secs_f64(),
        sent: Some(SystemTime::now().into()),
    };
    sending.freshness.sent(message, plan.patch.taxels().len())
}

fn contact(contact: &Contact) -> v1::Contact {
    v1::Contact {
        id: contact.id,
        area_mm2: contact.area_mm2,
        peak_kpa: contact.peak_kpa,
        force_n: contact.force_n,
        centre_m: Some(vector(contact.centre)),
        resultant_n: Some(vector(contact.resultant)),
        moment_nm: Some(vector(contact.moment)),
        taxels: contact.taxels.iter().map(|taxel| u32::from(*taxel)).collect(),
    }
}

pub(crate) fn taxels(plan: &PatchPlan, snapshot: &PatchSnapshot, sending: Sending) -> v1::TaxelSample {
    let framed = snapshot.seen;
    let Sending { now, freshness, .. } = sending;
    let sent = |taxel| reading(&freshness.taxel(taxel, plan.live.stale_after, now), now);
    v1::TaxelSample {
        sequence: snapshot.sequence,
        patch: plan.patch.name().to_owned(),
        age_s: framed.then(|| sending.now.since(snapshot.time).as_secs_f64()),
        monotonic_ns: framed.then(|| snapshot.time.as_nanos()),
        time: timestamp(snapshot.wall_ns).filter(|_| framed),
        skipped: sending.skipped,
        taxels: snapshot.taxels.iter().map(sent).collect(),
        max_age_s: plan.live.stale_after.as_secs_f64(),
        sent: Some(SystemTime::now().into()),
    }
}

fn reading(taxel: &TaxelState, now: Time) -> v1::TaxelReading {
    let range = match taxel.range {
        _ if taxel.pressure_kpa.is_none() => v1::Range::Unspecified,
        RangeFlag::In => v1::Range::In,
        RangeFlag::Below => v1::Range::Below,
        RangeFlag::Above => v1::Range::Above,
    };
    v1::TaxelReading {
        count: taxel.seen.then(|| u32::from(taxel.count)),
        age_s: taxel.seen.then(|| now.since(taxel.time).as_secs_f32()),
        stale: taxel.stale,
        active: taxel.active,
        calibrated: taxel.calibrated,
        range: range.into(),
        pressure_kpa: taxel.pressure_kpa.filter(|kpa| kpa.is_finite()),
        sigma_kpa: taxel.sigma_kpa.filter(|kpa| kpa.is_finite()),
        faults: faults(taxel.faults),
    }
}

pub(crate) fn faults(set: FaultSet) -> Vec<String> {
    set.iter().map(|fault| fault.name().to_owned()).collect()
}

same_names!(
    /// The engine's state of a force as that of the service.
    #[must_use]
    pub force_state: ForceState => v1::ForceState, Ok Degraded Stale TareInvalid Uncalibrated);

pub(crate) fn tare(patch: &str, tare: Option<&TareView>) -> v1::TareStatus {
    let Some(tare) = tare else {
        let reason = "no zero has been taken yet".to_owned();
        let reason_code = v1::ReasonCode::ZeroNotTaken.into();
        return v1::TareStatus { patch: patch.to_owned(), reason, reason_code, ..v1::TareStatus::default() };
    };
    v1::TareStatus {
        patch: patch.to_owned(),
        epoch: tare.epoch,
        valid: tare.valid,
        time: timestamp(tare.wall_ns),
        reason: tare.reason.clone(),
        reason_code: tare.code.map_or(v1::ReasonCode::Unspecified, code).into(),
        baseline_median_counts: known(tare.baseline_median).unwrap_or_default(),
        noise_median_counts: known(tare.noise_median).unwrap_or_default(),
        drift_median_counts: known(tare.drift.median_counts).unwrap_or_default(),
    }
}

fn term((term, sigma): (Term, Newton)) -> v1::Uncertainty {
    v1::Uncertainty { term: term.name().to_owned(), sigma_n: sigma.0 }
}

/// A reason with the number of its taxels, which a sample of a stream can bear, and in full with all of them.
fn cause(reason: &Reason, in_full: bool) -> v1::ForceReason {
    let which = if in_full { reason.taxels().iter().map(|&taxel| taxel.into()).collect() } else { Vec::new() };
    v1::ForceReason { code: code(reason.code()).into(), taxels: reason.taxels().len() as u32, which }
}

same_names!(code: ReasonCode => v1::ReasonCode,
    NoFrame FrameOld EngineStalled TaxelsSilent TaxelsFaulty TaxelsExcluded TaxelsWithoutZero TaxelsOutOfRange LoadVanished
    DriftBounded NoModelSet NoUsableTaxel ZeroNotTaken NotUnloaded BoardsNotConfigured ZeroLost ZeroInCheck);
