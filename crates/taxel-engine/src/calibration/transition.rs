//! The course of a session as one table: which state follows from which, and why a command is refused.

use crate::calibration::view::SessionState;
use crate::request::{ErrorReason, Rejection};

/// What can change the state of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Trigger {
    /// An operator asks for another ramp.
    StartRamp,
    /// An operator ends the ramp, or has what was gathered fitted.
    FinishRamp,
    /// An operator stops it.
    Abort,
    /// An operator lays it aside.
    Discard,
    /// What entered the ramp cannot be trusted.
    Void,
    /// The fit gave a model set.
    Fitted,
    /// It cannot succeed: no zero, nothing that enters, no models, or no store.
    Fail,
}

impl Trigger {
    /// Why a session is in the state that an operator's command ended it with, in words.
    pub const fn reason(self) -> &'static str {
        match self {
            Self::Abort => "an operator aborted it",
            Self::Discard => "an operator laid it aside",
            _ => "",
        }
    }

    /// What an operator cannot do now, in words; for triggers that are commands.
    const fn what(self) -> &'static str {
        match self {
            Self::StartRamp => "a ramp can begin",
            Self::FinishRamp => "a ramp can be finished",
            Self::Abort => "a session can be aborted",
            Self::Discard => "a session can be discarded",
            _ => "this can happen",
        }
    }
}

/// The state after `trigger`; `None` where it changes nothing or, of a command, is refused.
///
/// A command to finish a ramp over both branches turns it first, which is no change of state.
pub const fn transition(state: SessionState, trigger: Trigger) -> Option<SessionState> {
    use SessionState as S;
    use Trigger as T;
    match (trigger, state) {
        (T::StartRamp, S::Review | S::Interrupted | S::Failed | S::Aborted) => Some(S::Taring),
        (T::FinishRamp, S::Ramping | S::Interrupted | S::Failed) => Some(S::Fitting),
        (T::Abort, S::Taring | S::Ramping | S::Fitting | S::Interrupted) => Some(S::Aborted),
        (T::Discard, S::Review | S::Discarded | S::Aborted | S::Failed | S::Interrupted) => Some(S::Discarded),
        (T::Void, S::Ramping) => Some(S::Discarded),
        (T::Fitted, S::Fitting) => Some(S::Review),
        (T::Fail, S::Taring | S::Ramping | S::Fitting) => Some(S::Failed),
        _ => None,
    }
}

/// The state after an operator's command.
///
/// # Errors
/// [`Rejection::FailedPrecondition`], naming the state and those in which it can be done.
pub fn commanded(number: u64, state: SessionState, command: Trigger) -> Result<SessionState, Rejection> {
    transition(state, command).ok_or_else(|| {
        let words = SessionState::ALL.into_iter().filter(|s| transition(*s, command).is_some());
        let words: Vec<&str> = words.map(SessionState::name).collect();
        let (is, what) = (state.name(), command.what());
        let instead = match (state, command) {
            (SessionState::Active, Trigger::StartRamp) => {
                format!(". Gather it in a new session, and fit both: taxeld sessions refit {number} NEW")
            }
            _ => String::new(),
        };
        let words = words.join(", ");
        ErrorReason::SessionWrongState.because(format!("session {number} is {is}; {what} only in {words}{instead}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every cell. A row is a trigger; where it leads from each state of [`SessionState::ALL`], by its first letters.
    #[test]
    fn the_table_is_this_one() {
        const TABLE: [(Trigger, &str); 7] = [
            //                      Tar Ram Fit Rev Act Dis Abo Fai Int
            (Trigger::StartRamp, "    -   -   - TAR   -   - TAR TAR TAR"),
            (Trigger::FinishRamp, "   - FIT   -   -   -   -   - FIT FIT"),
            (Trigger::Abort, "      ABO ABO ABO   -   -   -   -   - ABO"),
            (Trigger::Discard, "      -   -   - DIS   - DIS DIS DIS DIS"),
            (Trigger::Void, "         - DIS   -   -   -   -   -   -   -"),
            (Trigger::Fitted, "       -   - REV   -   -   -   -   -   -"),
            (Trigger::Fail, "       FAI FAI FAI   -   -   -   -   -   -"),
        ];
        for (trigger, row) in TABLE {
            for (state, leads) in SessionState::ALL.into_iter().zip(row.split_whitespace()) {
                let next = transition(state, trigger).map_or("-", |next| &next.name()[..3]);
                assert_eq!(next, leads, "{trigger:?} in {state:?}");
            }
        }
    }
}
