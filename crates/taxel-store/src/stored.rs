//! How the engine's types look in a fact's JSON: the names here are the format.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use taxel_engine::calibration::fit::Branch;
use taxel_engine::calibration::{Direction, RefusalCounts, SampleRefusal, SessionState, SessionView};
use taxel_engine::known_set::SetSummary;
use taxel_engine::loads::{Load, Reading};
use taxel_engine::record::{BoardZeros, HiddenCounts};

/// The view of a session: all but the readings of the moment.
#[derive(Serialize, Deserialize)]
pub(crate) struct StoredView(#[serde(with = "View")] pub(crate) SessionView);

#[derive(Serialize, Deserialize)]
#[serde(remote = "SessionView")]
struct View {
    number: u64,
    patch: String,
    #[serde(with = "State")]
    state: SessionState,
    reason: String,
    started_wall_ns: i64,
    changed_wall_ns: i64,
    confirmed_by: Option<String>,
    predecessor: Option<u64>,
    left_out: Vec<u16>,
    #[serde(serialize_with = "as_is", deserialize_with = "shared")]
    board_settings: Arc<[String]>,
    gauge: String,
    #[serde(deserialize_with = "finite")]
    target_kpa: f64,
    #[serde(with = "Branches")]
    branches: Branch,
    #[serde(with = "OfBranch")]
    direction: Direction,
    ramps: u16,
    accepted: u64,
    #[serde(with = "refused")]
    refused: RefusalCounts,
    #[serde(skip)]
    durable: u64,
    #[serde(skip)]
    pressure_kpa: Option<f64>,
    #[serde(skip)]
    gauge_zero_kpa: f64,
    #[serde(skip)]
    rate_kpa_per_s: Option<f64>,
    #[serde(deserialize_with = "finite")]
    coverage: f64,
    responding: (u32, u32),
    #[serde(skip)]
    not_responding: Arc<[u16]>,
    #[serde(skip)]
    remaining_s: Option<f64>,
    #[serde(skip)]
    look: Arc<[String]>,
    #[serde(serialize_with = "word", deserialize_with = "shared_word")]
    model_set: Option<Arc<str>>,
    untrusted: String,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "SessionState")]
enum State {
    Taring,
    Ramping,
    Fitting,
    Review,
    Active,
    Discarded,
    Aborted,
    Failed,
    Interrupted,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Branch")]
enum Branches {
    Rising,
    Both,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Direction")]
enum OfBranch {
    Rising,
    Falling,
}

/// A number that is not finite is `null` in JSON, and 0 here.
fn finite<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or_default())
}

fn as_is<S: Serializer>(lines: &Arc<[String]>, serializer: S) -> Result<S::Ok, S::Error> {
    (**lines).serialize(serializer)
}

fn shared<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<[String]>, D::Error> {
    Ok(Vec::deserialize(deserializer)?.into())
}

fn word<S: Serializer>(word: &Option<Arc<str>>, serializer: S) -> Result<S::Ok, S::Error> {
    word.as_deref().serialize(serializer)
}

fn shared_word<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Arc<str>>, D::Error> {
    Ok(Option::<String>::deserialize(deserializer)?.map(Into::into))
}

/// By the names of the reasons; one that this version does not know is left out.
mod refused {
    use super::*;

    pub(super) fn serialize<S: Serializer>(counts: &RefusalCounts, serializer: S) -> Result<S::Ok, S::Error> {
        let named = SampleRefusal::ALL.into_iter().map(|why| (why.name(), counts.get(why)));
        named.collect::<BTreeMap<_, _>>().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<RefusalCounts, D::Error> {
        let named = BTreeMap::<String, u64>::deserialize(deserializer)?;
        let mut counts = RefusalCounts::default();
        for why in SampleRefusal::ALL {
            counts.add_many(why, named.get(why.name()).copied().unwrap_or_default());
        }
        Ok(counts)
    }
}

/// A known load.
#[derive(Serialize, Deserialize)]
pub(crate) struct StoredLoad(#[serde(with = "LoadFields")] pub(crate) Load);

#[derive(Serialize, Deserialize)]
#[serde(remote = "Load")]
struct LoadFields {
    number: u64,
    patch: String,
    wall_ns: i64,
    by: String,
    note: String,
    mass_kg: Option<f64>,
    force_n: f64,
    force_sigma_n: f64,
    replaces: Option<u64>,
    #[serde(with = "ReadingFields")]
    read: Reading,
    model_set: String,
    mean_area_mm2: f64,
    filled: Option<bool>,
    area_factor: f64,
    area_uncertainty: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Reading")]
struct ReadingFields {
    scans: u32,
    mean_n: f64,
    scatter_n: f64,
    sigma_n: f64,
    out_of_range: u32,
    uncovered_share: f64,
    reasons: Vec<String>,
    taxels: Vec<u16>,
    filled_share: f64,
}

/// What lists show of a model set.
#[derive(Serialize, Deserialize)]
pub(crate) struct StoredSummary(#[serde(with = "Summary")] pub(crate) SetSummary);

#[derive(Serialize, Deserialize)]
#[serde(remote = "SetSummary")]
struct Summary {
    id: String,
    patch: String,
    created_wall_ns: i64,
    session: Option<u64>,
    method: String,
    taxels: usize,
    calibrated: usize,
    pressure_max_kpa: f64,
    origins: Vec<String>,
    recalibration_gain: Option<f64>,
}

/// What is known of the zeros of a patch's boards.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct StoredZeros {
    unproven: Option<String>,
    excused: Option<String>,
    hidden: Option<Hidden>,
}

/// Counts by taxel, without a number where none was read.
#[derive(Serialize, Deserialize)]
struct Hidden {
    counts: Vec<Option<f32>>,
    reads: Vec<Option<f32>>,
}

impl StoredZeros {
    pub(crate) fn of(zeros: &BoardZeros) -> Self {
        let numbers = |counts: &[f32]| counts.iter().map(|count| count.is_finite().then_some(*count)).collect();
        let hidden = |hidden: &HiddenCounts| Hidden { counts: numbers(&hidden.counts), reads: numbers(&hidden.reads) };
        Self {
            unproven: zeros.unproven.clone(),
            excused: zeros.excused.clone(),
            hidden: zeros.hidden.as_deref().map(hidden),
        }
    }

    pub(crate) fn zeros(self) -> BoardZeros {
        let numbers = |counts: Vec<Option<f32>>| counts.into_iter().map(|count| count.unwrap_or(f32::NAN)).collect();
        let hidden = |Hidden { counts, reads }| HiddenCounts { counts: numbers(counts), reads: numbers(reads) };
        BoardZeros {
            unproven: self.unproven,
            excused: self.excused,
            hidden: self.hidden.map(|known| Arc::new(hidden(known))),
        }
    }
}
