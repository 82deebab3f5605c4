//! What rising and falling pressure together add to MODELS.json.

use serde::{Deserialize, Serialize};
use taxel_engine::model_set::{GaugeClock, Recorded, RecordedTaxel, ZeroReturn};
use taxel_model::bounded::List;
use taxel_model::{Plays, TERMS_MAX};

use super::limits::TAXELS_MAX;

/// The part of the file, field by field; the names are the format.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Part {
    smooth_s: f64,
    module_size: usize,
    lag_s: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    zero_return: Option<ZeroReturnCounts>,
    plays_error_ratio: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    clock: Option<Clock>,
    taxels: List<Option<Entry>, TAXELS_MAX>,
}

/// In counts.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ZeroReturnCounts {
    rms: f64,
    common: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Clock {
    offset_s: f64,
    rate: f64,
    error_ratio: f64,
    applied: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    rmse_kpa: f64,
    sensitivity: f64,
    hysteresis_kpa: Option<f64>,
    plays: Option<Plays>,
}

impl Part {
    pub(super) fn mirror(recorded: &Recorded) -> Self {
        let entry = |taxel: &RecordedTaxel| Entry {
            rmse_kpa: taxel.rmse_kpa,
            sensitivity: taxel.sensitivity,
            hysteresis_kpa: taxel.hysteresis_kpa,
            plays: taxel.plays.clone(),
        };
        let clock =
            |GaugeClock { offset_s, rate, error_ratio, applied }| Clock { offset_s, rate, error_ratio, applied };
        Self {
            clock: recorded.clock.map(clock),
            smooth_s: recorded.smooth_s,
            module_size: recorded.module_size,
            lag_s: recorded.lag_s,
            zero_return: recorded.zero_return.map(|ZeroReturn { rms, common }| ZeroReturnCounts { rms, common }),
            plays_error_ratio: recorded.plays_error_ratio,
            taxels: List(recorded.taxels.iter().map(|taxel| taxel.as_ref().map(entry)).collect()),
        }
    }

    pub(super) fn read(self) -> Recorded {
        let taxel = |entry: Entry| RecordedTaxel {
            rmse_kpa: entry.rmse_kpa,
            sensitivity: entry.sensitivity,
            hysteresis_kpa: entry.hysteresis_kpa,
            plays: entry.plays,
        };
        let clock =
            |Clock { offset_s, rate, error_ratio, applied }| GaugeClock { offset_s, rate, error_ratio, applied };
        Recorded {
            clock: self.clock.map(clock),
            smooth_s: self.smooth_s,
            module_size: self.module_size,
            lag_s: self.lag_s,
            zero_return: self.zero_return.map(|ZeroReturnCounts { rms, common }| ZeroReturn { rms, common }),
            plays_error_ratio: self.plays_error_ratio,
            taxels: self.taxels.0.into_iter().map(|entry| entry.map(taxel)).collect(),
        }
    }
}

/// Everything that the types cannot say.
pub(super) fn check(recorded: &Recorded, taxels: usize) -> Result<(), String> {
    if recorded.taxels.len() != taxels {
        return Err(format!("`recorded.taxels` has {} entries, expected {taxels}", recorded.taxels.len()));
    }
    if recorded.module_size == 0 {
        return Err("`recorded.module_size` is 0, expected 1 or more".to_owned());
    }
    let at_least = |name: &str, value: f64, least: f64| match value >= least {
        true => Ok(()),
        false => Err(format!("`recorded.{name}` is {value}, expected {least} or more")),
    };
    at_least("smooth_s", recorded.smooth_s, 0.0)?;
    for (number, taxel) in recorded.taxels.iter().enumerate() {
        let Some(taxel) = taxel else { continue };
        let of = |name: &str| format!("taxels[{number}].{name}");
        at_least(&of("rmse_kpa"), taxel.rmse_kpa, 0.0)?;
        at_least(&of("sensitivity"), taxel.sensitivity, f64::MIN_POSITIVE)?;
        let Some(plays) = &taxel.plays else { continue };
        for value in plays.radii_counts.iter().chain(&plays.weights_kpa) {
            at_least(&of("plays"), *value, 0.0)?;
        }
        let [low, high] = plays.range;
        at_least(&of("plays.range"), high, low)?;
        at_least(&of("plays.curve.half_width"), plays.curve.half_width, f64::MIN_POSITIVE)?;
        if !(1..=TERMS_MAX).contains(&plays.curve.chebyshev.len()) {
            let terms = plays.curve.chebyshev.len();
            return Err(format!("`recorded.{}` has {terms} terms, expected 1 to {TERMS_MAX}", of("plays.curve")));
        }
    }
    Ok(())
}
