//! A zero that was proven for an operator and holds once it is on disk.

use crate::baseline::TaxelBaseline;
use crate::request::RequestId;
use crate::zero::view::TareView;

/// The zero, for whom it was taken, and what has moved it meanwhile.
#[derive(Clone, Debug)]
pub struct Proven {
    request: RequestId,
    /// Why the counts could not show rest when it was taken, if somebody vouched for it.
    unproven: Option<String>,
    zero: Result<(TareView, Vec<TaxelBaseline>), String>,
}

impl Proven {
    /// A zero for `request`, one baseline per taxel, taken although the counts could not show rest for the reason `unproven`.
    #[must_use]
    pub const fn new(
        request: RequestId,
        view: TareView,
        baseline: Vec<TaxelBaseline>,
        unproven: Option<String>,
    ) -> Self {
        Self { request, unproven, zero: Ok((view, baseline)) }
    }

    /// Whether this was known when it was taken.
    #[must_use]
    pub fn knew(&self, unproven: &str) -> bool {
        self.unproven.as_deref() == Some(unproven)
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

    /// The zero.
    ///
    /// # Errors
    /// What has moved it, in words.
    pub fn zero(self) -> Result<(TareView, Vec<TaxelBaseline>), String> {
        self.zero
    }
}
