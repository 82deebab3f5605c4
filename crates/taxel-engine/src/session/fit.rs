//! The fit over a session's samples: run outside the engine, because it takes milliseconds.

use std::sync::Arc;
use taxel_model::{Accumulator, Estimator, FitOptions, FixedPressure, Order, Samples, TaxelModel, fit};

use crate::model_set::ModelSet;
use crate::session::SessionSamples;

/// A fit to be run outside the engine.
#[derive(Clone, Debug)]
pub struct FitJob {
    /// Number of the session.
    pub session: u64,
    /// The patch.
    pub patch: String,
    /// When it was asked for, nanoseconds since 1970.
    pub wall_ns: i64,
    /// Board settings in words.
    pub board_settings: Vec<String>,
    /// All that was gathered.
    pub samples: Arc<SessionSamples>,
    /// How to fit.
    pub options: FitOptions,
}

/// What a fit came to.
#[derive(Clone, Debug)]
pub struct FitOutcome {
    /// Number of the session.
    pub session: u64,
    /// The model set, or why there is none.
    pub result: Result<Arc<ModelSet>, String>,
}

impl FitJob {
    /// Fits every taxel. `id_of` makes the id of the finished set from its content.
    #[must_use]
    pub fn run(&self, id_of: impl Fn(&ModelSet) -> String) -> FitOutcome {
        let result = self.model_set().map(|mut set| {
            set.id = id_of(&set);
            Arc::new(set)
        });
        FitOutcome { session: self.session, result }
    }

    fn model_set(&self) -> Result<ModelSet, String> {
        let samples = &self.samples.samples;
        let (Some(first), Some(ramp)) = (samples.first(), self.samples.ramps.first()) else {
            return Err("no sample was gathered: the pressure never rose while every module was heard".to_owned());
        };
        let pressures: Vec<Option<FixedPressure>> =
            samples.iter().map(|sample| FixedPressure::from_kpa(sample.pressure_kpa)).collect();
        let taxels: Vec<TaxelModel> = (0..first.counts.len()).map(|t| self.fit_taxel(t, &pressures)).collect();
        if taxels.iter().all(|model| !model.is_usable()) {
            let why = taxels.first().map_or_else(String::new, |model| format!("; taxel 0: {}", model.status));
            return Err(format!(
                "none of the {} taxels gives a usable model from {} samples{why}",
                taxels.len(),
                samples.len()
            ));
        }
        Ok(ModelSet {
            id: String::new(),
            patch: self.patch.clone(),
            created_wall_ns: self.wall_ns,
            session: Some(self.session),
            method: method(&self.options),
            board_settings: self.board_settings.clone(),
            baseline: ramp.taxels.clone(),
            pressure_max_kpa: samples.iter().map(|s| s.pressure_kpa).fold(f64::NEG_INFINITY, f64::max),
            gauge_gain_rel: self.options.gauge.gain_rel,
            gauge_offset_kpa: self.options.gauge.offset_kpa,
            taxels,
            recorded: None,
        })
    }

    fn fit_taxel(&self, taxel: usize, pressures: &[Option<FixedPressure>]) -> TaxelModel {
        let samples = &self.samples.samples;
        if self.samples.ramps.len() <= 1 {
            // One zero for all samples: the counts are integers, and so are all sums.
            let mut sums = Accumulator::new();
            let counts = samples.iter().map(|sample| sample.counts.get(taxel).copied().unwrap_or(0));
            sums.extend(counts.zip(pressures.iter().copied()), 0);
            return sums.fit(&self.options);
        }
        // Each ramp has its own zero: counts are brought to that of the first.
        let shift = |ramp: u16| {
            let zero = |r: &crate::session::RampBaseline| r.taxels.get(taxel).map_or(0.0, |t| t.mean);
            let first = self.samples.ramps.first().map_or(0.0, zero);
            let own = self.samples.ramps.iter().find(|r| r.ramp == ramp).map_or(first, zero);
            if (first - own).is_finite() { first - own } else { 0.0 }
        };
        let shifts: Vec<f64> = (0..=samples.last().map_or(0, |s| s.ramp)).map(shift).collect();
        let count =
            |s: &crate::record::Sample| f64::from(s.counts.get(taxel).copied().unwrap_or(0)) + shifts[s.ramp as usize];
        let counts: Vec<f64> = samples.iter().map(count).collect();
        let kpa: Vec<f64> = samples.iter().map(|s| s.pressure_kpa).collect();
        let ramps: Vec<u16> = samples.iter().map(|s| s.ramp).collect();
        fit(&Samples { ramp: Some(&ramps), ..Samples::new(&counts, &kpa) }, &self.options)
    }
}

/// How a set was fitted, in words.
#[must_use]
pub fn method(options: &FitOptions) -> String {
    let order = match options.order {
        Order::Fixed(order) => format!("order {order}"),
        Order::Auto => "order by leave-one-out error".to_owned(),
    };
    let estimator = match options.estimator {
        Estimator::PerSample => "per-sample",
        Estimator::PressureBinned => "pressure-binned",
    };
    format!("{order}, {estimator}{}", if options.exact { ", exact" } else { "" })
}
