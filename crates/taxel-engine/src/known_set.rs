//! A model set as lists show it, without its models: those are read from the store when somebody needs them.

use std::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::model_set::ModelSet;

/// What lists show of a model set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetSummary {
    /// The set's id.
    pub id: String,
    /// The patch it is for.
    pub patch: String,
    /// When it was made, nanoseconds since 1970.
    pub created_wall_ns: i64,
    /// Number of the session it came from; `None` if it was fitted from a file or imported.
    pub session: Option<u64>,
    /// How it was fitted.
    pub method: String,
    /// Taxels that it has an entry for.
    pub taxels: usize,
    /// Those of them with a model that may be used.
    pub calibrated: usize,
    /// Highest pressure that was calibrated, in kPa.
    pub pressure_max_kpa: f64,
    /// Ids of the sets that known loads corrected to make this one, the nearest first.
    pub origins: Vec<String>,
}

impl SetSummary {
    /// What lists show of this set.
    #[must_use]
    pub fn of(set: &ModelSet) -> Self {
        Self {
            id: set.id.clone(),
            patch: set.patch.clone(),
            created_wall_ns: set.created_wall_ns,
            session: set.session,
            method: set.method.clone(),
            taxels: set.taxels.len(),
            calibrated: set.taxels.iter().filter(|model| model.is_usable()).count(),
            pressure_max_kpa: set.pressure_max_kpa,
            origins: set.origins().map(str::to_owned).collect(),
        }
    }
}

/// A model set that is in the store. Dereferences to its summary.
#[derive(Clone, Debug)]
pub struct KnownSet {
    summary: Arc<SetSummary>,
    /// The set itself where it is in memory: it is in use, or was made or read lately.
    pub at_hand: Option<Arc<ModelSet>>,
}

impl KnownSet {
    /// One that only the store has.
    #[must_use]
    pub fn stored(summary: SetSummary) -> Self {
        Self { summary: Arc::new(summary), at_hand: None }
    }
}

impl From<Arc<ModelSet>> for KnownSet {
    fn from(set: Arc<ModelSet>) -> Self {
        Self { summary: Arc::new(SetSummary::of(&set)), at_hand: Some(set) }
    }
}

impl Deref for KnownSet {
    type Target = SetSummary;

    fn deref(&self) -> &SetSummary {
        &self.summary
    }
}
