//! What outlives the daemon of a patch's zero. The boards keep theirs while it is away, and go on with it.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hasher};
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize};

use crate::baseline::TaxelBaseline;
use crate::model_set::ModelSet;

/// What is known of the zero of a patch, and of the zeros that its boards take when they are configured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeptZero {
    /// The sum over the settings of the boards when the daemon ran last, with which it has configured them if it does.
    pub configured: Option<u32>,
    /// Why a zero needs confirmation, if it does: a board took a zero of its own under a load, or nobody saw what lay on it.
    pub needs_confirmation: Option<String>,
    /// The model set for which that does not count: it was made in a session on the boards as they are.
    pub excused: Option<String>,
    /// The zero that is valid.
    pub zero: Option<Arc<TakenZero>>,
}

/// A zero as it was taken.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TakenZero {
    /// One more for each zero taken or lost.
    pub epoch: u64,
    /// Whether the counts showed rest.
    pub at_rest: bool,
    /// When it was taken, nanoseconds since 1970.
    pub wall_ns: i64,
    /// The rest test's figures, and who confirmed it.
    pub reason: String,
    /// Whether somebody confirmed it.
    pub confirmed: bool,
    /// Mean of each taxel, counts; NaN where it is not known.
    #[serde(deserialize_with = "with_gaps")]
    pub mean: Vec<f64>,
    /// Noise of each taxel, counts.
    #[serde(deserialize_with = "with_gaps")]
    pub noise: Vec<f64>,
    /// Mean of the thermal pads of each module then, counts.
    pub pads: Vec<Option<f64>>,
}

/// JSON has `null` for a number that is missing.
fn with_gaps<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let numbers = Vec::<Option<f64>>::deserialize(deserializer)?;
    Ok(numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect())
}

impl TakenZero {
    pub(super) fn baseline(&self) -> Vec<TaxelBaseline> {
        self.mean.iter().zip(&self.noise).map(|(&mean, &noise)| TaxelBaseline { mean, noise }).collect()
    }
}

/// Whether two sets of models refer to one zero, to the bit.
pub(super) fn have_same_rest(a: &[TaxelBaseline], b: &[TaxelBaseline]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.mean.to_bits() == b.mean.to_bits())
}

fn fingerprint(rest: &[TaxelBaseline]) -> u64 {
    let mut hasher = DefaultHasher::new();
    rest.iter().for_each(|taxel| hasher.write_u64(taxel.mean.to_bits()));
    hasher.finish()
}

/// A zero that no models were there to judge: that of a first session.
#[derive(Clone, Debug, Default)]
pub(super) struct Unjudged {
    /// Why a zero needed confirmation when it was taken. It does again once the models are others than those of the session.
    pub(super) needs_confirmation: Option<String>,
    pub(super) models: Models,
    /// Of the models of such a session those that were in use last, perhaps before the daemon started.
    pub(super) own: Option<String>,
    /// Fingerprints of the zeros that sessions have taken since: models of the boards as they are refer to one of these.
    pub(super) rests: BTreeSet<u64>,
}

/// Which models are in use at a zero that none have judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Models {
    #[default]
    None,
    /// Those of a session, which are of the boards as they are.
    OfSession,
    /// Others. The ramp that it was taken for goes on, but there is no force.
    Others,
}

impl Unjudged {
    /// Another zero of this kind was taken, after that of `before`, if there was one.
    pub(super) fn after(before: Option<Self>, needs_confirmation: Option<String>) -> Self {
        Self { needs_confirmation, rests: before.map(|before| before.rests).unwrap_or_default(), ..Self::default() }
    }

    pub(super) fn is_of_other_models(&self) -> bool {
        self.models == Models::Others
    }

    /// A session took a zero to which the models refer that it makes.
    pub(super) fn note_rest(&mut self, rest: &[TaxelBaseline]) {
        self.rests.insert(fingerprint(rest));
    }

    /// Another set is in use. Returns whether it was made in such a session, or by known loads of one that was.
    pub(super) fn owns(&mut self, set: &ModelSet) -> bool {
        let is_own = self.own.as_ref() == Some(&set.id) || self.rests.contains(&fingerprint(&set.baseline));
        if is_own {
            self.own = Some(set.id.clone());
            self.note_rest(&set.baseline);
        }
        is_own
    }
}
