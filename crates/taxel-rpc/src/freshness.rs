//! Whether a snapshot is still fresh at the moment at which it is sent.
//!
//! The engine marks silent modules while it runs. A snapshot is judged again where it leaves, because it can grow old
//! between: the engine may hang, and a stream at a fixed rate sends one snapshot many times.

use std::time::Duration;
use taxel_engine::snapshot::TaxelState;
use taxel_proto::judge::{NoForce, withheld};
use taxel_proto::v1::{ForceSample, ForceState, ReasonCode};
use taxel_skin::Time;

/// What became of a snapshot by the time it is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Freshness {
    /// It may be sent as it is; also a snapshot without a frame, since it carries no value.
    Fresh,
    /// Its newest frame is so old, which is more than the limit.
    Old {
        /// Its age.
        age: Duration,
        /// How old it may be.
        limit: Duration,
    },
    /// The engine does not run, so nobody judges what comes over the bus.
    Stalled {
        /// For how long it has not run.
        silence: Duration,
    },
}

impl Freshness {
    /// Of a snapshot whose newest frame was received at `newest` (none yet: `None`) when it is sent at `now`, both on the
    /// run's clock, with a limit of age.
    pub(crate) fn of(newest: Option<Time>, limit: Duration, now: Time, stalled_for: Option<Duration>) -> Self {
        match (stalled_for, newest) {
            (Some(silence), _) => Self::Stalled { silence },
            (None, Some(newest)) if now.since(newest) > limit => Self::Old { age: now.since(newest), limit },
            (None, _) => Self::Fresh,
        }
    }

    /// Whether the snapshot may be sent as it is.
    pub(crate) fn is_fresh(self) -> bool {
        self == Self::Fresh
    }

    /// Whether both say the same but for the figures.
    pub(crate) fn is_like(self, other: Self) -> bool {
        std::mem::discriminant(&self) == std::mem::discriminant(&other)
    }

    /// The message as it goes out, of a patch with so many taxels: without its force if that is too old, or if the engine
    /// does not run.
    pub(crate) fn sent(self, sample: ForceSample, taxels: usize) -> ForceSample {
        let has_force = matches!(sample.state(), ForceState::Ok | ForceState::Degraded);
        let (code, why) = match self {
            Self::Stalled { silence } => (ReasonCode::EngineStalled, not_run_for(silence)),
            Self::Old { age, limit } if has_force => {
                (ReasonCode::FrameOld, format!("the newest frame is {}", NoForce::TooOld(age, limit)))
            }
            Self::Fresh | Self::Old { .. } => return sample,
        };
        let mut sent = ForceSample { stale: taxels as u32, excluded: 0, ..withheld(&sample, code, why) };
        if !has_force {
            sent.reasons.extend(sample.reasons); // there was no force before either: both reasons hold
            sent.causes.extend(sample.causes);
        }
        sent
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

    const LIMIT: Duration = Duration::from_millis(150);

    fn ms(ms: i64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    fn message(state: ForceState) -> ForceSample {
        ForceSample {
            state: state.into(),
            total_n: Some(4.64),
            reasons: vec!["bus 0: down".to_owned()],
            active: 7,
            model_set: "m-1".to_owned(),
            ..ForceSample::default()
        }
    }

    #[test]
    fn a_snapshot_is_fresh_until_its_newest_frame_is_older_than_the_limit() {
        for (newest, now_ms, stalled, expected) in [
            (Some(ms(1_000)), 900, None, Freshness::Fresh),
            (Some(ms(1_000)), 1_150, None, Freshness::Fresh),
            (Some(ms(1_000)), 1_151, None, Freshness::Old { age: Duration::from_millis(151), limit: LIMIT }),
            (None, 9_000, None, Freshness::Fresh),
            (None, 9_000, Some(LIMIT), Freshness::Stalled { silence: LIMIT }),
        ] {
            assert_eq!(Freshness::of(newest, LIMIT, ms(now_ms), stalled), expected, "at {now_ms} ms");
        }
    }

    #[test]
    fn what_is_too_old_goes_out_without_any_figure_and_with_the_reason() {
        let old = Freshness::Old { age: Duration::from_millis(6_040), limit: LIMIT };
        let old = old.sent(message(ForceState::Degraded), 230);
        assert_eq!((old.state(), old.total_n, old.active, old.stale), (ForceState::Stale, None, 0, 230));
        assert_eq!((old.model_set.as_str(), old.uncovered_share), ("m-1", 1.0));
        assert_eq!(old.reasons, ["the newest frame is 6040 ms old, more than 150 ms"]);
        assert_eq!(old.causes[0].code(), ReasonCode::FrameOld);
        let stalled = Freshness::Stalled { silence: Duration::from_millis(310) };
        let sent = stalled.sent(message(ForceState::TareInvalid), 230);
        assert_eq!(sent.reasons, ["the engine has not run for 0.31 s", "bus 0: down"]);
        assert_eq!((sent.state(), sent.causes[0].code()), (ForceState::Stale, ReasonCode::EngineStalled));
        let good = message(ForceState::Ok);
        assert_eq!(Freshness::Fresh.sent(good.clone(), 230), good);
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
