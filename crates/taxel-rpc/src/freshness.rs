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
