//! What known loads corrected, in MODELS.json.

use serde::{Deserialize, Serialize};
use taxel_engine::model_set::{EARLIER_MAX, Recalibrated};
use taxel_engine::recalibration::{LoadPoint, POINTS_MAX};
use taxel_model::bounded::{List, Text};

use super::limits::WORDS_BYTES_MAX;

/// The part of the file, field by field; the names are the format.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Part {
    derived_from: Text<WORDS_BYTES_MAX>,
    earlier: List<Text<WORDS_BYTES_MAX>, EARLIER_MAX>,
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
    points: List<Point, POINTS_MAX>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Point {
    number: u64,
    read: f64,
    read_sigma: f64,
    known: f64,
    known_sigma: f64,
}

impl Part {
    pub(super) fn mirror(of: &Recalibrated) -> Self {
        let point = |&LoadPoint { number, read, read_sigma, known, known_sigma }: &LoadPoint| Point {
            number,
            read,
            read_sigma,
            known,
            known_sigma,
        };
        Self {
            derived_from: Text(of.derived_from.clone()),
            earlier: List(of.earlier.iter().cloned().map(Text).collect()),
            area_mm2: of.area_mm2,
            filled: of.filled,
            gain: of.gain,
            gain_sigma: of.gain_sigma,
            offset_kpa: of.offset_kpa,
            offset_sigma_kpa: of.offset_sigma_kpa,
            place_rel: of.place_rel,
            relative_sigma: of.relative_sigma,
            gain_in_all: of.gain_in_all,
            points: List(of.points.iter().map(point).collect()),
        }
    }

    pub(super) fn read(self) -> Recalibrated {
        let point = |Point { number, read, read_sigma, known, known_sigma }| LoadPoint {
            number,
            read,
            read_sigma,
            known,
            known_sigma,
        };
        Recalibrated {
            derived_from: self.derived_from.0,
            earlier: self.earlier.0.into_iter().map(|id| id.0).collect(),
            area_mm2: self.area_mm2,
            filled: self.filled,
            gain: self.gain,
            gain_sigma: self.gain_sigma,
            offset_kpa: self.offset_kpa,
            offset_sigma_kpa: self.offset_sigma_kpa,
            place_rel: self.place_rel,
            relative_sigma: self.relative_sigma,
            gain_in_all: self.gain_in_all,
            points: self.points.0.into_iter().map(point).collect(),
        }
    }
}

/// Everything that the types cannot say.
pub(super) fn check(of: &Recalibrated) -> Result<(), String> {
    let names = std::iter::once(("derived_from", &of.derived_from)).chain(of.earlier.iter().map(|id| ("earlier", id)));
    for (name, id) in names {
        if id.is_empty() || id.len() > WORDS_BYTES_MAX {
            let bytes = id.len();
            return Err(format!("`recalibrated.{name}` has {bytes} bytes, expected 1 to {WORDS_BYTES_MAX}"));
        }
    }
    if of.earlier.len() > EARLIER_MAX {
        return Err(format!("`recalibrated.earlier` has {} entries, the limit is {EARLIER_MAX}", of.earlier.len()));
    }
    let finite = |name: &str, value: f64, least: f64| match value.is_finite() && value >= least {
        true => Ok(()),
        false => Err(format!("`recalibrated.{name}` is {value}, expected a finite number of {least} or more")),
    };
    for (name, value) in [("gain", of.gain), ("gain_in_all", of.gain_in_all)] {
        finite(name, value, f64::MIN_POSITIVE)?;
    }
    of.area_mm2.map_or(Ok(()), |area_mm2| finite("area_mm2", area_mm2, f64::MIN_POSITIVE))?;
    finite("offset_kpa", of.offset_kpa, f64::MIN)?;
    let sigmas = [("gain_sigma", of.gain_sigma), ("offset_sigma_kpa", of.offset_sigma_kpa)];
    for (name, value) in sigmas.into_iter().chain([("place_rel", of.place_rel), ("relative_sigma", of.relative_sigma)])
    {
        finite(name, value, 0.0)?;
    }
    if of.points.len() > POINTS_MAX {
        return Err(format!("`recalibrated.points` has {} entries, the limit is {POINTS_MAX}", of.points.len()));
    }
    of.points
        .iter()
        .find_map(LoadPoint::problem)
        .map_or(Ok(()), |problem| Err(format!("`recalibrated.points`: {problem}")))
}
