//! What known loads corrected, in MODELS.json. The names are the format.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use taxel_engine::model_set::{EARLIER_MAX, Recalibrated};
use taxel_engine::recalibration::{LoadPoint, POINTS_MAX};
use taxel_model::bounded::List;

#[derive(Serialize, Deserialize)]
pub(super) struct Part(#[serde(with = "Fields")] pub(super) Recalibrated);

#[derive(Serialize, Deserialize)]
#[serde(remote = "Recalibrated", deny_unknown_fields)]
struct Fields {
    derived_from: String,
    earlier: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    area_mm2: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    filled: Option<bool>,
    gain: f64,
    gain_sigma: f64,
    offset_kpa: f64,
    offset_sigma_kpa: f64,
    place_rel: f64,
    relative_sigma: f64,
    gain_in_all: f64,
    #[serde(serialize_with = "write_points", deserialize_with = "read_points")]
    points: Vec<LoadPoint>,
}

#[derive(Serialize, Deserialize)]
struct Point(#[serde(with = "PointFields")] LoadPoint);

#[derive(Serialize, Deserialize)]
#[serde(remote = "LoadPoint", deny_unknown_fields)]
struct PointFields {
    number: u64,
    read: f64,
    read_sigma: f64,
    known: f64,
    known_sigma: f64,
}

fn write_points<S: Serializer>(points: &[LoadPoint], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(points.iter().copied().map(Point))
}

fn read_points<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<LoadPoint>, D::Error> {
    let List(points) = List::<Point, POINTS_MAX>::deserialize(deserializer)?;
    Ok(points.into_iter().map(|Point(point)| point).collect())
}

/// Everything that the types cannot say.
pub(super) fn check(of: &Recalibrated) -> Result<(), String> {
    if std::iter::once(&of.derived_from).chain(&of.earlier).any(String::is_empty) {
        return Err("`recalibrated` has an id of 0 bytes, expected those of model sets".to_owned());
    }
    if of.earlier.len() > EARLIER_MAX {
        return Err(format!("`recalibrated.earlier` has {} entries, the limit is {EARLIER_MAX}", of.earlier.len()));
    }
    let (above, sigma) = (f64::MIN_POSITIVE, 0.0);
    for (name, value, least) in [
        ("gain", of.gain, above),
        ("gain_in_all", of.gain_in_all, above),
        ("area_mm2", of.area_mm2.unwrap_or(above), above),
        ("gain_sigma", of.gain_sigma, sigma),
        ("offset_sigma_kpa", of.offset_sigma_kpa, sigma),
        ("place_rel", of.place_rel, sigma),
        ("relative_sigma", of.relative_sigma, sigma),
    ] {
        if value < least {
            return Err(format!("`recalibrated.{name}` is {value}, expected {least} or more"));
        }
    }
    let problem = of.points.iter().find_map(LoadPoint::problem);
    problem.map_or(Ok(()), |problem| Err(format!("`recalibrated.points`: {problem}")))
}
