//! A zero that was proven for an operator and holds once it is on disk.

use crate::baseline::TaxelBaseline;
use crate::request::RequestId;
use crate::zero::view::TareView;

/// What is held against the boards, in words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Known {
    /// The zero of a board is in doubt.
    pub doubted: Option<String>,
    /// A load has just vanished from a board at once.
    pub vanished: Option<String>,
    /// The counts cannot show rest.
    pub unproven: Option<String>,
}

/// The zero, for whom it was taken, and what has moved it meanwhile.
#[derive(Clone, Debug)]
pub struct Proven {
    request: RequestId,
    /// What was held against the boards when it was taken.
    known: Known,
    /// Whether somebody vouches for it.
    vouched: bool,
    zero: Result<(TareView, Vec<TaxelBaseline>), String>,
}

impl Proven {
    /// A zero for `request`, one baseline per taxel, whether somebody vouches for it, and what was held against the boards when it
    /// was taken.
    #[must_use]
    pub const fn new(
        request: RequestId,
        view: TareView,
        baseline: Vec<TaxelBaseline>,
        vouched: bool,
        known: Known,
    ) -> Self {
        Self { request, known, vouched, zero: Ok((view, baseline)) }
    }

    /// This is held against the boards now: what is new of it spoils the zero.
    pub fn spoil_by(&mut self, now: &Known) {
        let new = |now: &Option<String>, then: &Option<String>| now.clone().filter(|_| now != then);
        let why = new(&now.doubted, &self.known.doubted)
            .or_else(|| new(&now.vanished, &self.known.vanished))
            .or_else(|| new(&now.unproven, &self.known.unproven));
        if let Some(why) = why {
            self.spoil(&why);
        }
    }

    /// Whether it was taken for `request`.
    #[must_use]
    pub fn is_for(&self, request: RequestId) -> bool {
        self.request == request
    }

    /// Something has moved it; the first reason stays.
    pub fn spoil(&mut self, why: &str) {
        if self.zero.is_ok() {
            self.zero = Err(why.to_owned());
        }
    }

    /// The zero, and whether somebody vouches for it.
    ///
    /// # Errors
    /// What has moved it, in words.
    pub fn zero(self) -> Result<(TareView, Vec<TaxelBaseline>, bool), String> {
        self.zero.map(|(view, baseline)| (view, baseline, self.vouched))
    }
}
