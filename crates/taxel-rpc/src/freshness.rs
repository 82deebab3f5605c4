//! Whether a snapshot may still be believed at the moment at which it is sent: the only place that decides it.
//!
//! The engine marks silent modules while it runs. A snapshot is judged again where it leaves, because it can grow old
//! between: the engine may hang, and a stream at a fixed rate sends one snapshot many times.

use std::time::Duration;
use taxel_engine::snapshot::{ForceSample, ForceState, Reason, ReasonCode, TaxelState};
use taxel_skin::Time;

/// What became of a snapshot by the time it is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Freshness {
    /// It may be believed; also a snapshot in which there is no frame yet, since it carries no value.
    Fresh,
    /// Its newest frame is older than the scene allows.
    Old {
        /// Age of that frame.
        age: Duration,
        /// What the scene allows.
        limit: Duration,
    },
    /// The engine does not run, so nobody judges what comes over the bus.
    Stalled {
        /// For how long it has not run.
        silence: Duration,
    },
}

/// Judges a snapshot whose newest frame was received at `newest` (none yet: `None`) when it is sent at `now`, both on the
/// run's clock, in a scene that allows an age of `limit`.
pub(crate) fn judge(newest: Option<Time>, limit: Duration, now: Time, stalled_for: Option<Duration>) -> Freshness {
    if let Some(silence) = stalled_for {
        return Freshness::Stalled { silence };
    }
    match newest.map(|newest| now.since(newest)) {
        Some(age) if age > limit => Freshness::Old { age, limit },
        _ => Freshness::Fresh,
    }
}

impl Freshness {
    /// Whether the snapshot may be believed.
    pub(crate) fn is_fresh(self) -> bool {
        self == Self::Fresh
    }

    /// Whether both say the same but for the figures.
    pub(crate) fn is_like(self, other: Self) -> bool {
        std::mem::discriminant(&self) == std::mem::discriminant(&other)
    }

    /// Why the snapshot must not be believed, with the figures; `None` if it may.
    fn reason(self) -> Option<Reason> {
        match self {
            Self::Fresh => None,
            Self::Old { age, limit } => {
                let (age_s, limit_s) = (age.as_secs_f64(), limit.as_secs_f64());
                let text = format!("the newest frame is {age_s:.2} s old, the limit is {limit_s} s");
                Some(Reason::new(ReasonCode::FrameOld, text))
            }
            Self::Stalled { silence } => Some(Reason::new(ReasonCode::EngineStalled, not_run_for(silence))),
        }
    }

    /// What is left of a force that must not be believed, of a patch with so many taxels: that, and why. `None` if the
    /// force may go out as it is.
    pub(crate) fn withhold(self, force: &ForceSample, taxels: usize) -> Option<ForceSample> {
        let mut reasons = vec![self.reason()?];
        if force.state > ForceState::Degraded {
            reasons.extend_from_slice(&force.reasons); // there was no force before either: both reasons hold
        }
        Some(ForceSample {
            state: ForceState::Stale,
            reasons,
            stale: taxels as u32,
            uncovered_share: 1.0,
            model_set: force.model_set.clone(),
            ..ForceSample::default()
        })
    }

    /// A taxel as it goes out at `now` in a snapshot of this freshness: without a pressure if that, or its own count, is
    /// too old.
    pub(crate) fn taxel(self, taxel: &TaxelState, limit: Duration, now: Time) -> TaxelState {
        let old = taxel.seen && now.since(taxel.time) > limit;
        if self.is_fresh() && !old && !taxel.stale {
            return *taxel;
        }
        TaxelState { stale: true, active: false, pressure_kpa: None, sigma_kpa: None, ..*taxel }
    }
}

