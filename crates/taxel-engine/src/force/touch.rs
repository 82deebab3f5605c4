//! What a scan touches, and how it lies on taxels that cannot be read.

use taxel_skin::Newton;

use crate::force::neighbours::Filled;
use crate::force::sampling::Contact;

/// The active taxels of a scan with their force in N, and what was taken from neighbours. Its owner keeps it from scan
/// to scan, so that no scan has to ask for memory.
#[derive(Clone, Debug, Default)]
pub struct Touch {
    /// Taxel and force, those beyond the activation threshold first.
    pub active: Vec<(usize, f64)>,
    pub(super) beside: Vec<Filled>,
    /// Taxels beside active ones that are excluded, ascending.
    pub(super) missing: Vec<usize>,
    /// The contact that each taxel belongs to, and the sums of each; the first is of taxels without a position.
    pub(super) labels: Vec<u16>,
    pub(super) contacts: Vec<Contact>,
    /// How it lies on taxels that are excluded.
    pub(super) rim: Rim,
}

impl Touch {
    /// How many excluded taxels are beside touched ones, if more of a contact may lie on them than on touched ones, or so much
    /// that the total is short of it by more than `borne`.
    #[must_use]
    pub fn mostly_blind(&self, borne: Newton) -> Option<usize> {
        let Rim { without, touched, hidden_n } = self.rim;
        (without > touched || hidden_n > borne.0).then_some(without)
    }
}

/// How a contact lies on taxels that are excluded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rim {
    /// How many lie beside touched ones.
    pub(super) without: usize,
    /// Touched taxels.
    pub(super) touched: usize,
    /// What of its tip may lie on them and is not in the total, N.
    pub(super) hidden_n: f64,
}
