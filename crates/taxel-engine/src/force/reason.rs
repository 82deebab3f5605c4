//! Why a force is not what it should be: for programs a code and the taxels, for people a text.

use std::fmt;
use std::sync::Arc;

/// Why a force is not a good one, or why there is none: one value for all reasons that a program would answer in the same
/// way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ReasonCode {
    /// No frame of the patch has come yet. Added by the sender of the sample.
    NoFrame,
    /// The newest frame is too old. Added by the sender of the sample.
    FrameOld,
    /// The engine does not run. Added by the sender of the sample.
    EngineStalled,
    /// Taxels are silent.
    TaxelsSilent,
    /// Taxels in or beside what is touched have a fault; without positions any.
    TaxelsFaulty,
    /// Taxels are out of use, and so are those beside them.
    TaxelsExcluded,
    /// Taxels with a model have no zero.
    TaxelsWithoutZero,
    /// Active taxels read more than was calibrated.
    TaxelsOutOfRange,
    /// A load vanished from a whole board at once.
    LoadVanished,
    /// The drift of the zero reached its bound.
    DriftBounded,
    /// No model set is active.
    NoModelSet,
    /// No taxel has a usable model and is free of faults.
    NoUsableTaxel,
    /// No zero has been taken since the start.
    ZeroNotTaken,
    /// Rest could not be proven.
    NotUnloaded,
    /// The boards are not configured yet.
    BoardsNotConfigured,
    /// Something has moved the zero, or it was taken under a load.
    ZeroLost,
    /// Something may have moved the zero, which is being looked at.
    ZeroInCheck,
}

/// One reason, with the taxels that it is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reason {
    code: ReasonCode,
    taxels: Arc<[u16]>,
    text: String,
}

impl Reason {
    /// A reason that is not about particular taxels.
    pub fn new(code: ReasonCode, text: impl Into<String>) -> Self {
        Self { code, taxels: Arc::default(), text: text.into() }
    }

    /// A reason that is about these taxels, ascending.
    pub fn about(taxels: impl Into<Arc<[u16]>>, code: ReasonCode, text: impl Into<String>) -> Self {
        Self { code, taxels: taxels.into(), text: text.into() }
    }

    /// Which reason it is.
    #[must_use]
    pub const fn code(&self) -> ReasonCode {
        self.code
    }

    /// The taxels that it is about, ascending; none if it is not about particular ones.
    #[must_use]
    pub fn taxels(&self) -> &[u16] {
        &self.taxels
    }

    /// The same in words.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// All of them in one line, separated by semicolons.
#[must_use]
pub fn in_words(reasons: &[Reason]) -> String {
    reasons.iter().map(Reason::text).collect::<Vec<_>>().join("; ")
}

/// Positions of taxels as samples carry them; there are fewer than 65,536.
pub(crate) fn positions(taxels: impl Iterator<Item = usize>) -> Vec<u16> {
    taxels.filter_map(|taxel| u16::try_from(taxel).ok()).collect()
}
