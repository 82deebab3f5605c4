//! The reasons of a force as messages.

use taxel_engine::snapshot::{Reason, ReasonCode};
use taxel_proto::v1;

/// With the number of its taxels: what a sample of a stream can bear.
pub(crate) fn counted(reason: &Reason) -> v1::ForceReason {
    v1::ForceReason { code: code(reason.code()).into(), taxels: reason.taxels().len() as u32, which: Vec::new() }
}

/// With its taxels.
pub(crate) fn listed(reason: &Reason) -> v1::ForceReason {
    v1::ForceReason { which: reason.taxels().iter().map(|&taxel| taxel.into()).collect(), ..counted(reason) }
}

/// The engine's codes under the same names.
pub(crate) const fn code(code: ReasonCode) -> v1::ReasonCode {
    use v1::ReasonCode as Sent;
    match code {
        ReasonCode::NoFrame => Sent::NoFrame,
        ReasonCode::FrameOld => Sent::FrameOld,
        ReasonCode::EngineStalled => Sent::EngineStalled,
        ReasonCode::TaxelsSilent => Sent::TaxelsSilent,
        ReasonCode::TaxelsFaulty => Sent::TaxelsFaulty,
        ReasonCode::TaxelsBlind => Sent::TaxelsBlind,
        ReasonCode::TaxelsWithoutZero => Sent::TaxelsWithoutZero,
        ReasonCode::TaxelsOutOfRange => Sent::TaxelsOutOfRange,
        ReasonCode::LoadVanished => Sent::LoadVanished,
        ReasonCode::DriftBounded => Sent::DriftBounded,
        ReasonCode::NoModelSet => Sent::NoModelSet,
        ReasonCode::NoUsableTaxel => Sent::NoUsableTaxel,
        ReasonCode::ZeroNotTaken => Sent::ZeroNotTaken,
        ReasonCode::RestNotProven => Sent::RestNotProven,
        ReasonCode::BoardsNotConfigured => Sent::BoardsNotConfigured,
        ReasonCode::ZeroLost => Sent::ZeroLost,
        ReasonCode::ZeroDoubted => Sent::ZeroDoubted,
    }
}