/// The same words in streams, health and log.
pub(crate) fn not_run_for(silence: Duration) -> String {
    format!("the engine has not run for {:.2} s", silence.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use taxel_engine::snapshot::Contact;
    use taxel_skin::Newton;

    const LIMIT: Duration = Duration::from_millis(150);

    fn ms(ms: i64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    fn force(state: ForceState, reason: &str) -> ForceSample {
        ForceSample {
            state,
            reasons: vec![Reason::new(ReasonCode::TaxelsFaulty, reason)],
            total: Some(Newton(4.64)),
            total_sigma: Some(Newton(0.1)),
            resultant: Some([1.0; 3]),
            moment: Some([1.0; 3]),
            centre_of_pressure: Some([1.0; 3]),
            contacts: vec![Contact::default()],
            active: 7,
            excluded: 3,
            out_of_range: 2,
            filled: 1,
            filled_share: 0.5,
            model_set: Some(Arc::from("m-1")),
            ..ForceSample::default()
        }
    }

    #[test]
    fn a_snapshot_may_be_sent_until_its_newest_frame_is_older_than_the_limit() {
        let newest = Some(ms(1_000));
        for now_ms in [0, 900, 1_000, 1_149, 1_150] {
            assert_eq!(judge(newest, LIMIT, ms(now_ms), None), Freshness::Fresh, "at {now_ms} ms");
        }
        for now_ms in [1_151, 7_040, i64::from(u32::MAX)] {
            let age = Duration::from_millis(now_ms as u64 - 1_000);
            assert_eq!(judge(newest, LIMIT, ms(now_ms), None), Freshness::Old { age, limit: LIMIT }, "at {now_ms} ms");
        }
        assert_eq!(judge(None, LIMIT, ms(9_000), None), Freshness::Fresh, "no frame, no value, no age");
    }

    #[test]
    fn a_stalled_engine_is_told_whatever_the_age() {
        let silence = Duration::from_millis(310);
        for newest in [None, Some(ms(1_000)), Some(ms(0))] {
            assert_eq!(judge(newest, LIMIT, ms(1_000), Some(silence)), Freshness::Stalled { silence });
        }
    }

    #[test]
    fn what_is_too_old_goes_out_without_any_figure_and_with_the_reason() {
        let old = Freshness::Old { age: Duration::from_millis(6_040), limit: LIMIT };
        let sent = old.withhold(&force(ForceState::Degraded, "3 taxels have a fault"), 230).unwrap();
        assert_eq!((sent.state, sent.stale, sent.uncovered_share), (ForceState::Stale, 230, 1.0));
        assert_eq!((sent.total, sent.total_sigma, sent.resultant, sent.moment), (None, None, None, None));
        assert_eq!((sent.centre_of_pressure, sent.contacts.len()), (None, 0));
        assert_eq!((sent.active, sent.excluded, sent.out_of_range, sent.filled, sent.filled_share), (0, 0, 0, 0, 0.0));
        assert_eq!(sent.model_set.as_deref(), Some("m-1"));
        assert_eq!(sent.why(), "the newest frame is 6.04 s old, the limit is 0.15 s");
        assert_eq!(sent.reasons[0].code(), ReasonCode::FrameOld);
        let stalled = Freshness::Stalled { silence: Duration::from_millis(310) };
        let sent = stalled.withhold(&force(ForceState::TareInvalid, "bus 0: down"), 230).unwrap();
        assert_eq!(sent.why(), "the engine has not run for 0.31 s; bus 0: down");
        assert_eq!(sent.reasons[0].code(), ReasonCode::EngineStalled);
        assert!(Freshness::Fresh.withhold(&force(ForceState::Ok, ""), 230).is_none());
    }

    #[test]
    fn a_taxel_loses_its_pressure_with_its_own_age_or_with_the_snapshot() {
        let taxel = TaxelState {
            count: 180,
            time: ms(1_000),
            seen: true,
            active: true,
            calibrated: true,
            pressure_kpa: Some(12.0),
            sigma_kpa: Some(0.5),
            ..TaxelState::default()
        };
        let stalled = Freshness::Stalled { silence: LIMIT };
        assert_eq!(Freshness::Fresh.taxel(&taxel, LIMIT, ms(1_150)), taxel);
        for (freshness, now) in [(Freshness::Fresh, ms(1_151)), (stalled, ms(1_000))] {
            let sent = freshness.taxel(&taxel, LIMIT, now);
            assert_eq!((sent.stale, sent.active, sent.pressure_kpa, sent.sigma_kpa), (true, false, None, None));
            assert_eq!((sent.count, sent.time, sent.seen, sent.calibrated), (180, ms(1_000), true, true));
        }
        let unseen = TaxelState::default();
        assert!(!Freshness::Fresh.taxel(&unseen, LIMIT, ms(9_000)).stale, "never received is the engine's to tell");
    }
}
