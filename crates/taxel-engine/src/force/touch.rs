//! What a scan touches, and how it lies on taxels that cannot be read.

use taxel_skin::Newton;

use crate::force::neighbours::{Filled, Reading};
use crate::force::sampling::Contact;

/// The active taxels of a scan with their force in N, and what was taken from neighbours. Its owner keeps it from scan
/// to scan, so that a scan seldom has to ask for memory.
#[derive(Clone, Debug, Default)]
pub struct Touch {
    /// Taxel and force, those beyond the activation threshold first.
    pub active: Vec<(usize, f64)>,
    pub(super) beside: Vec<Filled>,
    /// Taxels beside active ones that are excluded, ascending.
    pub(super) missing: Vec<usize>,
    /// What each taxel reads without a threshold, while something lies beside excluded ones.
    pub(super) readings: Vec<Option<Reading>>,
    /// The contact that each taxel belongs to, and the sums of each; the first is of taxels without a position.
    pub(super) labels: Vec<u16>,
    pub(super) contacts: Vec<Contact>,
    /// How it lies on taxels that are excluded.
    pub(super) rim: Rim,
}

impl Touch {
    /// How many excluded taxels are beside touched ones, if they are more than these, or if more of a contact than `borne` may
    /// lie on them.
    #[must_use]
    pub fn hides_more_than(&self, borne: Newton) -> Option<usize> {
        let Rim { without, touched, hidden_n } = self.rim;
        let is_borne = hidden_n <= borne.0; // what is no number is not
        (without > touched || without > 0 && !is_borne).then_some(without)
    }
}

/// What of a patch may hide a contact that touches nothing.
#[derive(Clone, Copy, Debug)]
pub struct Hiding<'a> {
    /// Taxels that are not selected, ascending.
    pub excluded: &'a [usize],
    /// Those of them that a contact is beside, ascending: what may lie there makes the total a lower bound.
    pub beside: &'a [usize],
    /// The taxels of contacts with their forces, N: what they read is of these. Ascending without positions.
    pub touched: &'a [(usize, f64)],
}

/// How a contact lies on taxels that are excluded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rim {
    /// How many lie beside touched ones.
    pub(super) without: usize,
    /// Touched taxels.
    pub(super) touched: usize,
    /// What of its tip may lie on them, N.
    pub(super) hidden_n: f64,
}
